"""Grid geometry: the one place that turns metres into cells and back."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import BoolArray, IntArray
from hypermap.core.frames import Pose2D

_TILE = 64  # cells; tiles wholly inside or outside an area are decided at once


@dataclass(frozen=True)
class GridGeometry:
    """Where the cells of a grid lie in a layer's frame.

    Cell (row 0, col 0) is the lower left one; columns grow along the x axis of the origin, rows
    along its y axis. A cell's location is its centre.

    Attributes:
        width: number of columns.
        height: number of rows.
        resolution: side of a cell [m].
        origin: pose of the lower left corner of cell (0, 0) in the layer's frame.

    Raises:
        ValueError: If a side has no cells or the resolution is not a positive number.

    >>> grid = GridGeometry(width=4, height=3, resolution=0.5, origin=Pose2D(x=1.0))
    >>> grid.cells_at([[1.1, 0.9]])
    array([[1, 0]])
    >>> grid.centers([1], [0])
    array([[1.25, 0.75]])
    """

    width: int
    height: int
    resolution: float
    origin: Pose2D = field(default_factory=Pose2D)

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1:
            raise ValueError(f"a grid needs at least one cell, got {self.width} x {self.height}")
        if not (math.isfinite(self.resolution) and self.resolution > 0):
            raise ValueError(f"resolution must be a positive number, got {self.resolution}")

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns, the shape of the array that holds the cells."""
        return self.height, self.width

    def cells_at(self, points_xy: ArrayLike) -> IntArray:
        """Return (row, col) of each point, int64, shape (N, 2); they may lie off the grid."""
        local = self.origin.inverse().apply(points_xy) / self.resolution
        limit = float(2**62)
        return np.clip(np.floor(local[:, ::-1]), -limit, limit).astype(np.int64)

    def to_cells_matrix(self) -> NDArray[np.float64]:
        """Return what `cells_at` does before it rounds down, as a matrix, for compiled loops.

        Returns:
            Shape (3, 3); takes (x, y, 1) in the layer's frame [m] to (col, row, 1), where cell
            (row, col) reaches from its index to the next.

        >>> grid = GridGeometry(width=4, height=3, resolution=0.5, origin=Pose2D(x=1.0))
        >>> grid.to_cells_matrix() @ [1.25, 0.5, 1.0]
        array([0.5, 1. , 1. ])
        """
        return (
            np.diag([1 / self.resolution, 1 / self.resolution, 1]) @ self.origin.inverse().matrix()
        )

    def contains(self, rows: ArrayLike, cols: ArrayLike) -> BoolArray:
        """Return whether each cell is on the grid, shape (N,)."""
        r, c = np.asarray(rows), np.asarray(cols)
        return np.asarray((r >= 0) & (r < self.height) & (c >= 0) & (c < self.width))

    def centers(self, rows: ArrayLike, cols: ArrayLike) -> NDArray[np.float64]:
        """Return the centres of cells in the layer's frame, metres, shape (N, 2)."""
        cells_xy = np.column_stack([np.asarray(cols), np.asarray(rows)])
        return self.origin.apply((cells_xy + 0.5) * self.resolution)

    def corners(self) -> NDArray[np.float64]:
        """Return the grid's corners, counter-clockwise from the origin, metres, shape (4, 2)."""
        w, h = self.width * self.resolution, self.height * self.resolution
        return self.origin.apply([[0.0, 0.0], [w, 0.0], [w, h], [0.0, h]])

    def outline(self) -> shapely.Polygon:
        """Return the area that the grid covers, in the layer's frame."""
        return shapely.Polygon(self.corners())

    def cells_in(self, area: BaseGeometry) -> tuple[IntArray, IntArray]:
        """Return rows and columns of the cells whose centre the area covers, in row-major order.

        A centre on the area's boundary counts.

        Args:
            area: polygon or multipolygon in the layer's frame.
        """
        if area.is_empty:
            return np.empty(0, np.int64), np.empty(0, np.int64)
        # In units of cells, shifted so that the centre of cell (0, 0) is the point (0, 0).
        to_cells = self.origin.inverse()
        local = shapely.transform(area, lambda xy: to_cells.apply(xy) / self.resolution - 0.5)
        shapely.prepare(local)
        min_col, min_row, max_col, max_row = local.bounds
        row0, row1 = (
            max(math.ceil(min_row - 1e-6), 0),
            min(math.floor(max_row + 1e-6), self.height - 1),
        )
        col0, col1 = (
            max(math.ceil(min_col - 1e-6), 0),
            min(math.floor(max_col + 1e-6), self.width - 1),
        )
        if row0 > row1 or col0 > col1:
            return np.empty(0, np.int64), np.empty(0, np.int64)
        inside = np.zeros((row1 - row0 + 1, col1 - col0 + 1), dtype=bool)
        for top in range(0, inside.shape[0], _TILE):
            for left in range(0, inside.shape[1], _TILE):
                tile = inside[top : top + _TILE, left : left + _TILE]
                _fill_tile(tile, local, row0 + top, col0 + left)
        rows, cols = np.nonzero(inside)
        return rows + row0, cols + col0


def _fill_tile(tile: BoolArray, area: BaseGeometry, row: int, col: int) -> None:
    """Set the cells of a tile whose integer coordinates lie in the (prepared) area."""
    height, width = tile.shape
    box = shapely.box(col, row, col + width - 1, row + height - 1)
    if height > 1 and width > 1:
        if not area.intersects(box):
            return
        if area.covers(box):
            tile[:] = True
            return
    cols, rows = np.meshgrid(np.arange(col, col + width), np.arange(row, row + height))
    tile[:] = shapely.intersects_xy(area, cols.astype(float), rows.astype(float))
