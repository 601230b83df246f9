"""Compiled search for the few points of a cloud that can lie on its outline, seen from above."""

from __future__ import annotations

import numpy as np
from numba import njit, uint64
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray

DIRECTIONS = 16  # in which the farthest of some points are looked for
SOME = 4000  # of the points are looked at for these
ROUNDING = 1e-3  # more than what float32 may be off, at a camera's distances [m]


def outer_points(
    points: NDArray[np.float32],
    valid: BoolArray,
    map_T_camera: NDArray[np.float64],
    voxel_size: float,
) -> NDArray[np.float32]:
    """Return the points of an image that can make a difference to their footprint.

    Left out is what lies so deep within a polygon of points that its whole cell of the floor's grid
    lies within the hull of the other cells' centroids.

    Args:
        points: organised cloud in the optical frame [m], shape (H, W, 3).
        valid: which of its pixels hold a point, shape (H, W).
        map_T_camera: pose of the optical frame, shape (4, 4).
        voxel_size: side of the footprint's cells [m].

    Returns:
        Points in the optical frame [m], row by row, shape (M, 3).
    """
    to_floor = map_T_camera[:2, :3].astype(np.float32)
    edges = _edges(_corners(points, valid, to_floor))
    # A centroid may lie a diagonal from a point of its cell: once for the polygon's corner, once
    # for the point in question.
    edges[:, 2] += 2 * np.sqrt(2) * voxel_size + ROUNDING
    return np.asarray(_outside(points, valid, to_floor, edges.astype(np.float32)))


@njit(cache=True)
def _corners(
    points: NDArray[np.float32], valid: BoolArray, to_floor: NDArray[np.float32]
) -> NDArray[np.float64]:
    """Return which of some points are the farthest in some directions, counterclockwise."""
    height, width = valid.shape
    angles = np.arange(DIRECTIONS) * (2 * np.pi / DIRECTIONS)
    along, across = np.cos(angles), np.sin(angles)
    farthest = np.full(DIRECTIONS, -np.inf)
    corners = np.zeros((DIRECTIONS, 2))
    sparse = max(int(np.sqrt(height * width / SOME)), 1)
    for row in range(0, height, sparse):
        for column in range(0, width, sparse):
            if valid[row, column]:
                x = y = np.float32(0)
                for axis in range(3):
                    x += to_floor[0, axis] * points[row, column, axis]
                    y += to_floor[1, axis] * points[row, column, axis]
                for k in range(DIRECTIONS):
                    distance = along[k] * x + across[k] * y
                    if distance > farthest[k]:
                        farthest[k] = distance
                        corners[k, 0], corners[k, 1] = x, y
    return corners


def _edges(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a, b, c of a x + b y + c, which is the distance outwards from each edge [m]."""
    following = np.roll(corners, -1, axis=0)
    sides = following - corners
    lengths = np.hypot(*sides.T)
    is_edge = lengths > 0
    if np.count_nonzero(is_edge) < 3:
        return np.array([[0.0, 0.0, np.inf]])  # nothing lies within
    normals = np.stack([sides[:, 1], -sides[:, 0]], axis=1)[is_edge] / lengths[is_edge, np.newaxis]
    distances = -np.sum(normals * corners[is_edge], axis=1)
    return np.column_stack([normals, distances])


@njit(cache=True, error_model="numpy")
def _outside(points, valid, to_floor, edges):  # type: ignore[no-untyped-def]
    """Return the points that do not lie within all edges, shape (M, 3)."""
    height, width = valid.shape
    outer = np.empty((height * width, 3), np.float32)
    farthest = np.empty(width, np.float32)
    count = 0
    x, y = np.empty(width, np.float32), np.empty(width, np.float32)
    for row in range(height):
        for i in range(uint64(width)):
            px, py, pz = points[row, i, 0], points[row, i, 1], points[row, i, 2]
            x[i] = to_floor[0, 0] * px + to_floor[0, 1] * py + to_floor[0, 2] * pz
            y[i] = to_floor[1, 0] * px + to_floor[1, 1] * py + to_floor[1, 2] * pz
        farthest[:] = -np.inf
        for edge in range(len(edges)):
            a, b, c = edges[edge, 0], edges[edge, 1], edges[edge, 2]
            for i in range(uint64(width)):
                distance = a * x[i] + b * y[i] + c
                farthest[i] = distance if distance > farthest[i] else farthest[i]
        for i in range(width):
            if valid[row, i] and farthest[i] > 0:
                for axis in range(3):
                    outer[count, axis] = points[row, i, axis]
                count += 1
    return outer[:count]
