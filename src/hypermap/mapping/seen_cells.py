"""What one frame or scan shows of the cells of the floor."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hypermap._loops import loop
from hypermap.core.arrays import BoolArray
from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry, along


@dataclass(frozen=True, eq=False)
class SeenCells:
    """The cells that a frame shows occupied or free.

    Attributes:
        first: row and column of the lower left cell, counted from the origin of the map frame,
            int64, shape (2,).
        is_hit: whether there is an obstacle in the cell, bool, shape (H, W).
        is_free: whether a ray passed low over it, bool, shape (H, W).
    """

    first: NDArray[np.int64]
    is_hit: BoolArray
    is_free: BoolArray

    def moved(self, motion: Pose2D, resolution: float) -> SeenCells:
        """Return the cells after a motion over the floor.

        Each new cell has the content of the old cell that contained its center (nearest neighbor).

        Args:
            motion: the transform of points from their old to their new places.
            resolution: side of a cell [m].
        """
        c, s = math.cos(motion.yaw), math.sin(motion.yaw)
        x, y = motion.x / resolution, motion.y / resolution  # all in cells from here on
        bottom, left = self.first.tolist()
        height, width = self.is_hit.shape
        corners = [(col, row) for col in (left, left + width) for row in (bottom, bottom + height)]
        cols = [math.floor(c * col - s * row + x) for col, row in corners]
        rows = [math.floor(s * col + c * row + y) for col, row in corners]
        new_left, new_bottom = min(cols), min(rows)
        shape = max(rows) - new_bottom + 1, max(cols) - new_left + 1
        is_hit, is_free = np.zeros((2, *shape), dtype=bool)
        from_x, from_y = new_left - x, new_bottom - y
        begin = c * from_x + s * from_y - left, c * from_y - s * from_x - bottom
        _move(self.is_hit, self.is_free, (c, s), begin, is_hit, is_free)
        return SeenCells(np.array([new_bottom, new_left]), is_hit, is_free)


def cells_from(first: NDArray[np.int64], shape: tuple[int, ...], resolution: float) -> GridGeometry:
    """Return the geometry of some cells of the floor.

    Args:
        first: row and column of the lower left one, counted from the frame's origin, shape (2,).
        shape: numbers of rows and columns.
        resolution: side of a cell [m].
    """
    return GridGeometry(
        width=int(shape[1]),
        height=int(shape[0]),
        resolution=resolution,
        origin=Pose2D(x=along(int(first[1]), resolution), y=along(int(first[0]), resolution)),
    )


@loop()
def _move(
    is_hit: BoolArray,
    is_free: BoolArray,
    turn: tuple[float, float],
    begin: tuple[float, float],
    hit_after: BoolArray,
    free_after: BoolArray,
) -> None:
    """Resample cells by nearest neighbor.

    Args:
        is_hit: of the old cells.
        is_free: likewise.
        turn: cosine and sine of the rotation from the old cells to the new ones.
        begin: where the lower left corner of the new cells is among the old ones, (col, row), where
            a cell extends from its index to the next.
        hit_after: all False; filled.
        free_after: likewise.
    """
    height, width = is_hit.shape
    for row in range(hit_after.shape[0]):
        for col in range(hit_after.shape[1]):
            x, y = col + 0.5, row + 0.5
            old_col = turn[0] * x + turn[1] * y + begin[0]
            old_row = turn[0] * y - turn[1] * x + begin[1]
            if 0 <= old_row < height and 0 <= old_col < width:
                # Numbers without a sign, as numba counts negative ones from the end.
                one, other = np.uint64(old_row), np.uint64(old_col)
                hit_after[row, col] = is_hit[one, other]
                free_after[row, col] = is_free[one, other]
