"""Ray casting: depth images and laser scans as rays over the floor, and the cells they cross."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hypermap._loops import inner_loop, loop
from hypermap.core.arrays import BoolArray
from hypermap.core.grid import GridGeometry
from hypermap.mapping.stages import OccupancyConfig
from hypermap.perception.frame import RgbdFrame


@dataclass(frozen=True, eq=False)
class Rays:
    """Rays over the floor: hits, and the free segments before them.

    Attributes:
        hits_xy: hits in the map frame [m], shape (N, 2).
        free_from_xy: where the free segments begin [m], shape (M, 2).
        free_to_xy: where they end [m], shape (M, 2).
    """

    hits_xy: NDArray[np.float64]
    free_from_xy: NDArray[np.float64]
    free_to_xy: NDArray[np.float64]

    @classmethod
    def of_depth(cls, frame: RgbdFrame, config: OccupancyConfig) -> Rays:
        """Return the rays of a depth image.

        A point between `min_height` and `max_height` above the floor is a hit. A ray frees only
        the segment between the floor and `free_below`: a ray high above a cell says nothing about
        a table below it.
        """
        points = frame.points(config.pixel_step)
        hits, free_from, free_to = np.empty((3, points.shape[0] * points.shape[1], 2))
        n_hits, n_free = _cast(
            points,
            np.ascontiguousarray(frame.map_T_camera),
            (config.min_height, config.max_height, config.free_below),
            config.max_range,
            config.resolution,
            hits,
            free_from,
            free_to,
        )
        return cls(hits[:n_hits], free_from[:n_free], free_to[:n_free])

    @classmethod
    def of_scan(
        cls,
        ranges: ArrayLike,
        angle_min: float,
        angle_increment: float,
        map_T_laser: NDArray[np.float64],
        range_max: float,
        resolution: float,
    ) -> Rays:
        """Return the rays of a laser scan; see `OccupancyMapper.add_scan` for the arguments."""
        r = np.asarray(ranges, dtype=np.float64)
        angles = angle_min + angle_increment * np.arange(len(r))
        usable = (r > 0) & ~np.isnan(r)
        r, angles = r[usable], angles[usable]
        directions = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(len(r))])
        over_floor = (directions @ map_T_laser[:3, :3].T)[:, :2]
        origin = map_T_laser[:2, 3]
        is_hit = r < range_max
        free = np.where(is_hit, np.maximum(r - resolution, 0), range_max)
        return cls(
            hits_xy=origin + r[is_hit, np.newaxis] * over_floor[is_hit],
            free_from_xy=np.tile(origin, (len(r), 1)),
            free_to_xy=origin + free[:, np.newaxis] * over_floor,
        )

    def bounds(self) -> NDArray[np.float64] | None:
        """Return their lower left and upper right corner [m], shape (2, 2); None if empty."""
        every = (self.hits_xy, self.free_from_xy, self.free_to_xy)
        boxes = np.array([_box(points) for points in every if len(points)])
        if len(boxes) == 0:
            return None
        return np.array([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])

    def rasterize(self, grid: GridGeometry) -> tuple[NDArray[np.int64], BoolArray]:
        """Return the number of hits in each cell, and whether it is on a free segment.

        Returns:
            Two arrays of the grid's shape: int64 and bool.
        """
        to_cells = grid.to_cells_matrix()
        hits, free = np.zeros(grid.shape, dtype=np.int64), np.zeros(grid.shape, dtype=bool)
        _rasterize(hits, free, self.hits_xy, self.free_from_xy, self.free_to_xy, to_cells)
        return hits, free


@loop()
def _cast(
    points: NDArray[np.float32],
    map_T_camera: NDArray[np.float64],
    heights: tuple[float, float, float],
    max_range: float,
    resolution: float,
    hits: NDArray[np.float64],
    free_from: NDArray[np.float64],
    free_to: NDArray[np.float64],
) -> tuple[int, int]:
    """Fill in the arrays of `Rays` from an organized cloud.

    Args:
        points: in the camera's frame [m], NaN for no return, shape (H, W, 3).
        map_T_camera: pose of the camera, shape (4, 4).
        heights: min_height, max_height and free_below above the floor [m].
        max_range: largest distance of a point over the floor [m].
        resolution: a free segment ends so far before its hit, because hits are not exact [m].
        hits: filled in; space for one per point, shape (H * W, 2).
        free_from: filled in, likewise.
        free_to: filled in, likewise.

    Returns:
        The numbers of hits and of free segments.
    """
    T, (min_height, max_height, free_below) = map_T_camera, heights
    n_hits = n_free = 0
    for row in range(points.shape[0]):
        for col in range(points.shape[1]):
            x, y, z = points[row, col, 0], points[row, col, 1], points[row, col, 2]
            if not (z > 0 and np.isfinite(z)):
                continue
            dx = T[0, 0] * x + T[0, 1] * y + T[0, 2] * z
            dy = T[1, 0] * x + T[1, 1] * y + T[1, 2] * z
            height = T[2, 3] + T[2, 0] * x + T[2, 1] * y + T[2, 2] * z
            reach = np.sqrt(dx * dx + dy * dy)
            end = max_range
            if reach <= max_range and min_height <= height <= max_height:
                hits[n_hits, 0], hits[n_hits, 1] = T[0, 3] + dx, T[1, 3] + dy
                n_hits += 1
                end = reach - resolution
            low, high = _low_stretch(T[2, 3], height, -min_height, free_below)
            high = min(high, end / max(reach, 1e-9))
            if high > low:
                free_from[n_free, 0], free_from[n_free, 1] = T[0, 3] + low * dx, T[1, 3] + low * dy
                free_to[n_free, 0], free_to[n_free, 1] = T[0, 3] + high * dx, T[1, 3] + high * dy
                n_free += 1
    return n_hits, n_free


@inner_loop()
def _low_stretch(start: float, end: float, low: float, high: float) -> tuple[float, float]:
    """Return the part of a line between two heights, as shares of its length.

    Args:
        start: height at which the line begins [m].
        end: height at which it ends [m].
        low: the lower height [m].
        high: the upper height [m].

    Returns:
        Two shares in 0..1; the second is not larger than the first if there is no such part.
    """
    climb = end - start
    if abs(climb) < 1e-9:
        return 0.0, 1.0 if low <= start <= high else 0.0
    at_low, at_high = (low - start) / climb, (high - start) / climb
    return max(min(at_low, at_high), 0.0), min(max(at_low, at_high), 1.0)


@loop()
def _box(points_xy: NDArray[np.float64]) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the lower left and the upper right corner of some points."""
    xmin, ymin = xmax, ymax = points_xy[0, 0], points_xy[0, 1]
    for i in range(1, len(points_xy)):
        x, y = points_xy[i, 0], points_xy[i, 1]
        xmin, ymin, xmax, ymax = min(xmin, x), min(ymin, y), max(xmax, x), max(ymax, y)
    return (xmin, ymin), (xmax, ymax)


@loop()
def _rasterize(
    counts: NDArray[np.int64],
    marked: BoolArray,
    points_xy: NDArray[np.float64],
    begin_xy: NDArray[np.float64],
    end_xy: NDArray[np.float64],
    to_cells: NDArray[np.float64],
) -> None:
    """Count the points in each cell, and mark the cells under straight lines.

    Args:
        counts: zeros, shape (height, width); filled in.
        marked: all False, shape (height, width); filled in.
        points_xy: shape (N, 2).
        begin_xy: of the lines, shape (M, 2).
        end_xy: of the lines, shape (M, 2).
        to_cells: `GridGeometry.to_cells_matrix`.
    """
    height, width = counts.shape
    for i in range(len(points_xy)):
        x, y = _position(to_cells, points_xy[i, 0], points_xy[i, 1])
        col, row = int(np.floor(x)), int(np.floor(y))
        if 0 <= row < height and 0 <= col < width:
            counts[row, col] += 1
    for i in range(len(begin_xy)):
        x, y = _position(to_cells, begin_xy[i, 0], begin_xy[i, 1])
        end_x, end_y = _position(to_cells, end_xy[i, 0], end_xy[i, 1])
        dx, dy = end_x - x, end_y - y
        steps = int(np.ceil(max(abs(dx), abs(dy)))) + 1
        for step in range(steps + 1):
            col, row = int(np.floor(x + dx * step / steps)), int(np.floor(y + dy * step / steps))
            if 0 <= row < height and 0 <= col < width:
                marked[row, col] = True


@inner_loop()
def _position(to_cells: NDArray[np.float64], x: float, y: float) -> tuple[float, float]:
    """Return the column and row of a point (`GridGeometry.to_cells_matrix`), as floats."""
    return (
        to_cells[0, 0] * x + to_cells[0, 1] * y + to_cells[0, 2],
        to_cells[1, 0] * x + to_cells[1, 1] * y + to_cells[1, 2],
    )
