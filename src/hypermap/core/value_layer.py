"""The value layer: a measured quantity, such as temperature or WiFi, on a grid."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import (
    BoolArray,
    ObjectArray,
    PointsLike,
    as_objects,
    as_point_xy,
    as_points_xy,
)
from hypermap.core.cell_outlines import cell_outlines
from hypermap.core.grid import GridGeometry
from hypermap.core.layer import Hits, Layer, RasterPicture, check_count
from hypermap.core.samples import Samples
from hypermap.core.shapes import as_area

UNKNOWN = "Unknown"

# Five colors of the map "viridis" of Smith and van der Walt (CC0), which people of all kinds of
# color vision, and printers without color, can order from low to high.
_STOPS = np.array([(68, 1, 84), (59, 82, 139), (33, 145, 140), (94, 201, 98), (253, 231, 37)])
_ALPHA = 170  # walls below stay visible
_FADED = 0.7  # how much paler the least certain cells are
_PALER = "paler: less certain"
_SIGNIFICANT = 3  # digits of the range that labels show


@dataclass(frozen=True)
class ValueSummary:
    """What the cells of an area say about a quantity.

    Attributes:
        count: cells with a value. Without any, the numbers are NaN.
        mean: of the cells.
        least: the smallest value.
        most: the largest value.
        share: of the cells with a value, whose value is within the limits of the query.
    """

    count: int
    mean: float
    least: float
    most: float
    share: float


class ValueLayer(Layer):
    """A quantity in each cell of a grid; NaN where unknown.

    The value at a point is that of its cell: nothing is smoothed across a wall. A label is the
    rounded number with its unit, as "21.5 °C", or "Unknown".

    Attributes:
        grid: geometry of the cells; None while the layer is empty.
        cells: float32, shape (height, width), read-only; None while the layer is empty.
        unit: of cells, deviations and samples, as labels show it.
        decimals: how many of them labels show.
        quantity: what was measured, such as "temperature"; the layer's name by default.
        deviations: standard deviation of each cell's value, float32, (height, width), read-only.
            None if unknown.
        stamps: when the newest sample in each cell was taken, float64, (height, width), read-only
            [s]; NaN where there was none. None without times.
        samples: the samples behind the values, in the layer's frame; None if they were not kept.
        made_by: method and settings that computed the values from the samples: text and numbers.

    Raises:
        ValueError: If only one of `grid` and `cells` is given, an array has another shape, a number
            is infinite, or a deviation negative.

    >>> grid = GridGeometry(width=2, height=1, resolution=1.0)
    >>> layer = ValueLayer("warmth", "map", grid, np.array([[20.0, 22.0]]), unit="°C")
    >>> layer.label_at([[0.5, 0.5], [1.0, 0.5], [9.0, 9.0]])
    array(['20.0 °C', '22.0 °C', 'Unknown'], dtype=object)
    >>> layer.summary_in(layer.extent(), above=21)
    ValueSummary(count=2, mean=21.0, least=20.0, most=22.0, share=0.5)
    >>> layer.where(above=21).bounds
    (1.0, 0.0, 2.0, 1.0)
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
        *,
        quantity: str = "",
        deviations: ArrayLike | None = None,
        stamps: ArrayLike | None = None,
        samples: Samples | None = None,
        made_by: Mapping[str, str | float] | None = None,
        settings: Mapping[str, Any] | None = None,
    ) -> None:
        super().__init__(name, frame_id, settings)
        if (grid is None) != (cells is None):
            raise ValueError(f"layer {name!r}: give both a grid and its cells, or neither")
        self.grid = grid
        self.cells = _checked("cells", cells, grid, np.float32)
        self.unit = unit
        self.decimals = decimals
        self.quantity = quantity or name
        self.deviations = _checked("deviations", deviations, grid, np.float32)
        if self.deviations is not None and (self.deviations < 0).any():
            raise ValueError("deviations must not be negative")
        self.stamps = _checked("stamps", stamps, grid, np.float64)
        self.samples = samples
        self.made_by: dict[str, str | float] = dict(made_by or {})

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        for array in (self.cells, self.deviations, self.stamps):
            if array is not None:
                array.flags.writeable = False  # which copies and pickles of arrays forget

    def summary(self) -> str:
        """Return the quantity and the range of its values."""
        if self.grid is None:
            return "empty"
        found = self.summary_in(self.extent())
        cells = f"{self.grid.width} x {self.grid.height} cells of {self.grid.resolution:g} m"
        if not found.count:
            return f"{self.quantity}: unknown all over, {cells}"
        first = f"{found.least:.{self.decimals}f}"
        of_samples = ""
        if self.samples is not None:
            number = len(self.samples)
            of_samples = f" of {number} sample{'' if number == 1 else 's'}"
        return f"{self.quantity}: {first} to {self.text(found.most)}{of_samples}, {cells}"

    # Queries that every layer answers

    def label_at(self, points_xy: PointsLike) -> ObjectArray:
        """Return the value at each point as text, shape (N,)."""
        return self._labels(self.value_at(points_xy))

    def value_at(self, points_xy: PointsLike) -> NDArray[np.float32]:
        """Return the value of the cell under each point, shape (N,); NaN where it is unknown."""
        return np.asarray(self._at(self.cells, points_xy), dtype=np.float32)

    def labels_in(self, area: BaseGeometry) -> Hits:
        """Return the value and center of each cell whose center the area covers, as text."""
        hits = self.values_in(area)
        return Hits(self._labels(hits.values), hits.points_xy)

    def values_in(self, area: BaseGeometry) -> Hits:
        """Return the value and center of each cell whose center the area covers, by rows."""
        if self.grid is None or self.cells is None:
            as_area(area)
            return Hits(np.empty(0, np.float32), np.empty((0, 2)))
        rows, cols = self.grid.cells_in(area)
        return Hits(self.cells[rows, cols], self.grid.centers(rows, cols))

    def find(self, what: str | float, area: BaseGeometry | None = None) -> NDArray[np.float64]:
        """Return the centers of the cells with a label or value, shape (M, 2).

        A label matches every number that is rounded to it. A number has to be exactly the one
        in the cell, to the precision of float32. `where` finds what is above or below one.
        """
        hits = self.values_in(self.extent() if area is None else area)
        held = self._labels(hits.values) if isinstance(what, str) else hits.values
        return hits.points_xy[np.flatnonzero(held == what)]

    def extent(self) -> BaseGeometry:
        """Return the area that the grid covers."""
        return shapely.Polygon() if self.grid is None else self.grid.outline()

    def picture(self) -> RasterPicture | None:
        """Return low values dark blue, high ones yellow, unknown ones transparent.

        With deviations, less certain cells are paler.
        """
        if self.grid is None or self.cells is None:
            return None
        known = self.cells[~np.isnan(self.cells)].astype(np.float64)
        low, high = _range(known) if known.size else (0.0, 0.0)
        rgba, legend = _colored(self.cells, low, high), self._legend(low, high)
        if self.deviations is not None and legend:
            doubt = _doubt(self.deviations)
            rgba[..., 3] = (rgba[..., 3] * (1 - _FADED * doubt)).round()
            if doubt.max() > 0:
                legend[_PALER] = _on_white(np.array([0.5]), 1 - _FADED)[0]
        return RasterPicture(self.grid, rgba, legend)

    # Queries of values

    def text(self, value: float, deviation: float = math.nan) -> str:
        """Return a value as labels show it, with its standard deviation where that is known.

        >>> wifi = ValueLayer("wifi", "map", unit="dBm", decimals=0)
        >>> wifi.text(-71.6), wifi.text(-71.6, 2.9)
        ('-72 dBm', '-72 ± 3 dBm')
        """
        if np.isnan(value):
            return UNKNOWN
        about = "" if np.isnan(deviation) else f" ± {deviation:.{self.decimals}f}"
        return f"{value:.{self.decimals}f}{about} {self.unit}".rstrip()

    def deviation_at(self, points_xy: PointsLike) -> NDArray[np.float32]:
        """Return the value's standard deviation at each point, shape (N,); NaN where unknown."""
        return np.asarray(self._at(self.deviations, points_xy), dtype=np.float32)

    def stamp_at(self, points_xy: PointsLike) -> NDArray[np.float64]:
        """Return when the newest sample in the cell under each point was taken [s], shape (N,).

        NaN where there was none, or times were not kept.
        """
        return self._at(self.stamps, points_xy)

    def summary_in(
        self, area: BaseGeometry, *, above: float | None = None, below: float | None = None
    ) -> ValueSummary:
        """Return mean and range of the cells whose center an area covers.

        If an area covers no center, as a small object may, the cell at a point inside it counts.

        Args:
            area: in the layer's frame [m].
            above: `share` counts values above this.
            below: `share` counts values below this.
        """
        values = self.values_in(area).values
        if not len(values) and not area.is_empty:
            values = self.value_at(area.representative_point())
        values = values[~np.isnan(values)]
        if not len(values):
            return ValueSummary(0, math.nan, math.nan, math.nan, math.nan)
        share = float(_within(values, above, below).mean())
        mean, least, most = float(values.mean(dtype=np.float64)), *_range(values)
        return ValueSummary(len(values), mean, least, most, share)

    def where(
        self,
        *,
        above: float | None = None,
        below: float | None = None,
        area: BaseGeometry | None = None,
    ) -> BaseGeometry:
        """Return where the quantity is above, below or between two values.

        Args:
            above: the values are larger.
            below: the values are smaller.
            area: only cells whose center it covers; None for all.

        Returns:
            The cells' outlines in the layer's frame: a polygon, several, or an empty one.

        Raises:
            ValueError: If neither limit is given.
        """
        if self.grid is None:
            return shapely.Polygon()
        outlines, _ = cell_outlines(self._asked(above, below, area).astype(np.int32))
        pose, side = self.grid.origin, self.grid.resolution
        shapes = shapely.transform(outlines, lambda cells: pose.apply(cells * side))
        if len(shapes) == 1:
            only: BaseGeometry = shapes[0]
            return only
        return shapely.MultiPolygon(list(shapes)) if len(shapes) else shapely.Polygon()

    def nearest_where(
        self,
        point_xy: PointsLike,
        k: int = 1,
        *,
        above: float | None = None,
        below: float | None = None,
        area: BaseGeometry | None = None,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the nearest cells in which the quantity is above, below or between two values.

        Args:
            point_xy: from where, in the layer's frame [m].
            k: how many at most.
            above: as in `where`.
            below: as in `where`.
            area: as in `where`.

        Returns:
            Centers (K, 2) and distances (K,) [m], nearest first; K is at most `k`.

        Raises:
            ValueError: If neither limit is given, `k` is below 1, or it is not one point.
        """
        check_count(k)
        point = as_point_xy(point_xy)
        if self.grid is None:
            return np.empty((0, 2)), np.empty(0)
        centers = self.grid.centers(*np.nonzero(self._asked(above, below, area)))
        distances = np.hypot(*(centers - point).T)
        order = np.argsort(distances, kind="stable")[:k]
        return centers[order], distances[order]

    def _at(
        self, array: NDArray[np.floating[Any]] | None, points_xy: PointsLike
    ) -> NDArray[np.float64]:
        points = as_points_xy(points_xy)
        found = np.full(len(points), np.nan)
        if self.grid is not None and array is not None:
            rows, cols = self.grid.cells_at(points).T
            inside = self.grid.contains(rows, cols)
            found[inside] = array[rows[inside], cols[inside]]
        return found

    def _asked(
        self, above: float | None, below: float | None, area: BaseGeometry | None
    ) -> BoolArray:
        """Return which cells are within limits and an area, (height, width)."""
        if above is None and below is None:
            raise ValueError("where is what? give above, below or both")
        assert self.grid is not None
        assert self.cells is not None
        asked = _within(self.cells, above, below)
        if area is not None:
            covered = np.zeros(self.grid.shape, dtype=bool)
            covered[self.grid.cells_in(area)] = True
            asked &= covered
        return asked

    def _labels(self, values: NDArray[np.float32]) -> ObjectArray:
        return as_objects(map(self.text, values.tolist()))

    def _legend(self, low: float, high: float) -> dict[str, tuple[int, int, int]]:
        """Return some values from the highest to the lowest, and their colors on white ground."""
        assert self.cells is not None
        if np.isnan(self.cells).all():
            return {}
        shares = np.linspace(1, 0, len(_STOPS)) if high > low else np.zeros(1)
        values = (low + shares * (high - low)).tolist()
        colors = _on_white(shares)
        return {self.text(value): color for value, color in zip(values, colors, strict=True)}


def decimals_for(values: NDArray[np.floating[Any]]) -> int:
    """Return with how many decimals values show three digits of the range that they cover.

    >>> decimals_for(np.array([18.2, 24.9])), decimals_for(np.array([-90.0, -30.0]))
    (2, 1)
    """
    spread = float(np.nanmax(values) - np.nanmin(values)) if np.isfinite(values).any() else 0.0
    if spread == 0:
        return 1
    return min(max(0, _SIGNIFICANT - 1 - math.floor(math.log10(spread))), 9)


def _within(values: NDArray[np.float32], above: float | None, below: float | None) -> BoolArray:
    """Return which values are known, and above and below limits."""
    with np.errstate(over="ignore"):  # of limits beyond all that cells can hold
        lowest = np.float32(-np.inf if above is None else above)
        highest = np.float32(np.inf if below is None else below)
    return np.asarray((values > lowest) & (values < highest))


def _checked(
    name: str, numbers: ArrayLike | None, grid: GridGeometry | None, dtype: type
) -> NDArray[Any] | None:
    if numbers is None:
        return None
    with np.errstate(over="ignore"):  # which makes them infinite
        array: NDArray[Any] = np.array(numbers, dtype=dtype)
    if grid is None or array.shape != grid.shape:
        expected = None if grid is None else grid.shape
        raise ValueError(f"{name} must have shape {expected}, got {array.shape}")
    if np.isinf(array).any():
        raise ValueError(f"{name} must be finite, or NaN where unknown")
    array.flags.writeable = False
    return array


def _range(values: NDArray[np.floating[Any]]) -> tuple[float, float]:
    return float(values.min()), float(values.max())


def _colored(cells: NDArray[np.float32], low: float, high: float) -> NDArray[np.uint8]:
    """Return the color of each cell, shape (height, width, 4); transparent where it is NaN."""
    share = (cells.astype(np.float64) - low) / (high - low) if high > low else np.zeros(cells.shape)
    known = ~np.isnan(cells)
    rgba = np.zeros((*cells.shape, 4), dtype=np.uint8)
    rgba[known, :3] = _color(share[known])
    rgba[known, 3] = _ALPHA
    return rgba


def _doubt(deviations: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return 0 where a layer is most certain, and up to 1, the more the less certain it is."""
    known = np.isfinite(deviations)
    if not known.any():
        return np.zeros(deviations.shape)
    low, high = _range(deviations[known])
    above = np.where(known, deviations - low, 0.0)
    return np.asarray(above / high if high > 0 else above, dtype=np.float64)


def _on_white(shares: NDArray[np.float64], certainty: float = 1.0) -> list[tuple[int, int, int]]:
    """Return how colors of shares between 0 and 1 look on white ground."""
    alpha = round(_ALPHA * certainty)
    mixed = 255 - (255 - _color(shares).astype(int)) * alpha // 255
    return [(red, green, blue) for red, green, blue in mixed.tolist()]


def _color(share: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return colors, shape (N, 3), of shares between 0 and 1, shape (N,)."""
    places = np.linspace(0, 1, len(_STOPS))
    channels = [np.interp(share, places, channel) for channel in _STOPS.T]
    return np.stack(channels, axis=-1).round().astype(np.uint8)
