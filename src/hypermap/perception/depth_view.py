"""Where a frame's rays ended: how much of a place, and of the ground, it could see."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import cast

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap._loops import loop
from hypermap.core.arrays import FloatArray, IntArray
from hypermap.perception.frame import Camera, RgbdFrame

NEAREST = 0.05
"""Closer points are next to the camera, not in front of it [m]."""

_STEP = 4  # every n-th row and column of the depth image
_STEEP = 0.87  # sine of 60 degrees
_SAME_WAY = 1e-9  # columns within this angle all look the same way [rad]


@dataclass(frozen=True, eq=False)
class DepthView:
    """The ends of some of a frame's rays.

    Attributes:
        camera: intrinsics of the image of these rays.
        map_T_camera: pose of the camera's optical frame in the map, shape (4, 4).
        reach: horizontal distance from the camera to where each ray ended [m], float32, NaN for
            no return, shape (H, W).
        max_range: rays that end farther away are ignored in `ground` [m].
        every: it has every n-th row and column of the frame's view; 1 if it is that view.
    """

    camera: Camera
    map_T_camera: NDArray[np.float64]
    reach: NDArray[np.float32]
    max_range: float = np.inf
    every: int = 1

    @classmethod
    def of(cls, frame: RgbdFrame, max_range: float = np.inf) -> DepthView:
        """Return the view of a frame."""
        some = (slice(None, None, _STEP),) * 2
        z = frame.depth[some]
        camera = frame.camera.every(_STEP)
        x, y = _horizontal_rays(camera, frame.map_T_camera, np.arange(camera.height))
        reach = (z * np.sqrt(x * x + y * y)).astype(np.float32)
        return cls(camera, frame.map_T_camera, reach, max_range)

    @property
    def position(self) -> NDArray[np.float64]:
        """The camera's position in the map [m], shape (3,)."""
        return self.map_T_camera[:3, 3]

    def reach_towards(self, points_xyz: FloatArray) -> NDArray[np.float64]:
        """Return how far the rays through some points went.

        Args:
            points_xyz: points in the map frame [m], shape (N, 3).

        Returns:
            Horizontal distances from the camera [m], NaN outside the image and where the ray had
            no return, shape (N,).
        """
        points = (points_xyz - self.position) @ self.map_T_camera[:3, :3]
        K, (height, width) = self.camera.K, self.reach.shape
        ahead = points[:, 2] > NEAREST
        z = np.where(ahead, points[:, 2], 1.0)
        columns = np.rint(K[0, 0] * points[:, 0] / z + K[0, 2])
        rows = np.rint(K[1, 1] * points[:, 1] / z + K[1, 2])
        inside = ahead & (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
        reach = np.full(len(points), np.nan)
        reach[inside] = self.reach[rows[inside].astype(int), columns[inside].astype(int)]
        return reach

    @property
    def is_level(self) -> bool:
        """Whether the camera looks ahead rather than up or down, so that `ground` is meaningful."""
        return bool(abs(self.map_T_camera[2, 2]) < _STEEP)

    @cached_property
    def ground(self) -> BaseGeometry:
        """The ground that the rays passed over, up to the farthest ray of each image column.

        A polygon or multipolygon in the map frame [m]; empty if no ray returned. Unlike the hull of
        the points, it does not extend behind walls. It begins where the nearest of all rays ended;
        in columns without any return, it is the area nearer than that.
        """
        ring = ground_ring(self)
        if ring is None:
            return _ground_in_pieces(self)
        return cast("shapely.Polygon", shapely.polygons(ring)) if len(ring) else shapely.Polygon()


def ground_ring(view: DepthView) -> NDArray[np.float64] | None:
    """Return the closed ring of the `ground` of a view in the map frame [m], shape (P, 2).

    First come the ends of the rays, from one side of the image to the other, then the circle at
    which the ground begins, back again. There are no points if there is no ground; None if it needs
    to be put together of pieces.
    """
    width = view.camera.width
    ring, ends = np.empty((2 * width + 1, 2)), np.empty((2, width), np.float32)
    # A depth is compared as what it is: a float32.
    limit = np.float32(view.max_range)
    count = int(_fill_ground(view.reach, view.camera.K, view.map_T_camera, limit, ends, ring))
    return None if count < 0 else ring[:count]


@loop()
def _fill_ground(
    reach: NDArray[np.float32],
    K: NDArray[np.float64],
    map_T_camera: NDArray[np.float64],
    max_range: np.float32,
    ends: NDArray[np.float32],
    ring: NDArray[np.float64],
) -> int:
    """Do the work of `ground_ring`, and return the number of points, -1 for pieces.

    Args:
        reach: of the view, as its `K`, `map_T_camera` and `max_range`.
        K: likewise.
        map_T_camera: likewise.
        max_range: likewise.
        ends: room for how far the nearest and the farthest ray of each column went, shape (2, W).
        ring: filled, shape (2 W + 1, 2).
    """
    T, height, width = map_T_camera, int(reach.shape[0]), int(reach.shape[1])
    for col in range(width):
        ends[0, col], ends[1, col] = np.inf, 0
    for row in range(height):  # row by row, so that the compiler compares several columns at once
        for col in range(width):
            one = reach[row, col]
            is_return = (one > 0) & (one <= max_range) & (one < np.inf)
            ends[0, col] = min(ends[0, col], one if is_return else np.float32(np.inf))
            ends[1, col] = max(ends[1, col], one if is_return else np.float32(0))
    nearest, shown = np.inf, 0
    for col in range(width):
        nearest = min(nearest, np.float64(ends[0, col]))
        shown += ends[1, col] > 0
    if shown < 2:
        return 0
    is_whole, is_beyond = shown == width, False
    for col in range(width):
        is_beyond = is_beyond or ends[1, col] > nearest
        if 0 < col < width - 1 and ends[1, col] == nearest:
            is_whole = False
    if not (is_whole and is_beyond):
        return -1
    down = (height // 2 - K[1, 2]) / K[1, 1]
    x_before = y_before = 0.0
    for col in range(width):
        right = (col - K[0, 2]) / K[0, 0]
        x = T[0, 0] * right + T[0, 1] * down + T[0, 2]
        y = T[1, 0] * right + T[1, 1] * down + T[1, 2]
        length = np.hypot(x, y)
        x, y = x / length, y / length
        if col and abs(x_before * y - y_before * x) < _SAME_WAY:
            return 0
        x_before, y_before = x, y
        far, back = np.float64(ends[1, col]), 2 * width - 1 - col
        ring[col, 0], ring[col, 1] = T[0, 3] + far * x, T[1, 3] + far * y
        ring[back, 0], ring[back, 1] = T[0, 3] + nearest * x, T[1, 3] + nearest * y
    ring[2 * width, 0], ring[2 * width, 1] = ring[0, 0], ring[0, 1]
    return 2 * width + 1


def _ground_in_pieces(view: DepthView) -> BaseGeometry:
    """Return the ground of a view that shows it in some of its columns only."""
    is_return = (view.reach > 0) & (view.reach <= view.max_range) & (view.reach < np.inf)
    reach = np.where(is_return, view.reach, 0.0)
    middle = np.array([view.camera.height // 2])
    rays = _horizontal_rays(view.camera, view.map_T_camera, middle)[:, 0]
    directions = (rays / np.hypot(*rays)).T
    return _ground(directions, reach.max(axis=0), reach[reach > 0].min(), view.position[:2])


def _ground(
    directions: NDArray[np.float64],
    farthest: NDArray[np.float64],
    nearest: float,
    position: NDArray[np.float64],
) -> BaseGeometry:
    """Return the area between a circle and the ends of rays, for `DepthView.ground`.

    Args:
        directions: unit vectors of the image's columns on the floor, shape (W, 2).
        farthest: how far each went [m], 0 for no return, shape (W,).
        nearest: radius of the circle [m].
        position: its center, in the map frame [m], shape (2,).
    """
    turns = _cross(directions[:-1], directions[1:])
    if np.abs(turns).min() < _SAME_WAY:
        return shapely.Polygon()
    ends = position + farthest[:, np.newaxis] * directions
    begins = position + nearest * directions
    # Pieces begin and end at columns without a return, and at those with nothing between the
    # circle and the end.
    is_seen = (farthest[:-1] > 0) & (farthest[1:] > 0)
    is_end = (is_seen[1:] != is_seen[:-1]) | (farthest[1:-1] == nearest)
    bounds = [0, *(np.flatnonzero(is_end) + 1).tolist(), len(farthest) - 1]
    pieces = []
    for first, last in pairwise(bounds):
        columns = slice(first, last + 1)
        if not is_seen[first]:
            pieces.append(np.vstack([begins[columns], position]))
        elif (farthest[columns] > nearest).any():
            pieces.append(np.vstack([ends[columns], begins[columns][::-1]]))
    if not pieces:
        return shapely.Polygon()
    # Faster than the class.
    polygons = [cast("shapely.Polygon", shapely.polygons(piece)) for piece in pieces]
    return polygons[0] if len(polygons) == 1 else shapely.MultiPolygon(polygons)


def _cross(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the cross products of vectors in the plane, shape (N, 2) each."""
    return np.asarray(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0])


def _horizontal_rays(
    camera: Camera, map_T_camera: NDArray[np.float64], rows: IntArray
) -> NDArray[np.float64]:
    """Return x and y in the map of the rays of some rows at a depth of 1 m, shape (2, rows, W)."""
    K, rotation = camera.K, map_T_camera[:2, :3]
    right = ((np.arange(camera.width) - K[0, 2]) / K[0, 0])[np.newaxis, :]
    down = ((rows - K[1, 2]) / K[1, 1])[:, np.newaxis]
    return np.stack([axis[0] * right + axis[1] * down + axis[2] for axis in rotation])
