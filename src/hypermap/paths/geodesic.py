"""Exact any-angle shortest distances over free cells: straight lines that turn at wall corners.

From the source, and from each corner in the order of its distance, the cells that come into sight
there are looked at row by row, within the cone that was hidden until then.

Source: the continuous Dijkstra method (Mitchell, Mount, Papadimitriou 1987).
"""

from __future__ import annotations

import numpy as np

from hypermap._loops import inner_loop, loop
from hypermap.paths.cones import SOURCE, Cones, Reached, Search, look, root_of, run_at
from hypermap.paths.heap import empty_heap, pop
from hypermap.paths.strips import Strips

_AROUND = 2.0  # cells beyond the goal up to which the search continues


def reach(
    strips: Strips,
    width: int,
    source: tuple[float, float],
    goal: tuple[float, float] | None = None,
    goal_cell: int = -1,
) -> Reached:
    """Return the distance of all cells from a point, or of those that matter for a goal.

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
    most = 2 * len(strips.begins) + 4 * width
    cones = Cones(
        np.empty(most, dtype=np.int32),
        np.empty(most, dtype=np.int32),
        np.empty(most),
        np.empty(most),
        np.empty(most, dtype=np.int32),
        np.empty(most, dtype=np.int32),
    )
    target = np.array([np.nan, np.nan] if goal is None else goal)
    state = Search(empty_heap(count), cones, np.array(source, dtype=float), target)
    sweep(strips, width, goal_cell, reached, state)
    return reached


@loop()
def sweep(strips: Strips, width: int, goal_cell: int, reached: Reached, state: Search) -> int:
    """Fill in all distances from the source; return how many corners were visited."""
    height = len(strips.rows) - 1
    # Of the types that _turn hands over: for each literal, all would be compiled once more.
    source, neither = int(np.int32(SOURCE)), int(np.int64(0))
    up, down = int(np.int64(1)), int(np.int64(-1))
    root = root_of(strips, source, reached, state)
    x, y = root.x, root.y
    row = int(np.floor(y))
    if row < height:
        run = run_at(strips, row, x, neither)
        if run >= 0:
            if y > row:
                _look_along(strips, width, row, run, x, y, reached)
            look(strips, width, root, up, row, run, -np.inf, np.inf, reached, state)
            if y > row:
                look(strips, width, root, down, row, run, -np.inf, np.inf, reached, state)
    if y == row and row > 0:
        run = run_at(strips, row - 1, x, neither)
        if run >= 0:
            look(strips, width, root, down, row - 1, run, -np.inf, np.inf, reached, state)
    turned = 0
    while state.heap.size[0] > 0:
        if (
            goal_cell >= 0
            and state.heap.keys[state.heap.items[0]] > reached.far[goal_cell] + _AROUND
        ):
            break
        corner = pop(state.heap)
        turned += 1
        _turn(strips, width, corner, reached, state)
    return turned


@inner_loop()
def _look_along(
    strips: Strips, width: int, row: int, run: int, x: float, y: float, reached: Reached
) -> None:
    """Fill in the run of cells in which the source is."""
    for col in range(strips.begins[run], strips.ends[run]):
        reached.far[row * width + col] = np.sqrt((col + 0.5 - x) ** 2 + (row + 0.5 - y) ** 2)
        reached.roots[row * width + col] = SOURCE


@inner_loop()
def _turn(strips: Strips, width: int, corner: int, reached: Reached, state: Search) -> None:
    """Visit the cells hidden behind a corner, as seen from the previous root."""
    root = root_of(strips, corner, reached, state)
    before = root_of(strips, reached.corner_roots[corner], reached, state)
    side, level = strips.sides[corner], strips.levels[corner]
    ux, uy = root.x - before.x, root.y - before.y
    slope = ux / abs(uy) if uy != 0 else np.copysign(np.inf, ux)
    if ux * side < 0 and uy * level >= 0:  # between the way on and the upright wall
        step, low, high = level, min(slope, 0.0), max(slope, 0.0)
    else:  # between the way on and the level wall
        step = -level
        low, high = (slope, np.inf) if side > 0 else (-np.inf, slope)
    row = int(root.y) if step > 0 else int(root.y) - 1
    run = run_at(strips, row, root.x, 1 if high > 0 else -1)
    if run >= 0:
        look(strips, width, root, step, row, run, low, high, reached, state)
