"""Grid geometry: the only place that converts meters to cells and back."""

from __future__ import annotations

import math
import operator
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import BoolArray, IntArray, PointsLike, as_points_xy, true_in
from hypermap.core.frames import Pose2D
from hypermap.core.shapes import as_area
from hypermap.core.spans import covered, filled, outlines

_DECIMALS = 6  # of a cell
_FAR = 1e12  # meters; no grid reaches beyond
RESOLUTIONS = (1e-6, 1e6)
"""The smallest and the largest side of a cell [m]."""

AT_ONCE = 1 << 19
"""Cells processed together, so that they stay in the CPU cache."""


@dataclass(frozen=True)
class GridGeometry:
    """The geometry of a grid in a layer's frame.

    Cell (row 0, col 0) is the lower left one; columns grow along the x axis of the origin, rows
    along its y axis. A cell's location is its center.

    Attributes:
        width: number of columns.
        height: number of rows.
        resolution: side of a cell [m].
        origin: pose of the lower left corner of cell (0, 0) in the layer's frame.

    Raises:
        ValueError: If a side has no cells, the resolution is not within `RESOLUTIONS`, or a cell
            may be more than 1e12 m from the origin of the layer's frame.
        TypeError: If a side is not an integer.

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
        sides = operator.index(self.width) + operator.index(self.height)  # or a TypeError
        if self.width < 1 or self.height < 1:
            raise ValueError(f"a grid needs at least one cell, got {self.width} x {self.height}")
        check_resolution(self.resolution)
        reach = sides * self.resolution + max(abs(self.origin.x), abs(self.origin.y))
        if not reach <= _FAR:
            raise ValueError(f"a grid must be within {_FAR:g} m, this one reaches {reach:g} m")

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns, the shape of the array that holds the cells."""
        return self.height, self.width

    def cells_at(self, points_xy: PointsLike) -> IntArray:
        """Return (row, col) of each point, int64, shape (N, 2); they may be off the grid."""
        return np.floor(self.positions_at(points_xy)).astype(np.int64)

    def positions_at(self, points_xy: PointsLike) -> NDArray[np.float64]:
        """Return (row, col) before `cells_at` rounds down, shape (N, 2); centers are at 0.5."""
        near = np.clip(as_points_xy(points_xy), -_FAR, _FAR)
        return self.origin.inverse().apply(near)[:, ::-1] / self.resolution

    def to_cells_matrix(self) -> NDArray[np.float64]:
        """Return the matrix of `positions_at` for compiled loops, but with (col, row).

        Returns:
            Shape (3, 3); takes (x, y, 1) in the layer's frame [m] to (col, row, 1), where cell
            (row, col) extends from its index to the next.

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
        """Return the centers of cells in the layer's frame, meters, shape (N, 2)."""
        centers = np.column_stack([np.add(cols, 0.5), np.add(rows, 0.5)])
        centers *= self.resolution
        return centers if self.origin.is_identity else self.origin.apply(centers)

    def corners(self) -> NDArray[np.float64]:
        """Return the grid's corners, counter-clockwise from the origin, meters, shape (4, 2)."""
        w, h = self.width * self.resolution, self.height * self.resolution
        return self.origin.apply([[0.0, 0.0], [w, 0.0], [w, h], [0.0, h]])

    def outline(self) -> shapely.Polygon:
        """Return the area that the grid covers, in the layer's frame."""
        return shapely.Polygon(self.corners())

    def cells_in(self, area: BaseGeometry) -> tuple[IntArray, IntArray]:
        """Return rows and columns of the cells whose center the area covers, shape (M,) each.

        They are in row-major order. A center on the area's boundary counts. Lengths below a
        millionth of a cell are ignored.

        Args:
            area: any geometry in the layer's frame; a line or point covers the centers on it.

        Raises:
            TypeError, ValueError: If it is not a geometry, or not finite.
        """
        return self.window_in(area).cells()

    def window_in(self, area: BaseGeometry) -> Window:
        """Return the cells of `cells_in` as a mask over the window around them."""
        # In units of cells, shifted so that the center of cell (row, col) is the point (col, row).
        # Rounding puts corners that are meant to be on a center exactly there.
        to_cells = self.origin.inverse()
        local = []
        for part in outlines(as_area(area)):
            places = np.round(to_cells.apply(part.points) / self.resolution - 0.5, _DECIMALS)
            local.append(replace(part, points=places))
        if not local:
            return Window(0, 0, (0, 0), np.empty(0, dtype=np.int32))
        points = np.concatenate([part.points for part in local])
        (x0, y0), (x1, y1) = points.min(axis=0).tolist(), points.max(axis=0).tolist()
        col = min(max(0, math.ceil(x0)), self.width)
        row = min(max(0, math.ceil(y0)), self.height)
        col_end = min(max(col, math.floor(x1) + 1), self.width)
        row_end = min(max(row, math.floor(y1) + 1), self.height)
        shape = (row_end - row, col_end - col)
        return Window(row, col, shape, covered(local, shape, row, col))

    def windows_in(self, area: BaseGeometry | None) -> Iterator[Window]:
        """Yield the result of `window_in` in parts of about `AT_ONCE` cells each, row by row.

        Args:
            area: as in `window_in`; None for the whole grid.
        """
        if area is not None:
            yield from self.window_in(area).parts()
            return
        for first, last in _bands(*self.shape):
            shape = (last - first, self.width)
            yield Window(first, 0, shape, np.array([0, math.prod(shape)]))


def along(cells: float, resolution: float) -> float:
    """Return the length of a number of cells [m], as the shortest decimal number.

    >>> along(-3, 0.05), -3 * 0.05
    (-0.15, -0.15000000000000002)
    """
    return float(f"{cells * resolution:.14g}")


def check_resolution(resolution: float) -> None:
    """Raise a ValueError if a length [m] cannot be the side of a cell."""
    smallest, largest = RESOLUTIONS
    if not smallest <= resolution <= largest:
        raise ValueError(f"resolution must be from {smallest:g} to {largest:g} m, got {resolution}")


def _bands(height: int, width: int) -> Iterator[tuple[int, int]]:
    """Yield the first row, and the one after the last, of bands of about `AT_ONCE` cells."""
    step = max(1, AT_ONCE // max(1, width))
    return ((first, min(first + step, height)) for first in range(0, height, step))


@dataclass(frozen=True, eq=False)
class Window:
    """A part of a grid, and which of its cells are in an area.

    Attributes:
        row: first row.
        col: first column.
        shape: rows and columns of the part.
        spans: begin and end of each run of cells in the area, alternating and never
            descending, as positions in the flattened part; each run is within one row.
    """

    row: int
    col: int
    shape: tuple[int, int]
    spans: IntArray

    @property
    def slices(self) -> tuple[slice, slice]:
        """The slices that select the part of an array of the whole grid."""
        rows, cols = self.shape
        return slice(self.row, self.row + rows), slice(self.col, self.col + cols)

    @property
    def inside(self) -> BoolArray:
        """Whether each cell of the part is in the area, shape `shape`; created on each access."""
        return filled(self.spans, math.prod(self.shape)).reshape(self.shape)

    def positions(self, chosen: BoolArray | None = None) -> IntArray:
        """Return the cells in the area, as positions in the flattened part, shape (N,).

        Args:
            chosen: which cells of the part to return, of shape `shape`; None for all.
        """
        counts = self.spans[1::2] - self.spans[::2]
        if chosen is None:
            positions = np.repeat(self.spans[::2] - (np.cumsum(counts) - counts), counts)
            return positions + np.arange(len(positions))
        if 2 * counts.sum() < chosen.size:
            return true_in((self.inside & chosen).ravel())
        # Usually few of the cells are chosen, so we filter these.
        found = true_in(chosen.ravel())
        ends = np.searchsorted(found, self.spans)
        return found[slice(*ends)] if len(ends) == 2 else found[filled(ends, len(found))]

    def cells(self, positions: IntArray | None = None) -> tuple[IntArray, IntArray]:
        """Return rows and columns of cells in the grid.

        Args:
            positions: as `positions` returns them; None for all cells in the area.
        """
        chosen = self.positions() if positions is None else positions
        rows = chosen // max(1, self.shape[1])
        return rows + self.row, chosen - rows * self.shape[1] + self.col

    def parts(self) -> Iterator[Window]:
        """Yield the cells in the area as windows of about `AT_ONCE` cells each, row by row."""
        begins, ends = self.spans[::2], self.spans[1::2]
        height, width = self.shape
        if height * width <= AT_ONCE:
            yield self
            return
        some = begins < ends
        rows = begins[some] // max(1, width)
        begins, ends = begins[some] - rows * width, ends[some] - rows * width
        for first, last in _bands(height, width):
            here = slice(*np.searchsorted(rows, [first, last]).tolist())
            if here.start == here.stop:
                continue
            left, right = begins[here].min().item(), ends[here].max().item()
            offsets = (rows[here] - first) * (right - left) - left
            spans = np.column_stack([begins[here] + offsets, ends[here] + offsets]).ravel()
            yield Window(self.row + first, self.col + left, (last - first, right - left), spans)
