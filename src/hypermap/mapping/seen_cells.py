"""What one frame or scan shows of the cells of the floor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray
from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry, along


@dataclass(frozen=True, eq=False)
class SeenCells:
    """The cells that a frame shows blocked or free.

    Attributes:
        first: row and column of the lower left cell, counted from the frame's origin, shape (2,).
        is_hit: whether something blocks the cell, bool, shape (H, W).
        is_free: whether a ray passed low over it, bool, shape (H, W).
    """

    first: NDArray[np.int64]
    is_hit: BoolArray
    is_free: BoolArray

    def moved(self, motion: Pose2D, resolution: float) -> SeenCells:
        """Return the cells after a motion over the floor.

        Each cell there shows what the cell shows in which its center lay before.

        Args:
            motion: takes points from where they were to where they are.
            resolution: side of a cell [m].
        """
        grid = cells_from(self.first, self.is_hit.shape, resolution)
        world = GridGeometry(width=1, height=1, resolution=resolution)
        reached = world.cells_at(motion.apply(grid.corners()))
        first = reached.min(axis=0)
        there = cells_from(first, tuple(reached.max(axis=0) - first + 1), resolution)
        rows, cols = np.indices(there.shape).reshape(2, -1)
        before = grid.cells_at(motion.inverse().apply(there.centers(rows, cols)))
        is_known = grid.contains(*before.T)
        before[~is_known] = 0
        is_hit, is_free = (
            (cells[before[:, 0], before[:, 1]] & is_known).reshape(there.shape)
            for cells in (self.is_hit, self.is_free)
        )
        return SeenCells(first, is_hit, is_free)


def cells_from(first: NDArray[np.int64], shape: tuple[int, ...], resolution: float) -> GridGeometry:
    """Return the geometry of some cells of the floor.

    Args:
        first: row and column of the lower left one, counted from the frame's origin.
        shape: rows and columns.
        resolution: side of a cell [m].
    """
    return GridGeometry(
        width=int(shape[1]),
        height=int(shape[0]),
        resolution=resolution,
        origin=Pose2D(x=along(int(first[1]), resolution), y=along(int(first[0]), resolution)),
    )
