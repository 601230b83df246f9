"""Which cells of a grid are visible from one cell, by ray casting in all directions."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hypermap._loops import inner_loop, loop
from hypermap.core.arrays import BoolArray, IntArray
from hypermap.core.errors import HypermapError
from hypermap.core.grid import GridGeometry

CLEAR, UNKNOWN, WALL = 0, 1, 2
"""State of a cell, as rays treat it."""

MOST_CELLS = 2000
"""Maximum length of a ray [cells]."""


class Seen(NamedTuple):
    """What is visible from a cell, in a square window of the grid around it.

    Attributes:
        row: first row of the window; may be negative.
        col: first column, likewise.
        clear: which cells of the window are clear and visible, shape (2 r + 1, 2 r + 1).
        unknown: how many unknown cells each ray is the first to reach, counter-clockwise from the
            grid's x axis, shape (R,). Everything off the grid is unknown.
    """

    row: int
    col: int
    clear: BoolArray
    unknown: NDArray[np.int64]

    def clear_on(self, shape: tuple[int, ...]) -> tuple[IntArray, IntArray]:
        """Return rows and columns of the visible clear cells, on a grid of that shape."""
        rows, cols = np.nonzero(self.clear)
        rows, cols = rows + self.row, cols + self.col
        there = (rows >= 0) & (cols >= 0) & (rows < shape[0]) & (cols < shape[1])
        return rows[there], cols[there]


class Visibility:
    """Lines of sight over a grid, which only walls block.

    Source: the traversal of cells is that of Amanatides and Woo, "A fast voxel traversal algorithm
    for ray tracing", Eurographics 1987.

    Args:
        grid: its geometry.
        cells: CLEAR, UNKNOWN or WALL, uint8, shape (height, width).
        max_range: maximum range [m].
        min_range: minimum range at which unknown cells count [m].

    Raises:
        HypermapError: If `max_range` is more than `MOST_CELLS` cells.
    """

    def __init__(
        self, grid: GridGeometry, cells: NDArray[np.uint8], max_range: float, min_range: float = 0.0
    ) -> None:
        if not max_range <= MOST_CELLS * grid.resolution:
            raise HypermapError(
                f"a sensor's range must be at most {MOST_CELLS} cells of the map, which are "
                f"{MOST_CELLS * grid.resolution:g} m; got {max_range:g} m"
            )
        self._cells = cells
        self._far = max_range / grid.resolution
        self._near = min_range / grid.resolution
        self._reach = math.ceil(self._far) + 1
        # As many rays as there are cells on the outermost circle, so that none is missed.
        self.directions = np.linspace(
            0, math.tau, max(8, math.ceil(math.tau * self._far)), endpoint=False
        )

    def of(self, row: int, col: int, through_unknown: bool = True) -> Seen:
        """Return what is visible from the center of a cell.

        Args:
            row: of the cell.
            col: of the cell.
            through_unknown: whether rays pass through unknown cells, which may be clear.
        """
        side = 2 * self._reach + 1
        marks = np.zeros((side, side), dtype=np.uint8)
        counts = np.zeros(len(self.directions), dtype=np.int64)
        _look(
            self._cells,
            row,
            col,
            self._far,
            self._near,
            through_unknown,
            self.directions,
            marks,
            counts,
        )
        return Seen(row - self._reach, col - self._reach, marks == _SEEN_CLEAR, counts)


_SEEN_CLEAR, _SEEN_UNKNOWN = 1, 2


@inner_loop()
def _state(cells: NDArray[np.uint8], row: int, col: int) -> int:
    if row < 0 or col < 0 or row >= cells.shape[0] or col >= cells.shape[1]:
        return UNKNOWN
    return int(cells[row, col])


@loop()
def _look(
    cells: NDArray[np.uint8],
    row: int,
    col: int,
    far: float,
    near: float,
    through_unknown: bool,
    directions: NDArray[np.float64],
    marks: NDArray[np.uint8],
    counts: NDArray[np.int64],
) -> None:
    """Mark the cells that are visible from (row, col), and count the unknown ones by ray."""
    reach = marks.shape[0] // 2
    marks[reach, reach] = _SEEN_CLEAR
    for i in range(len(directions)):
        dx, dy = np.cos(directions[i]), np.sin(directions[i])
        step_x, step_y = (1 if dx > 0 else -1), (1 if dy > 0 else -1)
        per_x = 1 / abs(dx) if dx != 0 else np.inf
        per_y = 1 / abs(dy) if dy != 0 else np.inf
        to_x, to_y = 0.5 * per_x, 0.5 * per_y  # distance to the next cell borders
        x, y, at = 0, 0, 0.0
        while True:
            if to_x < to_y:
                at = to_x
                to_x += per_x
                x += step_x
            else:
                at = to_y
                to_y += per_y
                y += step_y
            if at > far:
                break
            state = _state(cells, row + y, col + x)
            if state == WALL or (state == UNKNOWN and not through_unknown):
                break
            if marks[reach + y, reach + x] == 0:
                if state == CLEAR:
                    marks[reach + y, reach + x] = _SEEN_CLEAR
                else:
                    marks[reach + y, reach + x] = _SEEN_UNKNOWN
                    if at >= near:
                        counts[i] += 1
