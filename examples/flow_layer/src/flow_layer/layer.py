"""The flow layer: which way people mostly walk, by cells of a grid."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

from flow_layer.colors import colored, on_white
from hypermap.core.arrays import ObjectArray, PointsLike, as_objects, as_points_xy
from hypermap.core.grid import GridGeometry
from hypermap.core.layer import Hits, Layer, RasterPicture

UNKNOWN = "Unknown"
_IN_LEGEND = (0, 90, 180, -90)  # degrees


class FlowLayer(Layer):
    """The heading of people in each cell of a grid; NaN where nobody was seen to walk.

    A heading is counterclockwise from the x axis of the layer's frame. A label is in whole degrees,
    as "90°", or "Unknown".

    Attributes:
        grid: where the cells lie; None while the layer is empty.
        cells: headings [rad], from -pi to pi, float32, shape (height, width), read-only; None while
            the layer is empty.

    Raises:
        ValueError: If only one of `grid` and `cells` is given, their shapes differ, or a heading is
            infinite.

    >>> grid = GridGeometry(width=2, height=1, resolution=1.0)
    >>> layer = FlowLayer("people", "map", grid, np.radians([[90.0, 225.0]]))
    >>> layer.label_at([[0.5, 0.5], [1.5, 0.5], [9.0, 9.0]])
    array(['90°', '-135°', 'Unknown'], dtype=object)
    """

    class_name: ClassVar[str] = "FlowLayer"

    def __init__(
        self,
        name: str,
        frame_id: str,
        grid: GridGeometry | None = None,
        cells: ArrayLike | None = None,
        settings: Mapping[str, Any] | None = None,
    ) -> None:
        super().__init__(name, frame_id, settings)
        self.grid = grid
        self.cells: NDArray[np.float32] | None = None
        if grid is not None and cells is not None:
            self.cells = _checked(cells, grid)
        elif grid is not None or cells is not None:
            raise ValueError(f"layer {name!r}: give both a grid and its cells, or neither")

    @staticmethod
    def of_steps(
        name: str, frame_id: str, grid: GridGeometry, begins: PointsLike, ends: PointsLike
    ) -> FlowLayer:
        """Return the mean direction of steps that people made, by the cells where these begin.

        Args:
            name: of the layer.
            frame_id: of grid and points.
            grid: where the cells lie; steps that begin off it do not count.
            begins: where each step begins [m], shape (N, 2).
            ends: where it ends [m], shape (N, 2).
        """
        starts = as_points_xy(begins)
        steps = as_points_xy(ends) - starts
        rows, cols = grid.cells_at(starts).T
        counted = grid.contains(rows, cols)
        sums = np.zeros((*grid.shape, 2))
        np.add.at(sums, (rows[counted], cols[counted]), steps[counted])
        headings = np.arctan2(sums[..., 1], sums[..., 0])
        headings[(sums == 0).all(axis=-1)] = np.nan
        return FlowLayer(name, frame_id, grid, headings)

    def summary(self) -> str:
        """Return in how many cells people walked."""
        known = 0 if self.cells is None else np.count_nonzero(~np.isnan(self.cells))
        return f"directions in {known} cells"

    def label_at(self, points_xy: PointsLike) -> ObjectArray:
        """Return the heading at each point as text, shape (N,)."""
        return _labels(self.value_at(points_xy))

    def value_at(self, points_xy: PointsLike) -> NDArray[np.float32]:
        """Return the heading at each point [rad], shape (N,); NaN where it is unknown."""
        points = as_points_xy(points_xy)
        values = np.full(len(points), np.nan, dtype=np.float32)
        if self.grid is not None and self.cells is not None:
            rows, cols = self.grid.cells_at(points).T
            inside = self.grid.contains(rows, cols)
            values[inside] = self.cells[rows[inside], cols[inside]]
        return values

    def labels_in(self, area: BaseGeometry) -> Hits:
        """Return the heading and center of each cell whose center the area covers, as text."""
        hits = self.values_in(area)
        return Hits(_labels(hits.values), hits.points_xy)

    def values_in(self, area: BaseGeometry) -> Hits:
        """Return the heading and center of each cell whose center the area covers."""
        if self.grid is None or self.cells is None:
            return Hits(np.empty(0, np.float32), np.empty((0, 2)))
        rows, cols = self.grid.cells_in(area)
        return Hits(self.cells[rows, cols], self.grid.centers(rows, cols))

    def find(self, what: str | float, area: BaseGeometry | None = None) -> NDArray[np.float64]:
        """Return the centers of the cells with a heading, shape (M, 2).

        A label is that of every heading that is rounded to it. A number has to be exactly the one
        in the cell, to the precision of float32.
        """
        hits = self.values_in(self.extent() if area is None else area)
        held = _labels(hits.values) if isinstance(what, str) else hits.values
        return hits.points_xy[np.flatnonzero(held == what)]

    def extent(self) -> BaseGeometry:
        """Return the area that the grid covers."""
        return shapely.Polygon() if self.grid is None else self.grid.outline()

    def picture(self) -> RasterPicture | None:
        """Return a color for each direction; cells without one are transparent."""
        if self.grid is None or self.cells is None:
            return None
        colors = colored(np.radians(np.array(_IN_LEGEND, dtype=np.float32)))
        legend = {f"{at}°": on_white(color) for at, color in zip(_IN_LEGEND, colors, strict=True)}
        return RasterPicture(self.grid, colored(self.cells), legend)


def _labels(headings: NDArray[np.float32]) -> ObjectArray:
    return as_objects(UNKNOWN if np.isnan(x) else _label(x) for x in headings.tolist())


def _label(heading: float) -> str:
    """Return a heading [rad] in whole degrees.

    >>> [_label(heading) for heading in (-math.pi, -0.001, math.pi)]
    ['180°', '0°', '180°']
    """
    degrees = round(math.degrees(heading))
    return f"{180 if degrees == -180 else degrees}°"


def _checked(cells: ArrayLike, grid: GridGeometry) -> NDArray[np.float32]:
    given = np.array(cells, dtype=np.float64)
    if given.shape != grid.shape:
        raise ValueError(f"cells must have shape {grid.shape}, got {given.shape}")
    if np.isinf(given).any():
        raise ValueError("cells must be finite, or NaN where unknown")
    turned = np.arctan2(np.sin(given), np.cos(given))
    headings = np.where(np.abs(given) > np.float32(np.pi), turned, given).astype(np.float32)
    headings.flags.writeable = False
    return headings
