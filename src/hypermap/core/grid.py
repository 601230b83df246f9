"""Grid geometry: the one place that turns metres into cells and back."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import BoolArray, IntArray, as_points_xy, places
from hypermap.core.frames import Pose2D
from hypermap.core.shapes import as_area
from hypermap.core.spans import covered, filled

_DECIMALS = 6  # of a cell
_FAR = 1e12  # metres; no grid reaches there
RESOLUTIONS = (1e-6, 1e6)
"""The smallest and the largest side of a cell [m]."""

AT_ONCE = 1 << 19
"""Cells that are looked at together, so that they stay in the processor's cache."""


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
        ValueError: If a side has no cells, or the resolution is no sensible number.
        TypeError: If a side is no integer.

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
        operator.index(self.width), operator.index(self.height)  # a TypeError for others
        if self.width < 1 or self.height < 1:
            raise ValueError(f"a grid needs at least one cell, got {self.width} x {self.height}")
        smallest, largest = RESOLUTIONS
        if not smallest <= self.resolution <= largest:
            raise ValueError(
                f"resolution must be from {smallest:g} to {largest:g} m, got {self.resolution}"
            )

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns, the shape of the array that holds the cells."""
        return self.height, self.width

    def cells_at(self, points_xy: ArrayLike) -> IntArray:
        """Return (row, col) of each point, int64, shape (N, 2); they may lie off the grid."""
        return np.floor(self.positions_at(points_xy)).astype(np.int64)

    def positions_at(self, points_xy: ArrayLike) -> NDArray[np.float64]:
        """Return what `cells_at` rounds down, shape (N, 2); a cell's centre is at (0.5, 0.5)."""
        near = np.clip(as_points_xy(points_xy), -_FAR, _FAR)
        return self.origin.inverse().apply(near)[:, ::-1] / self.resolution

    def to_cells_matrix(self) -> NDArray[np.float64]:
        """Return what `positions_at` does, but as (col, row), as a matrix for compiled loops.

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
        centers = np.column_stack([np.asarray(cols), np.asarray(rows)]) + 0.5
        centers *= self.resolution
        return self.origin.apply(centers)

    def corners(self) -> NDArray[np.float64]:
        """Return the grid's corners, counter-clockwise from the origin, metres, shape (4, 2)."""
        w, h = self.width * self.resolution, self.height * self.resolution
        return self.origin.apply([[0.0, 0.0], [w, 0.0], [w, h], [0.0, h]])

    def outline(self) -> shapely.Polygon:
        """Return the area that the grid covers, in the layer's frame."""
        return shapely.Polygon(self.corners())

    def cells_in(self, area: BaseGeometry) -> tuple[IntArray, IntArray]:
        """Return rows and columns of the cells whose centre the area covers, in row-major order.

        A centre on the area's boundary counts; lengths below a millionth of a cell do not.

        Args:
            area: polygon or multipolygon in the layer's frame.

        Raises:
            TypeError, ValueError: If it is no geometry, or not finite.
        """
        return self.window_in(area).cells()

    def window_in(self, area: BaseGeometry) -> Window:
        """Return the cells that `cells_in` returns, as a mask over the part around them."""
        row, col, (height, width), spans = self._covered(area)
        inside = filled(spans, 0, height * width)
        return Window(row, col, inside.reshape(height, width))

    def windows_in(self, area: BaseGeometry | None) -> Iterator[Window]:
        """Yield what `window_in` returns in parts of whole rows, some `AT_ONCE` cells each.

        Args:
            area: as there; None for all of the grid.
        """
        if area is None:
            yield from self._windows()
            return
        row, col, (height, width), spans = self._covered(area)
        for first, last in _bands(height, width):
            inside = filled(spans, first * width, last * width)
            yield Window(row + first, col, inside.reshape(last - first, width))

    def _windows(self) -> Iterator[Window]:
        """Yield all of the grid in parts of whole rows."""
        bands = list(_bands(*self.shape))
        everywhere = np.ones((bands[0][1], self.width), dtype=bool)
        for first, last in bands:
            yield Window(first, 0, everywhere[: last - first])

    def _covered(self, area: BaseGeometry) -> tuple[int, int, tuple[int, int], IntArray]:
        """Return row, column and shape of the part around an area, and the spans covered there."""
        # In units of cells, shifted so that the centre of cell (row, col) is the point (col, row).
        # Rounding puts corners that are meant to lie on a centre exactly there.
        to_cells = self.origin.inverse()
        local = shapely.transform(
            as_area(area),
            lambda xy: np.round(to_cells.apply(xy) / self.resolution - 0.5, _DECIMALS),
        )
        if local.is_empty:
            return 0, 0, (0, 0), np.empty(0, dtype=np.int64)
        x0, y0, x1, y1 = local.bounds
        col = min(max(0, math.ceil(x0)), self.width)
        row = min(max(0, math.ceil(y0)), self.height)
        col_end = min(max(col, math.floor(x1) + 1), self.width)
        row_end = min(max(row, math.floor(y1) + 1), self.height)
        shape = (row_end - row, col_end - col)
        return row, col, shape, covered(local, shape, row, col)


def _bands(height: int, width: int) -> Iterator[tuple[int, int]]:
    """Yield the first row, and the one after the last, of bands of some `AT_ONCE` cells."""
    step = max(1, AT_ONCE // max(1, width))
    return ((first, min(first + step, height)) for first in range(0, height, step))


@dataclass(frozen=True, eq=False)
class Window:
    """A part of a grid, and which of its cells lie in an area.

    Attributes:
        row: first row.
        col: first column.
        inside: shape (rows, columns) of the part.
    """

    row: int
    col: int
    inside: BoolArray

    @property
    def slices(self) -> tuple[slice, slice]:
        """What cuts the part out of an array of the whole grid."""
        rows, cols = self.inside.shape
        return slice(self.row, self.row + rows), slice(self.col, self.col + cols)

    def cells(self, chosen: BoolArray | None = None) -> tuple[IntArray, IntArray]:
        """Return rows and columns, in the grid, of the cells that lie in the area.

        Args:
            chosen: which cells of the part are wanted, of its shape; None for all.
        """
        rows, cols = places(self.inside if chosen is None else self.inside & chosen)
        return rows + self.row, cols + self.col
