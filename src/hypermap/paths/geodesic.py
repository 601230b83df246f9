"""Exact shortest distances over free cells: straight lines that turn at corners of walls alone.

From the source, and from each corner in the order of its distance, the cells that come into sight
there are looked at row by row, within the cone that was hidden until then. A cone ends where others
reach its cells on a shorter way.

Source: the continuous Dijkstra method (Mitchell, Mount, Papadimitriou 1987), with cones over the
rows of a grid as in Anya (Harabor, Grastien, Öz, Aksakalli, "Optimal any-angle pathfinding in
practice", JAIR 56, 2016).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hypermap._loops import inner_loop, loop
from hypermap.paths.heap import Heap, empty_heap, pop, push
from hypermap.paths.strips import Strips

SOURCE = -1
_SAME_FAR = 1e-3  # cells by which ways to a cell differ, and are taken for the same; as of float32
_SAME = 1e-9  # cells
_NARROW = 1e-12  # a cone's width, where it ends
_AROUND = 2.0  # cells beyond the goal up to which the search goes on


class Reached(NamedTuple):
    """How far cells and corners are from a source, in cells.

    Attributes:
        far: of each cell's center, float32, flat; infinite where there is no way.
        roots: the last corner on the way there, int32, flat; SOURCE for none.
        corner_far: of each corner of the strips, float64.
        corner_roots: the last corner before it, int32.
    """

    far: NDArray[np.float32]
    roots: NDArray[np.int32]
    corner_far: NDArray[np.float64]
    corner_roots: NDArray[np.int32]


class _Cones(NamedTuple):
    """Cones that wait, each at the row where it goes on; slopes are x per row, from the root."""

    rows: NDArray[np.int32]
    runs: NDArray[np.int32]
    lows: NDArray[np.float64]
    highs: NDArray[np.float64]


class _Work(NamedTuple):
    heap: Heap
    cones: _Cones
    goal: NDArray[np.float64]


def reach(
    strips: Strips,
    width: int,
    source: tuple[float, float],
    goal: tuple[float, float] | None = None,
    goal_cell: int = -1,
) -> Reached:
    """Return how far all cells are from a point, or all that matter on the way to another.

    Args:
        strips: free space.
        width: of the grid, in cells.
        source: (x, y) in cells, in free space or at its border.
        goal: likewise; None for all.
        goal_cell: flat index of a free cell that the goal is in.
    """
    height, count = len(strips.rows) - 1, len(strips.xs)
    reached = Reached(
        np.full(height * width, np.inf, dtype=np.float32),
        np.full(height * width, SOURCE, dtype=np.int32),
        np.full(count, np.inf),
        np.full(count, SOURCE, dtype=np.int32),
    )
    most = len(strips.begins) + 2
    cones = _Cones(
        np.empty(most, dtype=np.int32),
        np.empty(most, dtype=np.int32),
        np.empty(most),
        np.empty(most),
    )
    target = np.array([np.nan, np.nan] if goal is None else goal)
    work = _Work(empty_heap(count), cones, target)
    sweep(strips, width, source[0], source[1], goal_cell, reached, work)
    return reached


@loop()
def sweep(
    strips: Strips,
    width: int,
    x: float,
    y: float,
    goal_cell: int,
    reached: Reached,
    work: _Work,
) -> int:
    """Fill in what is reached from (x, y); return how many corners that took."""
    height = len(strips.rows) - 1
    row = int(np.floor(y))
    if row < height:
        run = _run_at(strips, row, x, 0)
        if run >= 0:
            if y > row:
                _look_along(strips, width, row, run, x, y, reached)
            _look(strips, width, SOURCE, x, y, 0.0, 1, row, run, -np.inf, np.inf, reached, work)
            if y > row:
                _look(
                    strips, width, SOURCE, x, y, 0.0, -1, row, run, -np.inf, np.inf, reached, work
                )
    if y == row and row > 0:
        run = _run_at(strips, row - 1, x, 0)
        if run >= 0:
            _look(
                strips, width, SOURCE, x, y, 0.0, -1, row - 1, run, -np.inf, np.inf, reached, work
            )
    turned = 0
    while work.heap.size[0] > 0:
        if goal_cell >= 0 and work.heap.keys[work.heap.items[0]] > reached.far[goal_cell] + _AROUND:
            break
        corner = pop(work.heap)
        turned += 1
        _turn(strips, width, corner, x, y, reached, work)
    return turned


@inner_loop()
def _run_at(strips: Strips, row: int, x: float, side: int) -> int:
    """Return the run of a row that holds x, and goes on to a side of it (-1, 1, 0 any); or -1."""
    low, high = strips.rows[row], strips.rows[row + 1]
    while low < high:  # the first run that ends at x or later
        middle = (low + high) // 2
        end = strips.ends[middle]
        if end < x or (end == x and side > 0):
            low = middle + 1
        else:
            high = middle
    if low == strips.rows[row + 1]:
        return -1
    begin = strips.begins[low]
    return low if begin < x or (begin == x and side >= 0) else -1


@inner_loop()
def _look_along(
    strips: Strips, width: int, row: int, run: int, x: float, y: float, reached: Reached
) -> None:
    """Fill in the run of cells in which the source is."""
    for col in range(strips.begins[run], strips.ends[run]):
        reached.far[row * width + col] = np.sqrt((col + 0.5 - x) ** 2 + (row + 0.5 - y) ** 2)
        reached.roots[row * width + col] = SOURCE


@inner_loop()
def _turn(
    strips: Strips, width: int, corner: int, x: float, y: float, reached: Reached, work: _Work
) -> None:
    """Look at what was hidden behind a corner, seen from where the way to it comes from."""
    cx, cy = float(strips.xs[corner]), float(strips.ys[corner])
    side, level = strips.sides[corner], strips.levels[corner]
    before = reached.corner_roots[corner]
    if before == SOURCE:
        ux, uy = cx - x, cy - y
    else:
        ux, uy = cx - strips.xs[before], cy - strips.ys[before]
    slope = ux / abs(uy) if uy != 0 else np.copysign(np.inf, ux)
    if ux * side < 0 and uy * level >= 0:  # between the way on and the upright wall
        step, low, high = level, min(slope, 0.0), max(slope, 0.0)
    else:  # between the way on and the level wall
        step = -level
        low, high = (slope, np.inf) if side > 0 else (-np.inf, slope)
    row = int(cy) if step > 0 else int(cy) - 1
    run = _run_at(strips, row, cx, 1 if high > 0 else -1)
    if run >= 0:
        far = reached.corner_far[corner]
        _look(strips, width, corner, cx, cy, far, step, row, run, low, high, reached, work)


@inner_loop()
def _look(
    strips: Strips,
    width: int,
    root: int,
    x: float,
    y: float,
    far: float,
    step: int,
    row: int,
    run: int,
    low: float,
    high: float,
    reached: Reached,
    work: _Work,
) -> None:
    """Fill in the cells in a cone whose root is at (x, y) and `far` away from the source.

    Args:
        strips: free space.
        width: of the grid.
        root: number of the corner, or SOURCE.
        x: of the root.
        y: of the root.
        far: how far the root is.
        step: 1 for a cone upward, -1 downward.
        row: the first row in it.
        run: the run of free cells there.
        low: the cone's left border, as x per row; infinite where it is level.
        high: its right border.
        reached: what is filled in.
        work: what waits.
    """
    if y == np.floor(y):  # along the line that the root is on
        left = float(strips.begins[run]) if low == -np.inf else x
        right = float(strips.ends[run]) if high == np.inf else x
        _meet(strips, root, x, y, far, int(y), left, right, reached, work)
    cones = work.cones
    cones.rows[0], cones.runs[0], cones.lows[0], cones.highs[0] = row, run, low, high
    waiting = 1
    while waiting > 0:
        waiting -= 1
        row, run = cones.rows[waiting], cones.runs[waiting]
        low, high = cones.lows[waiting], cones.highs[waiting]
        begin, end = float(strips.begins[run]), float(strips.ends[run])
        to_middle = (row + 0.5 - y) * step
        if to_middle > 0:
            first = int(np.ceil(max(begin, x + low * to_middle) - 0.5 - _SAME))
            last = int(np.floor(min(end, x + high * to_middle) - 0.5 + _SAME))
            first, last = max(first, int(begin)), min(last, int(end) - 1)
            new_first, new_last = width, -1
            square = to_middle * to_middle
            for col in range(first, last + 1):
                across = col + 0.5 - x
                length = far + np.sqrt(across * across + square)
                known = reached.far[row * width + col]
                if length < known:
                    reached.far[row * width + col] = length
                    reached.roots[row * width + col] = root
                if length < known + _SAME_FAR:  # on the cone's border the way before is as long
                    new_first, new_last = min(new_first, col), col
            if first <= last and new_last < 0 and (row != int(y) or root != SOURCE):
                continue
            if new_last >= 0:
                if new_first > first:
                    low = max(low, (new_first - 0.5 - x) / to_middle)
                if new_last < last:
                    high = min(high, (new_last + 1.5 - x) / to_middle)
        to_line = to_middle + 0.5
        low, high = max(low, (begin - x) / to_line), min(high, (end - x) / to_line)
        if high < low - _NARROW:
            continue
        left, right = x + low * to_line, x + high * to_line
        line = row + 1 if step > 0 else row
        _meet(strips, root, x, y, far, line, left, right, reached, work)
        row += step
        if high - low < _NARROW or row < 0 or row >= len(strips.rows) - 1:
            continue
        run = _first_run(strips, row, left)
        while run < strips.rows[row + 1] and strips.begins[run] < right:
            cones.rows[waiting], cones.runs[waiting] = row, run
            cones.lows[waiting] = max(low, (strips.begins[run] - x) / to_line)
            cones.highs[waiting] = min(high, (strips.ends[run] - x) / to_line)
            if cones.highs[waiting] - cones.lows[waiting] > _NARROW:
                waiting += 1
            run += 1


@inner_loop()
def _first_run(strips: Strips, row: int, left: float) -> int:
    """Return the first run of a row that ends behind x = `left`."""
    low, high = strips.rows[row], strips.rows[row + 1]
    while low < high:
        middle = (low + high) // 2
        if strips.ends[middle] <= left:
            low = middle + 1
        else:
            high = middle
    return int(low)


@inner_loop()
def _meet(
    strips: Strips,
    root: int,
    x: float,
    y: float,
    far: float,
    line: int,
    left: float,
    right: float,
    reached: Reached,
    work: _Work,
) -> None:
    """Let the corners on a line that come into sight wait, if a way may turn there."""
    low, high = strips.lines[line], strips.lines[line + 1]
    stop = high
    while low < high:
        middle = (low + high) // 2
        if strips.xs[middle] < left - _SAME:
            low = middle + 1
        else:
            high = middle
    corner = low
    while corner < stop and strips.xs[corner] <= right + _SAME:
        ux, uy = strips.xs[corner] - x, line - y
        side, level = strips.sides[corner], strips.levels[corner]
        turns = (ux * side < 0 and uy * level >= 0) or (uy * level < 0 and ux * side >= 0)
        if turns:
            length = far + np.sqrt(ux * ux + uy * uy)
            known = reached.corner_far[corner]
            if length < known - _SAME:
                reached.corner_far[corner] = length
                reached.corner_roots[corner] = root
                key = length
                if work.goal[0] == work.goal[0]:
                    gx, gy = work.goal[0] - strips.xs[corner], work.goal[1] - line
                    key += np.sqrt(gx * gx + gy * gy)
                push(work.heap, corner, key)
            elif length <= known + _SAME and work.heap.places[corner] >= 0:
                reached.corner_roots[corner] = root  # a corner in line, which the way touches
        corner += 1
