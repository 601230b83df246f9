"""Depth images and laser scans as rays over the floor, and the cells that such rays touch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from hypermap.core.arrays import BoolArray, FloatArray
from hypermap.core.grid import GridGeometry
from hypermap.mapping.config import OccupancyConfig
from hypermap.perception.frame import RgbdFrame


@dataclass(frozen=True, eq=False)
class Rays:
    """What rays say about the floor: where they hit something, and which stretch they show free.

    Attributes:
        hits_xy: points that block, in the map [m], shape (N, 2).
        free_from_xy: where the free stretches begin [m], shape (M, 2).
        free_to_xy: where they end [m], shape (M, 2).
    """

    hits_xy: NDArray[np.float64]
    free_from_xy: NDArray[np.float64]
    free_to_xy: NDArray[np.float64]

    @classmethod
    def of_depth(cls, frame: RgbdFrame, config: OccupancyConfig) -> Rays:
        """Return the rays of a depth image.

        A point between `min_height` and `max_height` above the floor is a hit. A ray shows free
        only the stretch on which it runs between the floor and `free_below`: that a ray passes
        high over a cell says nothing of the table below it.
        """
        step = config.pixel_step
        points = frame.points()[::step, ::step].reshape(-1, 3)
        points = points[np.isfinite(points[:, 2])]
        rotation, camera = frame.map_T_camera[:3, :3], frame.map_T_camera[:3, 3]
        rays = points.astype(np.float64) @ rotation.T
        heights, ranges = camera[2] + rays[:, 2], np.hypot(rays[:, 0], rays[:, 1])

        is_near = ranges <= config.max_range
        is_hit = is_near & (heights >= config.min_height) & (heights <= config.max_height)
        begin, end = _low_stretch(camera[2], heights, -config.min_height, config.free_below)
        # The last stretch before a hit, one cell long, is not free: hits are never quite exact.
        reach = np.where(is_hit, ranges - config.resolution, config.max_range)
        end = np.minimum(end, reach / np.maximum(ranges, 1e-9))
        is_free = end > begin
        over_floor = rays[is_free, :2]
        return cls(
            hits_xy=camera[:2] + rays[is_hit, :2],
            free_from_xy=camera[:2] + begin[is_free, np.newaxis] * over_floor,
            free_to_xy=camera[:2] + end[is_free, np.newaxis] * over_floor,
        )

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
        """Return the rays of a laser scan; `OccupancyMapper.add_scan` says what they mean."""
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
            free_from_xy=np.broadcast_to(origin, (len(r), 2)),
            free_to_xy=origin + free[:, np.newaxis] * over_floor,
        )

    def bounds(self) -> NDArray[np.float64] | None:
        """Return the lower left and upper right corner of all [m], shape (2, 2); None if empty."""
        points = np.concatenate([self.hits_xy, self.free_from_xy, self.free_to_xy])
        return np.array([points.min(axis=0), points.max(axis=0)]) if len(points) else None

    def touch(self, grid: GridGeometry) -> tuple[NDArray[np.int64], BoolArray]:
        """Return how often each cell is hit, and whether it is on a free stretch.

        Returns:
            Two arrays of the grid's shape.
        """
        rows, cols = grid.cells_at(self.hits_xy).T
        on_grid = grid.contains(rows, cols)
        hit_cells = rows[on_grid] * grid.width + cols[on_grid]
        hits = np.bincount(hit_cells, minlength=grid.height * grid.width).reshape(grid.shape)
        matrix = grid.to_cells_matrix()
        begin = self.free_from_xy @ matrix[:2, :2].T + matrix[:2, 2]
        end = self.free_to_xy @ matrix[:2, :2].T + matrix[:2, 2]
        free = np.zeros(grid.shape, dtype=bool)
        _mark_lines(free, begin, end)
        return hits, free


def _low_stretch(
    start: float, ends: FloatArray, low: float, high: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return from where to where a line runs between two heights, as shares of its length.

    Args:
        start: height at which all lines begin [m].
        ends: heights at which they end [m], shape (N,).
        low: the lower height [m].
        high: the upper height [m].

    Returns:
        Two arrays (N,) in 0..1; the second is not above the first where there is no such stretch.
    """
    climb = ends - start
    level = np.abs(climb) < 1e-9
    safe = np.where(level, 1.0, climb)
    at_low, at_high = (low - start) / safe, (high - start) / safe
    begin = np.clip(np.minimum(at_low, at_high), 0, 1)
    end = np.clip(np.maximum(at_low, at_high), 0, 1)
    inside = low <= start <= high
    return np.where(level, 0.0, begin), np.where(level, float(inside), end)


@njit(cache=True)
def _mark_lines(marked: BoolArray, begin: NDArray[np.float64], end: NDArray[np.float64]) -> None:
    """Mark the cells under straight lines, given in cells as (col, row), shapes (M, 2)."""
    height, width = marked.shape
    for i in range(len(begin)):
        dx, dy = end[i, 0] - begin[i, 0], end[i, 1] - begin[i, 1]
        steps = int(np.ceil(max(abs(dx), abs(dy)))) + 1
        for step in range(steps + 1):
            col = int(np.floor(begin[i, 0] + dx * step / steps))
            row = int(np.floor(begin[i, 1] + dy * step / steps))
            if 0 <= row < height and 0 <= col < width:
                marked[row, col] = True
