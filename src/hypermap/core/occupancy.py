"""The occupancy layer: how likely each cell of a grid is to be occupied."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import BoolArray, IntArray, ObjectArray, PointsLike, as_points_xy
from hypermap.core.grid import GridGeometry, Window
from hypermap.core.layer import Hits, Layer, RasterPicture

UNKNOWN, FREE, OCCUPIED = -1, 0, 100
LABELS = ("Free", "Occupied", "Unknown")

_MEANING = f"{UNKNOWN} unknown, {FREE} free .. {OCCUPIED} occupied"
_LARGEST = 255  # in a raw map, whose values are gray values of an image
COLORS = {"Free": (255, 255, 255), "Occupied": (104, 112, 126), "Unknown": (229, 232, 236)}


class OccupancyLayer(Layer):
    """Occupancy on a grid; row 0 is at the origin, and rows increase along y.

    A cell's label is "Free" for the value 0, "Occupied" for 100, and "Unknown" for every other
    value and outside the grid. A layer without a grid is empty.

    Attributes:
        grid: the geometry of the cells; None while the layer is empty.
        cells: read-only, shape (height, width); int8 with -1 unknown, 0 free .. 100 occupied, or
            int16 if a raw map has values up to 255. None while the layer is empty. It is a view: a
            contiguous int8 or int16 array is not copied. Cells may also be given as bool: True
            for occupied, False for free.

    Raises:
        ValueError: If only one of `grid` and `cells` is given, their shapes differ, or a value
            is below -1 or above 255.
        TypeError: If the cells are neither integers nor bool.

    >>> grid = GridGeometry(width=2, height=1, resolution=0.5)
    >>> layer = OccupancyLayer("occupancy", "map", grid, np.array([[0, 100]]))
    >>> layer.value_at([[0.7, 0.2], [9.0, 9.0]])
    array([100,  -1], dtype=int32)
    >>> layer.find("Free")
    array([[0.25, 0.25]])
    """

    class_name: ClassVar[str] = "OccupancyGridLayer"

    def __init__(
        self,
        name: str,
        frame_id: str,
        grid: GridGeometry | None = None,
        cells: NDArray[np.integer[Any]] | BoolArray | None = None,
        settings: Mapping[str, Any] | None = None,
    ) -> None:
        super().__init__(name, frame_id, settings)
        self.grid = grid
        self.cells: NDArray[np.int8] | NDArray[np.int16] | None = None
        if grid is not None and cells is not None:
            self.cells = _checked(cells, grid)
        elif grid is not None or cells is not None:
            raise ValueError(f"layer {name!r}: give both a grid and its cells, or neither")

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        if self.cells is not None:
            self.cells.flags.writeable = False  # copies and pickles of arrays lose the flag

    def summary(self) -> str:
        """Return the size of the grid."""
        if self.grid is None:
            return "empty"
        (rows, cols), side = self.grid.shape, self.grid.resolution
        size = f"{cols * side:.4g} x {rows * side:.4g} m"
        return f"{cols} x {rows} cells of {side:g} m ({size})"

    def label_at(self, points_xy: PointsLike) -> ObjectArray:
        """Return "Free", "Occupied" or "Unknown" for each point, shape (N,)."""
        return _labels(self.value_at(points_xy))

    def value_at(self, points_xy: PointsLike) -> NDArray[np.int32]:
        """Return the cell at each point, shape (N,); -1 where unknown or outside the grid."""
        points = as_points_xy(points_xy)
        values = np.full(len(points), UNKNOWN, dtype=np.int32)
        if self.grid is not None and self.cells is not None:
            rows, cols = self.grid.cells_at(points).T
            on_grid = self.grid.contains(rows, cols)
            values[on_grid] = self.cells[rows[on_grid], cols[on_grid]]
        return values

    def labels_in(self, area: BaseGeometry) -> Hits:
        """Return the label and center of each cell whose center the area covers, row by row."""
        hits = self.values_in(area)
        return Hits(_labels(hits.values), hits.points_xy)

    def values_in(self, area: BaseGeometry) -> Hits:
        """Return the value and center of each cell whose center the area covers, row by row."""
        if self.grid is None or self.cells is None:
            return Hits(np.empty(0, np.int32), np.empty((0, 2)))
        values, found = [np.empty(0, np.int32)], []
        for window in self.grid.windows_in(area):
            values.append(self.cells[window.slices][window.inside].astype(np.int32))
            found.append((window, window.positions()))
        return Hits(np.concatenate(values), _centers(self.grid, found))

    def find(self, what: str | float, area: BaseGeometry | None = None) -> NDArray[np.float64]:
        """Return the centers of the cells with a label or value, shape (M, 2), row by row."""
        if self.grid is None or self.cells is None:
            return np.empty((0, 2))
        found = [
            (window, window.positions(_matches(self.cells[window.slices], what)))
            for window in self.grid.windows_in(area)
        ]
        return _centers(self.grid, found)

    def counts(self) -> dict[str, int]:
        """Return how many cells have each label; an empty dict for an empty layer."""
        if self.cells is None:
            return {}
        return {label: int(np.count_nonzero(_matches(self.cells, label))) for label in LABELS}

    def extent(self) -> BaseGeometry:
        """Return the area that the grid covers."""
        return shapely.Polygon() if self.grid is None else self.grid.outline()

    def picture(self) -> RasterPicture | None:
        """Return an image: free cells light, occupied cells dark, unknown cells transparent."""
        if self.grid is None or self.cells is None:
            return None
        return RasterPicture(self.grid, cell_colors()[self.cells], COLORS)


def _checked(cells: NDArray[np.integer[Any]] | BoolArray, grid: GridGeometry) -> NDArray[Any]:
    """Return a read-only view of the cells, as int8 or int16."""
    array = np.asarray(cells)
    if array.shape != grid.shape:
        raise ValueError(f"cells must have shape {grid.shape}, got {array.shape}")
    if array.dtype == bool:
        array = np.where(array, np.int8(OCCUPIED), np.int8(FREE))
    if not np.issubdtype(array.dtype, np.integer):
        raise TypeError(f"cells must be integers ({_MEANING}) or bool, got {array.dtype}")
    lowest, highest = int(array.min()), int(array.max())
    if lowest < UNKNOWN or highest > _LARGEST:
        wrong = lowest if lowest < UNKNOWN else highest
        raise ValueError(
            f"cells must be between {UNKNOWN} and {_LARGEST} ({_MEANING}), one is {wrong}"
        )
    if array.dtype not in (np.int8, np.int16):
        array = array.astype(np.int8 if highest <= np.iinfo(np.int8).max else np.int16)
    view = np.ascontiguousarray(array).view()
    view.flags.writeable = False
    return view


def _centers(grid: GridGeometry, found: list[tuple[Window, IntArray]]) -> NDArray[np.float64]:
    """Return the centers of cells, at positions in windows, shape (M, 2)."""
    points = np.empty((sum(len(positions) for _, positions in found), 2))
    end = 0
    for window, positions in found:
        begin, end = end, end + len(positions)
        points[begin:end] = grid.centers(*window.cells(positions))
    return points


def _labels(values: IntArray) -> ObjectArray:
    labels = np.full(len(values), "Unknown", dtype=object)
    labels[values == FREE] = "Free"
    labels[values == OCCUPIED] = "Occupied"
    return labels


def _matches(cells: IntArray, what: str | float) -> BoolArray:
    """Return which cells have a label or value."""
    if not isinstance(what, str):
        return np.asarray(cells == what)
    if what == "Unknown":
        return np.asarray((cells != FREE) & (cells != OCCUPIED))
    values = {"Free": FREE, "Occupied": OCCUPIED}
    return np.asarray(cells == values[what]) if what in values else np.zeros(cells.shape, bool)


def cell_colors() -> NDArray[np.uint8]:
    """Return the color of each value, shape (257, 4); the last, at index -1, is for unknown.

    Red, green, blue and alpha, 0..255; unknown cells are transparent.
    """
    palette = np.full((_LARGEST + 2, 4), 255, dtype=np.uint8)
    share = np.minimum(np.arange(_LARGEST + 1) / OCCUPIED, 1)[:, np.newaxis]
    free, occupied = np.array(COLORS["Free"]), np.array(COLORS["Occupied"])
    palette[:-1, :3] = np.round(free + share * (occupied - free))
    palette[-1] = (*COLORS["Unknown"], 0)
    return palette
