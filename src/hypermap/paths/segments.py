"""The cost of a straight line across the cells of a grid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hypermap._loops import inner_loop, loop

_POINT = 1e-9  # of a line; a shorter part only touches a cell


@inner_loop()
def _cost_at(cost: NDArray[np.float32], row: int, col: int, height: int, width: int) -> float:
    if row < 0 or col < 0 or row >= height or col >= width:
        return np.inf
    return float(cost[row, col])


@loop()
def line_cost(cost: NDArray[np.float32], x0: float, y0: float, x1: float, y1: float) -> float:
    """Return the sum of cost times length, in cells, along a line from one point to another.

    A line on the border of two cells takes the cheaper one; between two blocked cells that touch at
    a corner it does not pass.

    Args:
        cost: of each cell, infinite where blocked, shape (height, width).
        x0: x of the first point, in cells.
        y0: its y.
        x1: x of the other point.
        y1: its y.
    """
    height, width = cost.shape
    dx, dy = x1 - x0, y1 - y0
    length = np.sqrt(dx * dx + dy * dy)
    if length == 0:
        return 0.0
    next_x = np.floor(x0) + 1 if dx > 0 else np.ceil(x0) - 1
    next_y = np.floor(y0) + 1 if dy > 0 else np.ceil(y0) - 1
    at, total = 0.0, 0.0
    one_open = other_open = True  # on either side of a line along a border of cells, up to here
    while at < 1:
        to_x = (next_x - x0) / dx if dx != 0 else np.inf
        to_y = (next_y - y0) / dy if dy != 0 else np.inf
        to = min(to_x, to_y, 1.0)
        if to - at > _POINT:
            middle = 0.5 * (at + to)
            x, y = x0 + middle * dx, y0 + middle * dy
            here = _cost_at(cost, int(np.floor(y)), int(np.floor(x)), height, width)
            if (dx == 0 and x == np.floor(x)) or (dy == 0 and y == np.floor(y)):
                back_row, back_col = (0, 1) if dx == 0 else (1, 0)
                row, col = int(np.floor(y)) - back_row, int(np.floor(x)) - back_col
                other = _cost_at(cost, row, col, height, width)
                one_open_here, other_open_here = here < np.inf, other < np.inf
                if not ((one_open and one_open_here) or (other_open and other_open_here)):
                    return np.inf
                one_open, other_open = one_open_here, other_open_here
                here = min(here, other)
            if here == np.inf:
                return np.inf
            total += (to - at) * here
        if abs(to_x - to_y) < _POINT and to < 1:  # through a corner
            row = int(next_y) - 1 if dy > 0 else int(next_y)
            col = int(next_x) - 1 if dx > 0 else int(next_x)
            step_row, step_col = (1 if dy > 0 else -1), (1 if dx > 0 else -1)
            one = _cost_at(cost, row + step_row, col, height, width)
            other = _cost_at(cost, row, col + step_col, height, width)
            if one == np.inf and other == np.inf:
                return np.inf
        if to_x <= to + _POINT:
            next_x += 1 if dx > 0 else -1
        if to_y <= to + _POINT:
            next_y += 1 if dy > 0 else -1
        at = to
    return float(total * length)
