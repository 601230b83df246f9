"""What one frame or scan shows of the cells of the floor."""

from __future__ import annotations

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
        grid = cells_from(self.first, self.is_hit.shape, resolution)
        world = GridGeometry(width=1, height=1, resolution=resolution)
        reached = world.cells_at(motion.apply(grid.corners()))
        first = reached.min(axis=0)
        there = cells_from(first, tuple(reached.max(axis=0) - first + 1), resolution)
        is_hit, is_free = np.zeros((2, *there.shape), dtype=bool)
        to_there = there.to_cells_matrix() @ motion.matrix()
        before_T_after = grid.to_cells_matrix() @ np.linalg.inv(to_there)
        _move(self.is_hit, self.is_free, before_T_after, is_hit, is_free)
        return SeenCells(first, is_hit, is_free)


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
    before_T_after: NDArray[np.float64],
    hit_after: BoolArray,
    free_after: BoolArray,
) -> None:
    """Resample cells by nearest neighbor.

    Args:
        is_hit: of the old cells.
        is_free: likewise.
        before_T_after: maps new (col, row, 1) to old ones, where a cell extends from its index to
            the next, shape (3, 3).
        hit_after: all False; filled.
        free_after: likewise.
    """
    height, width = is_hit.shape
    m = before_T_after
    for row in range(hit_after.shape[0]):
        for col in range(hit_after.shape[1]):
            x, y = col + 0.5, row + 0.5
            old_col = int(np.floor(m[0, 0] * x + m[0, 1] * y + m[0, 2]))
            old_row = int(np.floor(m[1, 0] * x + m[1, 1] * y + m[1, 2]))
            if 0 <= old_row < height and 0 <= old_col < width:
                hit_after[row, col] = is_hit[old_row, old_col]
                free_after[row, col] = is_free[old_row, old_col]
