"""Compiled search for the few of many points that can lie on their outline, seen from above."""

from __future__ import annotations

import math

import numpy as np
from numba import uint64
from numpy.typing import NDArray

from hypermap._loops import inner_loop, loop
from hypermap.core.arrays import BoolArray, FloatArray
from hypermap.perception.frame import RgbdFrame
from hypermap.perception.projection import Rows, fill_row, rows_of

DIRECTIONS = 16  # in which the farthest of some points are looked for
SOME = 1000  # of the points are looked at for these
TINY = 1e-6  # more than what float64 may be off, at these distances [m]
ROUNDING = 1e-3  # more than what float32 may be off, at a camera's distances [m]

_ANGLES = np.arange(DIRECTIONS) * (2 * np.pi / DIRECTIONS)


def outer_points(
    frame: RgbdFrame,
    valid: BoolArray,
    map_T_camera: NDArray[np.float64],
    voxel_size: float,
    step: int = 1,
) -> NDArray[np.float32]:
    """Return the points of a frame that can make a difference to their footprint.

    Left out is what lies so deep within a polygon of points that its whole cell of the floor's grid
    lies within the hull of the other cells' centroids.

    Args:
        frame: depth or points, and intrinsics.
        valid: which of its pixels hold a point, shape (H, W).
        map_T_camera: pose of the optical frame, shape (4, 4).
        voxel_size: side of the footprint's cells [m].
        step: every n-th row and column of the image counts.

    Returns:
        Points in the optical frame [m], row by row, shape (M, 3).
    """
    rows, some = rows_of(frame, step), np.ascontiguousarray(valid[::step, ::step])
    to_floor = map_T_camera[:2, :3].astype(np.float32)
    x, y = _sample(rows, some, to_floor)
    # A centroid may lie a diagonal from a point of its cell: once for the polygon's corner, once
    # for the point in question.
    margin = 2 * math.sqrt(2) * voxel_size + ROUNDING
    outer: NDArray[np.float32] = _outside(rows, some, to_floor, _inner(x, y, margin))
    return outer


def outer_xy(points_xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the points in the plane that can be corners of their hull [m], shape (M, 2)."""
    x, y = np.ascontiguousarray(points_xy.T)
    outer: NDArray[np.float64] = points_xy[_far_out(x, y, _inner(x, y, TINY)) > 0]
    return outer


def _inner(x: FloatArray, y: FloatArray, margin: float) -> FloatArray:
    """Return the edges of a polygon of some of the points, as `_edges` does."""
    along, across = np.cos(_ANGLES).astype(x.dtype), np.sin(_ANGLES).astype(x.dtype)
    corners = _farthest(x, y, along, across)
    edges: FloatArray = _edges(corners.astype(np.float64), margin).astype(x.dtype)
    return edges


@loop()
def _sample(
    rows: Rows, valid: BoolArray, to_floor: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return x and y on the floor of some of the points, shape (N,) each."""
    height, width = valid.shape
    sparse = max(int(np.sqrt(height * width / SOME)), 1)
    some_x, some_y = np.empty(valid.size, np.float32), np.empty(valid.size, np.float32)
    points = np.empty((3, width), np.float32)
    count = 0
    for row in range(0, height, sparse):
        fill_row(rows, row, points)
        x, y = _on_floor(points, to_floor)
        for column in range(0, width, sparse):
            if valid[row, column]:
                some_x[count], some_y[count] = x[column], y[column]
                count += 1
    return some_x[:count], some_y[:count]


@loop()
def _outside(
    rows: Rows, valid: BoolArray, to_floor: NDArray[np.float32], edges: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return the points that do not lie within all edges, shape (M, 3)."""
    height, width = valid.shape
    outer = np.empty((height * width, 3), np.float32)
    points = np.empty((3, width), np.float32)
    count = 0
    for row in range(height):
        fill_row(rows, row, points)
        x, y = _on_floor(points, to_floor)
        distances = _far_out(x, y, edges)
        for column in range(width):
            if valid[row, column] and distances[column] > 0:
                for axis in range(3):
                    outer[count, axis] = points[axis, column]
                count += 1
    return outer[:count]


@inner_loop()
def _on_floor(points, to_floor):  # type: ignore[no-untyped-def]
    """Return x and y on the floor of points, shape (3, N)."""
    x, y = np.empty(points.shape[1], np.float32), np.empty(points.shape[1], np.float32)
    for i in range(uint64(len(x))):
        px, py, pz = points[0, i], points[1, i], points[2, i]
        x[i] = to_floor[0, 0] * px + to_floor[0, 1] * py + to_floor[0, 2] * pz
        y[i] = to_floor[1, 0] * px + to_floor[1, 1] * py + to_floor[1, 2] * pz
    return x, y


@loop()
def _farthest(x: FloatArray, y: FloatArray, along: FloatArray, across: FloatArray) -> FloatArray:
    """Return which points are the farthest in some directions, counterclockwise, shape (K, 2).

    Args:
        x: of the points, shape (N,).
        y: of the points, shape (N,).
        along: cosines of the directions, shape (K,).
        across: their sines, shape (K,).
    """
    corners, farthest = np.empty((DIRECTIONS, 2), x.dtype), np.empty(DIRECTIONS, x.dtype)
    for k in range(DIRECTIONS):
        corners[k, 0] = corners[k, 1] = 0
        farthest[k] = -np.inf
    for i in range(len(x)):
        for k in range(DIRECTIONS):
            distance = along[k] * x[i] + across[k] * y[i]
            if distance > farthest[k]:
                farthest[k] = distance
                corners[k, 0], corners[k, 1] = x[i], y[i]
    return corners


@loop()
def _edges(corners: NDArray[np.float64], margin: float) -> NDArray[np.float64]:
    """Return a, b, c of a x + b y + c, which is the distance outwards from each edge [m].

    Args:
        corners: of a polygon, counterclockwise, shape (K, 2).
        margin: by how much each edge is moved inwards [m].

    Returns:
        Shape (K, 3); such that nothing lies within if the corners are no polygon.
    """
    edges = np.empty((DIRECTIONS, 3))
    count = 0
    for k in range(DIRECTIONS):
        x, y = corners[k, 0], corners[k, 1]
        dx, dy = corners[(k + 1) % DIRECTIONS, 0] - x, corners[(k + 1) % DIRECTIONS, 1] - y
        length = np.hypot(dx, dy)
        edges[k, 0], edges[k, 1], edges[k, 2] = 0, 0, -np.inf
        if length > 0:
            a, b = dy / length, -dx / length
            edges[k, 0], edges[k, 1], edges[k, 2] = a, b, margin - a * x - b * y
            count += 1
    for k in range(DIRECTIONS if count < 3 else 0):
        edges[k, 0], edges[k, 1], edges[k, 2] = 0, 0, np.inf
    return edges


@loop(fastmath={"contract"})
def _far_out(x, y, edges):  # type: ignore[no-untyped-def]
    """Return how far points are outside of the edge that they are farthest from, shape (N,)."""
    distances = np.empty_like(x)
    for i in range(uint64(len(x))):
        farthest = edges[0, 0] * x[i] + edges[0, 1] * y[i] + edges[0, 2]
        for k in range(1, DIRECTIONS):
            distance = edges[k, 0] * x[i] + edges[k, 1] * y[i] + edges[k, 2]
            farthest = distance if distance > farthest else farthest
        distances[i] = farthest
    return distances
