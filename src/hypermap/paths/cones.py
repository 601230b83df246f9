"""Visibility cones over the rows of a grid: cells that a root sees and is nearest to.

A cone ends where others reach its cells on a shorter way. Between two such cells it goes on if
something may be hidden there from those others: what fits between two cells' centers may open into
a room.

Source: cones over the rows of a grid as in Anya (Harabor, Grastien, Öz, Aksakalli, "Optimal
any-angle pathfinding in practice", JAIR 56, 2016).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hypermap._loops import inner_loop
from hypermap.paths.heap import Heap, push
from hypermap.paths.strips import Strips

SOURCE = -1
_NOBODY = -2
_SAME_FAR = 1e-3  # cells; paths whose lengths differ by less are equal, as with float32
_SAME = 1e-9  # cells
_NARROW = 1e-12  # a cone's width, where it ends


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


class Cones(NamedTuple):
    """Queued cones, each at the row where it continues; slopes are x per row, from the root.

    What lies beyond a border is reached on a shorter way from another root, `low_roots` and
    `high_roots`, or not in sight (_NOBODY).
    """

    rows: NDArray[np.int32]
    runs: NDArray[np.int32]
    lows: NDArray[np.float64]
    highs: NDArray[np.float64]
    low_roots: NDArray[np.int32]
    high_roots: NDArray[np.int32]


class Search(NamedTuple):
    """State of a search: queued corners and cones, and its source and goal, as x, y.

    `goal` is nan where there is none.
    """

    heap: Heap
    cones: Cones
    source: NDArray[np.float64]
    goal: NDArray[np.float64]


class Root(NamedTuple):
    """Where cones begin: the source or a corner, its position and distance from the source."""

    number: int
    x: float
    y: float
    far: float


@inner_loop()
def root_of(strips: Strips, number: int, reached: Reached, state: Search) -> Root:
    """Return the root of a number: that of a corner, or SOURCE."""
    index = int(np.int64(number))  # of one type: else all that takes a root is compiled twice
    if index == SOURCE:
        return Root(index, state.source[0], state.source[1], 0.0)
    return Root(index, float(strips.xs[index]), float(strips.ys[index]), reached.corner_far[index])


@inner_loop()
def look(
    strips: Strips,
    width: int,
    root: Root,
    step: int,
    row: int,
    run: int,
    low: float,
    high: float,
    reached: Reached,
    state: Search,
) -> None:
    """Fill in the cells in a cone.

    Args:
        strips: free space.
        width: of the grid.
        root: where the cone begins.
        step: 1 for a cone upward, -1 downward.
        row: the first row in it.
        run: the run of free cells there.
        low: the cone's left border, as x per row; infinite where it is level.
        high: its right border.
        reached: what is filled in.
        state: of the search.
    """
    if root.y == np.floor(root.y):  # along the row line of the root
        left = float(strips.begins[run]) if low == -np.inf else root.x
        right = float(strips.ends[run]) if high == np.inf else root.x
        _meet(strips, root, int(root.y), left, right, reached, state)
    cones = state.cones
    cones.rows[0], cones.runs[0], cones.lows[0], cones.highs[0] = row, run, low, high
    cones.low_roots[0] = cones.high_roots[0] = _NOBODY
    waiting = 1
    while waiting > 0:
        waiting -= 1
        row, run = int(np.int64(cones.rows[waiting])), cones.runs[waiting]
        low, high = cones.lows[waiting], cones.highs[waiting]
        low_root, high_root = cones.low_roots[waiting], cones.high_roots[waiting]
        begin, end = strips.begins[run], strips.ends[run]
        to_middle = (row + 0.5 - root.y) * step
        if to_middle > 0:
            left = max(float(begin), root.x + low * to_middle)
            right = min(float(end), root.x + high * to_middle)
            first, last = int(np.ceil(left - 0.5 - _SAME)), int(np.floor(right - 0.5 + _SAME))
            own_row = root.number == SOURCE and row == int(root.y)
            ends = not own_row and waiting < len(strips.begins) + 2 * width  # or the queue fills up
            square = to_middle * to_middle
            goes_on = not ends
            for col in range(max(first, begin), min(last, end - 1) + 1):
                cell = row * width + col
                across = col + 0.5 - root.x
                length = root.far + np.sqrt(across * across + square)
                known = reached.far[cell]
                if length < known:
                    reached.far[cell] = length
                    reached.roots[cell] = root.number
                # On the cone's border, the path around the corner is as long.
                if not ends or length < known + _SAME_FAR:
                    goes_on = True
                    continue
                other = reached.roots[cell]
                slope = across / to_middle
                if goes_on or not _covered(
                    strips, root, low_root, other, left, col + 0.5, row, reached, state
                ):
                    waiting = _go_on(
                        strips,
                        root,
                        step,
                        row,
                        run,
                        low,
                        slope,
                        low_root,
                        other,
                        reached,
                        state,
                        waiting,
                    )
                goes_on = False
                low, low_root, left = slope, other, col + 0.5
            if not goes_on and _covered(
                strips, root, low_root, high_root, left, right, row, reached, state
            ):
                continue
        waiting = _go_on(
            strips, root, step, row, run, low, high, low_root, high_root, reached, state, waiting
        )


@inner_loop()
def _covered(
    strips: Strips,
    root: Root,
    one: int,
    other: int,
    left: float,
    right: float,
    row: int,
    reached: Reached,
    state: Search,
) -> bool:
    """Return whether a gap of at most a cell, in the middle of a row, has a shorter path.

    Nothing that blocks the sight of both its ends fits into a gap.

    Args:
        strips: free space.
        root: from where it is looked at.
        one: the root from which its left end is nearer; _NOBODY for none.
        other: likewise for its right end.
        left: x of the gap's left end.
        right: of its right end.
        row: where it is.
        reached: so far.
        state: for the source.
    """
    if one == other:
        return one != _NOBODY
    return _nearer(strips, root, other, left, row, reached, state) or _nearer(
        strips, root, one, right, row, reached, state
    )


@inner_loop()
def _nearer(
    strips: Strips,
    root: Root,
    number: int,
    x: float,
    row: int,
    reached: Reached,
    state: Search,
) -> bool:
    """Return whether another root sees a point in the middle of a row, with a shorter path."""
    if number == _NOBODY:
        return False
    other = root_of(strips, number, reached, state)
    y = row + 0.5
    way = root.far + np.hypot(x - root.x, y - root.y)
    return other.far + np.hypot(x - other.x, y - other.y) <= way and _sees(strips, other, x, row)


@inner_loop()
def _sees(strips: Strips, root: Root, x: float, row: int) -> bool:
    """Return whether a root sees a point in the middle of a row, at x."""
    y = row + 0.5
    step = 1 if y < root.y else -1  # back to the root
    slope = (root.x - x) / abs(root.y - y) if root.y != y else 0.0
    begin, end = -np.inf, np.inf
    while True:
        line = row + 1.0 if step > 0 else float(row)
        left_to_go = (root.y - line) * step
        there = root.x - slope * max(left_to_go, 0.0)
        low, high = min(x, there), max(x, there)
        run = _first_run(strips, row, low + _SAME)
        if run == strips.rows[row + 1]:
            return False
        if strips.begins[run] > low + _SAME or strips.ends[run] < high - _SAME:
            return False
        if strips.begins[run] >= end or strips.ends[run] <= begin:  # two that touch at a corner
            return False
        if left_to_go <= 0:
            return True
        begin, end = float(strips.begins[run]), float(strips.ends[run])
        x = there
        row += step


@inner_loop()
def _go_on(
    strips: Strips,
    root: Root,
    step: int,
    row: int,
    run: int,
    low: float,
    high: float,
    low_root: int,
    high_root: int,
    reached: Reached,
    state: Search,
    waiting: int,
) -> int:
    """Extend a part of a cone past a row; return the number of queued cones."""
    cones = state.cones
    to_line = (row + 0.5 - root.y) * step + 0.5
    begin, end = (strips.begins[run] - root.x) / to_line, (strips.ends[run] - root.x) / to_line
    if begin > low:
        low, low_root = begin, _NOBODY
    if end < high:
        high, high_root = end, _NOBODY
    if high < low - _NARROW:
        return waiting
    left, right = root.x + low * to_line, root.x + high * to_line
    _meet(strips, root, row + 1 if step > 0 else row, left, right, reached, state)
    row += step
    if high - low < _NARROW or row < 0 or row >= len(strips.rows) - 1:
        return waiting
    run = _first_run(strips, row, left)
    while run < strips.rows[row + 1] and strips.begins[run] < right:
        begin, end = (strips.begins[run] - root.x) / to_line, (strips.ends[run] - root.x) / to_line
        cones.rows[waiting], cones.runs[waiting] = row, run
        cones.lows[waiting], cones.highs[waiting] = max(low, begin), min(high, end)
        cones.low_roots[waiting] = _NOBODY if begin > low else low_root
        cones.high_roots[waiting] = _NOBODY if end < high else high_root
        if cones.highs[waiting] - cones.lows[waiting] > _NARROW:
            waiting += 1
        run += 1
    return waiting


@inner_loop()
def _meet(
    strips: Strips,
    root: Root,
    line: int,
    left: float,
    right: float,
    reached: Reached,
    state: Search,
) -> None:
    """Queue the corners on a line that become visible, if a path may turn there."""
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
        ux, uy = strips.xs[corner] - root.x, line - root.y
        side, level = strips.sides[corner], strips.levels[corner]
        turns = (ux * side < 0 and uy * level >= 0) or (uy * level < 0 and ux * side >= 0)
        if turns:
            length = root.far + np.sqrt(ux * ux + uy * uy)
            known = reached.corner_far[corner]
            if length < known - _SAME:
                reached.corner_far[corner] = length
                reached.corner_roots[corner] = root.number
                key = length
                if state.goal[0] == state.goal[0]:
                    gx, gy = state.goal[0] - strips.xs[corner], state.goal[1] - line
                    key += np.sqrt(gx * gx + gy * gy)
                push(state.heap, corner, key)
            elif length <= known + _SAME and state.heap.places[corner] >= 0:
                reached.corner_roots[corner] = (
                    root.number
                )  # a corner on the line, which the path touches
        corner += 1


@inner_loop()
def run_at(strips: Strips, row: int, x: float, side: int) -> int:
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
