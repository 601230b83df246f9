"""Compiled search for the few of many points that can be on their outline, seen from above."""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numba import uint64
from numpy.typing import NDArray

from hypermap._loops import inner_loop, loop
from hypermap.core.arrays import BoolArray
from hypermap.perception.frame import RgbdFrame
from hypermap.perception.projection import Rows, fill_row, rows_of

DIRECTIONS = 16  # in which we search for the farthest points
SOME = 1000  # points to search
ROUNDING = 1e-3  # more than the error of float32 at a camera's distances [m]

_Array: TypeAlias = NDArray[np.float32]

_ANGLES = np.arange(DIRECTIONS) * (2 * np.pi / DIRECTIONS)
_ALONG, _ACROSS = np.cos(_ANGLES).astype(np.float32), np.sin(_ANGLES).astype(np.float32)


def outer_points(
    frame: RgbdFrame,
    valid: BoolArray,
    map_T_camera: NDArray[np.float64],
    voxel_size: float,
    step: int = 1,
) -> NDArray[np.float32]:
    """Return the points of a frame that can affect their footprint.

    Omitted are points so deep inside a polygon of points that their whole cell of the floor's grid
    is within the hull of the other cells' centroids.

    Args:
        frame: depth or points, and intrinsics.
        valid: which of its pixels have a point, shape (H, W).
        map_T_camera: pose of the optical frame, shape (4, 4).
        voxel_size: side of the footprint's cells [m].
        step: every n-th row and column of the image counts.

    Returns:
        Points in the optical frame [m], row by row, shape (M, 3).
    """
    rows = rows_of(frame.depth, frame.camera.K, frame.cloud, step)
    some = np.ascontiguousarray(valid[::step, ::step])
    to_floor = map_T_camera[:2, :3].astype(np.float32)
    # A centroid may be a diagonal away from a point of its cell: once for the polygon's corner,
    # once for the point in question.
    edges = _edges(*_sample(rows, some, to_floor), 2 * math.sqrt(2) * voxel_size + ROUNDING)
    width, outer = some.shape[1], np.empty((some.size, 3), np.float32)
    count = _find_outside(
        rows,
        some,
        to_floor,
        edges,
        points=np.empty((3, width), np.float32),
        x=np.empty(width, np.float32),
        y=np.empty(width, np.float32),
        distances=np.empty(width, np.float32),
        outer=outer,
    )
    return outer[:count]


def outer_xy(points_xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the points in the plane that can be corners of their hull [m], shape (M, 2)."""
    # Relative to the first one, so that float32 is precise anywhere.
    x, y = np.ascontiguousarray((points_xy - points_xy[:1]).T, np.float32)
    distances = np.empty_like(x)
    _measure(x, y, _edges(x, y, ROUNDING), distances)
    return np.asarray(points_xy[distances > 0])


def _edges(x: _Array, y: _Array, margin: float) -> _Array:
    """Return the edges of the polygon of the points that are the farthest in some directions.

    Args:
        x: of the points, shape (N,).
        y: of the points, shape (N,).
        margin: how far each edge is moved inward [m].

    Returns:
        a, b, c of a x + b y + c, the outward distance from each edge [m], shape (K, 3);
        if there is no polygon, such that no point is inside.
    """
    edges = np.zeros((DIRECTIONS, 3), np.float32)
    farthest, most = np.zeros(DIRECTIONS, np.int64), np.full(DIRECTIONS, -np.inf, np.float32)
    if len(x) == 0 or _fill_edges(x, y, _ALONG, _ACROSS, margin, most, farthest, edges) < 3:
        edges[:] = 0, 0, np.inf
    return edges


@loop()
def _fill_edges(x, y, along, across, margin, most, farthest, edges):  # type: ignore[no-untyped-def]
    """Fill in the edges and the points that they begin at; return how many have a length."""
    for i in range(len(x)):
        for k in range(DIRECTIONS):
            distance = along[k] * x[i] + across[k] * y[i]
            if distance > most[k]:
                most[k], farthest[k] = distance, i
    count = 0
    for k in range(DIRECTIONS):
        i, j = farthest[k], farthest[(k + 1) % DIRECTIONS]
        at_x, at_y = np.float64(x[i]), np.float64(y[i])
        dx, dy = np.float64(x[j]) - at_x, np.float64(y[j]) - at_y
        length = math.sqrt(dx * dx + dy * dy)
        edges[k, 2] = -np.inf  # less than any real distance
        if length > 0:
            a, b = dy / length, -dx / length
            edges[k, 0], edges[k, 1], edges[k, 2] = a, b, margin - a * at_x - b * at_y
            count += 1
    return count


def _sample(rows: Rows, valid: BoolArray, to_floor: _Array) -> tuple[_Array, _Array]:
    """Return x and y on the floor of some of the points, shape (N,) each."""
    cloud, depth, right_of_axis, below_axis, per_fx, per_fy = rows
    sparse = max(int(math.sqrt(valid.size / SOME)), 1)
    row, column = (places * sparse for places in np.nonzero(valid[::sparse, ::sparse]))
    if len(cloud) > 0:
        x, y, z = cloud[row, column].T
    else:
        z = depth[row, column]
        x, y = right_of_axis[column] * z * per_fx, below_axis[row] * z * per_fy
    over, up = to_floor
    return over[0] * x + over[1] * y + over[2] * z, up[0] * x + up[1] * y + up[2] * z


@loop()
def _find_outside(rows, valid, to_floor, edges, points, x, y, distances, outer):  # type: ignore[no-untyped-def]
    """Find the points that are not inside all edges, and return how many there are.

    Args:
        rows: as `rows_of` returns it.
        valid: which pixels have a point, shape (H, W).
        to_floor: rotates points so that x and y are on the floor, shape (2, 3).
        edges: as `_edges` returns them.
        points: buffer for a row, shape (3, W).
        x: likewise, shape (W,).
        y: likewise, shape (W,).
        distances: likewise, shape (W,).
        outer: receives the points, shape (H * W, 3).
    """
    count = 0
    for row in range(valid.shape[0]):
        fill_row(rows, row, points)
        _put_on_floor(points, to_floor, x, y)
        _measure(x, y, edges, distances)
        for column in range(valid.shape[1]):
            if valid[row, column] and distances[column] > 0:
                for axis in range(3):
                    outer[count, axis] = points[axis, column]
                count += 1
    return count


@inner_loop()
def _put_on_floor(points, to_floor, x, y):  # type: ignore[no-untyped-def]
    """Fill in x and y on the floor of points, shape (3, N)."""
    for i in range(uint64(len(x))):
        px, py, pz = points[0, i], points[1, i], points[2, i]
        x[i] = to_floor[0, 0] * px + to_floor[0, 1] * py + to_floor[0, 2] * pz
        y[i] = to_floor[1, 0] * px + to_floor[1, 1] * py + to_floor[1, 2] * pz


@loop(fastmath={"contract"}, forceinline=True)
def _measure(x, y, edges, distances):  # type: ignore[no-untyped-def]
    """Fill in how far points are outside the edge that they are farthest from, shape (N,)."""
    for i in range(uint64(len(x))):
        farthest = edges[0, 0] * x[i] + edges[0, 1] * y[i] + edges[0, 2]
        for k in range(1, DIRECTIONS):
            distance = edges[k, 0] * x[i] + edges[k, 1] * y[i] + edges[k, 2]
            farthest = distance if distance > farthest else farthest
        distances[i] = farthest
