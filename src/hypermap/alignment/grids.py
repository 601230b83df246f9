"""What of a map is matched: occupied and free cells, and objects, in its base frame."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray, FloatArray
from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import ROOMS, Hypermap
from hypermap.core.occupancy import OccupancyLayer

_OCCUPIED, _FREE = 65, 25  # from and up to these values, as map_server has it
_SAME_WALL = 0.08  # [m] up to which walls are the same, plus half a cell of each map
_MOST_CELLS = 4_000_000  # of a field of distances; larger maps get larger cells


@dataclass(frozen=True, eq=False)
class Scan:
    """A map as points, in its base frame.

    Attributes:
        occupied_xy: centers of occupied cells [m], shape (N, 2).
        free_xy: centers of free cells [m], shape (M, 2).
        resolution: of the cells [m].
        objects_xy: centers of objects [m], shape (K, 2).
        names: of the objects, shape (K,).
    """

    occupied_xy: FloatArray
    free_xy: FloatArray
    resolution: float
    objects_xy: FloatArray
    names: NDArray[np.str_]

    @cached_property
    def known_xy(self) -> FloatArray:
        """Centers of all known cells [m], shape (N, 2)."""
        return np.concatenate([self.occupied_xy, self.free_xy])

    @cached_property
    def center(self) -> FloatArray:
        """Middle of what is known [m], shape (2,)."""
        known = self.known_xy
        middle: FloatArray = (known.min(axis=0) + known.max(axis=0)) / 2
        return middle

    @cached_property
    def radius(self) -> float:
        """How far what is known reaches from its middle [m]."""
        return float(np.linalg.norm(self.known_xy - self.center, axis=1).max())


def wall_tolerance(a: Scan, b: Scan) -> float:
    """Return how far walls of two maps may be apart to be the same [m]."""
    return _SAME_WALL + (a.resolution + b.resolution) / 2


def scan_of(hypermap: Hypermap, layer: str | None = None) -> Scan:
    """Return what of a map is matched.

    Args:
        hypermap: the map.
        layer: name of its occupancy layer; None for the only one.

    Raises:
        HypermapError: If there is no such layer, or it has no occupied or no free cells.
        FrameError: If its frame is not connected to the base frame.
    """
    grid: OccupancyLayer = hypermap.occupancy(layer)
    if grid.grid is None or grid.cells is None:
        raise HypermapError(f"layer {grid.name!r} is empty")
    base_T_layer = hypermap.frames.lookup(hypermap.base_frame, grid.frame_id)
    cells = grid.cells

    def centers(chosen: BoolArray) -> FloatArray:
        assert grid.grid is not None
        return base_T_layer.apply(grid.grid.centers(*np.nonzero(chosen)))

    occupied, free = centers(cells >= _OCCUPIED), centers((cells >= 0) & (cells <= _FREE))
    if not len(occupied) or not len(free):
        kind = "free" if len(occupied) else "occupied"
        raise HypermapError(f"layer {grid.name!r} has no {kind} cells, which alignment needs")
    things = [item for item in hypermap.objects() if item.layer != ROOMS]
    places = np.array([item.point_xy for item in things], dtype=float).reshape(-1, 2)
    names = np.array([str(item.object.name) for item in things], dtype=np.str_)
    return Scan(occupied, free, grid.grid.resolution, places, names)


@dataclass(frozen=True, eq=False)
class Field:
    """Fields over a map, in cells that are parallel to the axes of its base frame.

    Attributes:
        origin_xy: corner of the first cell [m], shape (2,).
        resolution: of the cells [m].
        distance: to the next occupied cell [m], shape (height, width).
        known: where cells are known, shape (height, width).
    """

    origin_xy: FloatArray
    resolution: float
    distance: NDArray[np.float32]
    known: BoolArray

    @classmethod
    def of(cls, scan: Scan, resolution: float, margin: float) -> Field:
        """Return the fields of a map, with some margin around what is known [m]."""
        known_xy = scan.known_xy
        extent = np.ptp(known_xy, axis=0) + 2 * margin
        cells = np.prod(extent / resolution)
        if cells > _MOST_CELLS:
            resolution *= float(np.sqrt(cells / _MOST_CELLS))
        # The points are centers of cells: at corners, rounding would decide on which side they are.
        low = known_xy.min(axis=0) - (math.ceil(margin / resolution) + 0.5) * resolution
        shape = np.ceil(extent / resolution).astype(int)[::-1] + 3
        occupied = _raster(scan.occupied_xy, low, resolution, shape)
        known = occupied | _raster(scan.free_xy, low, resolution, shape)
        known = scipy.ndimage.binary_closing(
            known, np.ones((3, 3), dtype=bool)
        )  # rotated cells leave holes
        distance = scipy.ndimage.distance_transform_edt(~occupied) * resolution
        return cls(low, resolution, distance.astype(np.float32), known)

    def at(self, points_xy: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Return the distance at each point [m], and whether it is known, shape (N,) each.

        Between the centers of cells it is interpolated.
        """
        cols, rows = np.rint(self._cells_of(points_xy)).astype(int).T
        height, width = self.known.shape
        inside = (rows >= 0) & (rows < height) & (cols >= 0) & (cols < width)
        known = np.zeros(len(points_xy), dtype=bool)
        known[inside] = self.known[rows[inside], cols[inside]]
        return self.near(points_xy)[0], known

    def near(self, points_xy: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the distance at each point [m], and how it grows along x and y, shape (N, 2).

        Between the centers of cells it is interpolated; outside, it is that of the nearest cell.
        """
        height, width = self.distance.shape
        most = np.array([width, height]) - 1
        cells = self._cells_of(points_xy)
        places = np.clip(cells, 0, most)
        first = np.minimum(places.astype(int), most - 1)
        right, up = (places - first).T
        index = first[:, 1] * width + first[:, 0]
        flat = self.distance.ravel()
        low, low_right = flat[index], flat[index + 1]
        high, high_right = flat[index + width], flat[index + width + 1]
        below, above = low + right * (low_right - low), high + right * (high_right - high)
        along_cols = (1 - up) * (low_right - low) + up * (high_right - high)
        slope = np.column_stack([along_cols, above - below]) / self.resolution
        slope[places != cells] = 0.0
        return below + up * (above - below), slope

    def _cells_of(self, points_xy: FloatArray) -> FloatArray:
        """Return points in cells, counted from the center of the first one: columns, rows."""
        cells: FloatArray = (points_xy - self.origin_xy) / self.resolution - 0.5
        return cells


def _raster(
    points_xy: FloatArray, low: FloatArray, resolution: float, shape: NDArray[np.int64]
) -> BoolArray:
    cells: BoolArray = np.zeros(shape, dtype=bool)
    cols, rows = np.floor((points_xy - low) / resolution).astype(int).T
    cells[rows, cols] = True
    return cells
