"""The cheapest way where cells cost differently: A* in 16 directions, then straight lines.

Source: Hart, Nilsson, Raphael 1968; the 16 directions are those of Rivera et al., "Grid pathfinding
on the 2^k neighborhoods" (AAAI 2017), whose ways are at most 2.8 % longer than straight lines. What
is straight is found afterwards, as in the smoothing of Botea, Müller, Schaeffer (2004).
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from hypermap._loops import inner_loop, loop
from hypermap.core.arrays import IntArray
from hypermap.paths.heap import Heap, empty_heap, pop, push
from hypermap.paths.segments import line_cost

_STEPS = np.array(
    [
        *((dr, dc) for dr in (-1, 0, 1) for dc in (-1, 0, 1) if (dr, dc) != (0, 0)),
        *((dr, dc) for dr in (-2, -1, 1, 2) for dc in (-2, -1, 1, 2) if abs(dr) != abs(dc)),
    ],
    dtype=np.int64,
)
_GREEDY = 1.0005  # of equally cheap ways, that nearer to the goal first
_CHEAPER = 1.001  # a straight line may cost so much more


def cheapest_cells(cost: NDArray[np.float32], start: int, goal: int) -> IntArray | None:
    """Return the flat indices of the cells on the cheapest way, shape (N,); None if there is none.

    Args:
        cost: of a step in each cell, 1 or more, infinite where blocked, shape (height, width).
        start: flat index of the first cell.
        goal: of the last one.
    """
    before = np.full(cost.size, -1, dtype=np.int32)
    spent = np.full(cost.size, np.inf)
    if not search(cost, _STEPS, start, goal, before, spent, empty_heap(cost.size)):
        return None
    way = [goal]
    while way[-1] != start:
        way.append(int(before[way[-1]]))
    return np.array(way[::-1], dtype=np.int64)


def straightened(cost: NDArray[np.float32], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a polyline with straight lines wherever they cost no more.

    Args:
        cost: as above.
        points: in cells, (x, y), shape (N, 2).
    """
    kept = points
    while True:
        costs = [line_cost(cost, *a, *b) for a, b in itertools.pairwise(kept)]
        sums = np.concatenate([[0.0], np.cumsum(costs)])
        chosen = [0]
        while chosen[-1] < len(kept) - 1:
            here, there = chosen[-1], len(kept) - 1
            while there > here + 1:
                straight = line_cost(cost, *kept[here], *kept[there])
                if straight <= _CHEAPER * (sums[there] - sums[here]):
                    break
                there = here + (there - here) // 2
            chosen.append(there)
        if len(chosen) == len(kept):
            return kept
        kept = kept[chosen]


@inner_loop()
def _ahead(rows: int, cols: int) -> float:
    """Return the length of the shortest way in 16 directions where nothing is blocked."""
    long, short = max(abs(rows), abs(cols)), min(abs(rows), abs(cols))
    if 2 * short <= long:
        return float(long - 2 * short + short * 2.23606797749979)
    return float((long - short) * 2.23606797749979 + (2 * short - long) * 1.4142135623730951)


@inner_loop()
def _step_cost(
    cost: NDArray[np.float32], row: int, col: int, step_row: int, step_col: int
) -> float:
    """Return what a step costs, by the cells that it crosses; infinite where one is blocked."""
    long = max(abs(step_row), abs(step_col))
    total = cost[row, col] + cost[row + step_row, col + step_col]
    if step_row == 0 or step_col == 0:
        return float(total / 2)
    length = 1.4142135623730951 if long == 1 else 2.23606797749979
    # A step of (1, 1) passes both cells next to it; one of (2, 1) the two in its middle.
    half_row, half_col = int(step_row / long), int(step_col / long)
    one_row, one_col = (half_row, 0) if long == 1 or abs(step_row) == 2 else (0, half_col)
    one = cost[row + one_row, col + one_col]
    if long == 1:
        other = cost[row, col + step_col]
    else:
        other = cost[row + step_row - one_row, col + step_col - one_col]
    return float(length * (total + one + other) / 4)


@loop()
def search(
    cost: NDArray[np.float32],
    steps: NDArray[np.int64],
    start: int,
    goal: int,
    before: NDArray[np.int32],
    spent: NDArray[np.float64],
    heap: Heap,
) -> bool:
    """Fill in the cell before each, from the start on, until the goal is reached; return if it was.

    Args:
        cost: of each cell, shape (height, width).
        steps: the directions, as rows and columns, shape (16, 2).
        start: flat index.
        goal: flat index.
        before: -1, flat.
        spent: infinite, flat; becomes what the way to a cell costs.
        heap: empty, for all cells.
    """
    height, width = cost.shape
    spent[start] = 0.0
    push(heap, start, 0.0)
    while heap.size[0] > 0:
        cell = pop(heap)
        if cell == goal:
            return True
        row, col = cell // width, cell % width
        for i in range(len(steps)):
            r, c = row + steps[i, 0], col + steps[i, 1]
            if r < 0 or c < 0 or r >= height or c >= width or cost[r, c] == np.inf:
                continue
            other = r * width + c
            if spent[other] <= spent[cell]:
                continue
            total = spent[cell] + _step_cost(cost, row, col, steps[i, 0], steps[i, 1])
            if total < spent[other]:
                spent[other] = total
                before[other] = cell
                push(heap, other, total + _GREEDY * _ahead(r - goal // width, c - goal % width))
    return False
