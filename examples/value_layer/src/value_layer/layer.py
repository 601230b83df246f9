"""The value layer: measured numbers on a grid, interpolated in between."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import ObjectArray, PointsLike, as_objects, as_points_xy
from hypermap.core.grid import GridGeometry
from hypermap.core.layer import Hits, Layer, RasterPicture
from value_layer.colors import colored, legend

UNKNOWN = "Unknown"


class ValueLayer(Layer):
    """A number with a unit in each cell of a grid; NaN where nothing is known.

    At points, numbers are interpolated; areas and searches speak of the cells themselves. A
    label is the rounded number with its unit, as "21.5 °C", or "Unknown".

    Attributes:
        grid: where the cells lie; None while the layer is empty.
        cells: float32, shape (height, width), read-only; None while the layer is empty.
        unit: as labels show it.
        decimals: how many of them labels show.

    Raises:
        ValueError: If only one of `grid` and `cells` is given, their shapes differ, or a number is
            infinite.

    >>> grid = GridGeometry(width=2, height=1, resolution=1.0)
    >>> layer = ValueLayer("warmth", "map", grid, np.array([[20.0, 22.0]]), unit="°C")
    >>> layer.label_at([[0.5, 0.5], [1.0, 0.5], [9.0, 9.0]])
    array(['20.0 °C', '21.0 °C', 'Unknown'], dtype=object)
    """

    class_name: ClassVar[str] = "ValueLayer"

    def __init__(
        self,
        name: str,
        frame_id: str,
        grid: GridGeometry | None = None,
        cells: ArrayLike | None = None,
        unit: str = "",
        decimals: int = 1,
        settings: Mapping[str, Any] | None = None,
    ) -> None:
        super().__init__(name, frame_id, settings)
        self.grid = grid
        self.cells: NDArray[np.float32] | None = None
        self.unit = unit
        self.decimals = decimals
        if grid is not None and cells is not None:
            self.cells = _checked(cells, grid)
        elif grid is not None or cells is not None:
            raise ValueError(f"layer {name!r}: give both a grid and its cells, or neither")

    def summary(self) -> str:
        """Return how many cells there are, and what they measure."""
        return f"{0 if self.cells is None else self.cells.size} cells {self.unit}".rstrip()

    def label_at(self, points_xy: PointsLike) -> ObjectArray:
        """Return the interpolated number at each point as text, shape (N,)."""
        return self._labels(self.value_at(points_xy))

    def value_at(self, points_xy: PointsLike) -> NDArray[np.float32]:
        """Return the interpolated number at each point, shape (N,).

        It is NaN off the grid and in cells that hold none; unknown neighbors are left out.
        """
        points = as_points_xy(points_xy)
        if self.grid is None or self.cells is None:
            return np.full(len(points), np.nan, dtype=np.float32)
        return _interpolated(self.cells, self.grid.positions_at(points))

    def labels_in(self, area: BaseGeometry) -> Hits:
        """Return the number and center of each cell whose center the area covers, as text."""
        hits = self.values_in(area)
        return Hits(self._labels(hits.values), hits.points_xy)

    def values_in(self, area: BaseGeometry) -> Hits:
        """Return the number and center of each cell whose center the area covers."""
        if self.grid is None or self.cells is None:
            return Hits(np.empty(0, np.float32), np.empty((0, 2)))
        rows, cols = self.grid.cells_in(area)
        return Hits(self.cells[rows, cols], self.grid.centers(rows, cols))

    def find(self, what: str | float, area: BaseGeometry | None = None) -> NDArray[np.float64]:
        """Return the centers of the cells that hold a number, shape (M, 2).

        A label is that of every number that is rounded to it. A number has to be exactly the one
        in the cell, to the precision of float32.
        """
        hits = self.values_in(self.extent() if area is None else area)
        held = self._labels(hits.values) if isinstance(what, str) else hits.values
        return hits.points_xy[np.flatnonzero(held == what)]

    def extent(self) -> BaseGeometry:
        """Return the area that the grid covers."""
        return shapely.Polygon() if self.grid is None else self.grid.outline()

    def picture(self) -> RasterPicture | None:
        """Return low numbers dark blue, high ones yellow, unknown ones transparent."""
        if self.grid is None or self.cells is None:
            return None
        colors = {str(self._labels(np.array([x]))[0]): rgb for x, rgb in legend(self.cells)}
        return RasterPicture(self.grid, colored(self.cells), colors)

    def _labels(self, values: NDArray[np.float32]) -> ObjectArray:
        return as_objects(UNKNOWN if np.isnan(x) else self._label(x) for x in values)

    def _label(self, value: float) -> str:
        return f"{value:.{self.decimals}f} {self.unit}".rstrip()


def _checked(cells: ArrayLike, grid: GridGeometry) -> NDArray[np.float32]:
    array = np.array(cells, dtype=np.float32)
    if array.shape != grid.shape:
        raise ValueError(f"cells must have shape {grid.shape}, got {array.shape}")
    if np.isinf(array).any():
        raise ValueError("cells must be finite, or NaN where nothing is known")
    array.flags.writeable = False
    return array


def _interpolated(
    cells: NDArray[np.float32], positions: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Return the bilinear interpolation between the centers of cells.

    Args:
        cells: shape (height, width).
        positions: (row, col) as `GridGeometry.positions_at` returns them, shape (N, 2).
    """
    height, width = cells.shape
    values = np.full(len(positions), np.nan, dtype=np.float32)
    inside = np.flatnonzero(((positions >= 0) & (positions < (height, width))).all(axis=1))
    rows, cols = np.floor(positions[inside]).astype(int).T
    known = inside[~np.isnan(cells[rows, cols])]

    from_center = positions[known] - 0.5
    first = np.floor(from_center).astype(int)
    total, weights = np.zeros(len(first)), np.zeros(len(first))
    for step in ((0, 0), (0, 1), (1, 0), (1, 1)):
        corner = first + step
        weight = np.prod(1 - np.abs(from_center - corner), axis=1)
        # Beyond the outermost centers, the outermost cells go on.
        rows, cols = np.clip(corner, 0, (height - 1, width - 1)).T
        value = cells[rows, cols]
        weight = np.where(np.isnan(value), 0, weight)
        total += weight * np.nan_to_num(value)
        weights += weight
    values[known] = total / weights
    return values
