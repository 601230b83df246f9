"""The points of a depth image, and transforms of points."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numba import uint64
from numpy.typing import NDArray

from hypermap._loops import inner_loop, loop
from hypermap.core.arrays import IntArray

_Array: TypeAlias = NDArray[np.float32]

# Columns and rows relative to the principal point [pixels], and per focal length in each direction.
_Rays: TypeAlias = tuple[_Array, _Array, np.float32, np.float32]

# What `fill_row` needs to know of a frame: the cloud, empty unless recorded, depth and rays.
Rows: TypeAlias = tuple[_Array, _Array, _Array, _Array, np.float32, np.float32]


def project(
    depth: NDArray[np.float32], K: NDArray[np.float64], step: int = 1
) -> NDArray[np.float32]:
    """Return the organized cloud of a depth image in the camera's optical frame.

    Args:
        depth: meters along the optical axis, float32, shape (H, W).
        K: intrinsic matrix [pixels], shape (3, 3).
        step: every n-th row and column is projected.

    Returns:
        Points [m], float32, shape (H, W, 3), or fewer rows and columns.

    Source: depth_image_proc's order of operations, so that the points are the same to the last
    bit; then neighbors at equal distance, common on flat surfaces, rank the same.
    """
    rays = _rays(K, np.arange(0, depth.shape[0], step), np.arange(0, depth.shape[1], step))
    some = np.ascontiguousarray(depth[::step, ::step])
    points = np.empty((*some.shape, 3), np.float32)
    _project(some, *rays, points)
    return points


def project_pixels(
    depth: NDArray[np.float32], K: NDArray[np.float64], pixels: IntArray
) -> NDArray[np.float32]:
    """Return the points of some pixels, the same as in the cloud of the whole image.

    Args:
        depth: meters along the optical axis, float32, shape (H, W).
        K: intrinsic matrix [pixels], shape (3, 3).
        pixels: row-major indices, shape (N,).

    Returns:
        Points [m], float32, shape (N, 3).
    """
    rays = _rays(K, np.arange(depth.shape[0]), np.arange(depth.shape[1]))
    points = np.empty((len(pixels), 3), np.float32)
    _project_pixels(np.ascontiguousarray(depth).ravel(), pixels, *rays, points)
    return points


def rows_of(
    depth: _Array, K: NDArray[np.float64], cloud: _Array | None = None, step: int = 1
) -> Rows:
    """Return the arguments of `fill_row`, which computes a frame's points row by row.

    Args:
        depth: meters along the optical axis, shape (H, W).
        K: intrinsic matrix [pixels], shape (3, 3).
        cloud: recorded points [m], shape (H, W, 3), instead of those from depth; None for none.
        step: every n-th row and column of the image counts.
    """
    some = depth[::step, ::step]
    points = some[:0, :0, np.newaxis] if cloud is None else cloud[::step, ::step]
    height, width = depth.shape
    rays = _rays(K, np.arange(0, height, step), np.arange(0, width, step))
    return np.ascontiguousarray(points), np.ascontiguousarray(some), *rays


@inner_loop()
def fill_row(rows: Rows, row: int, points: NDArray[np.float32]) -> None:
    """Write the points of a row of the image, the same as in the cloud of the whole image.

    Args:
        rows: as `rows_of` returns it.
        row: among every `step`-th row.
        points: receives x, y and z, shape (3, W).
    """
    cloud, depth, right_of_axis, below_axis, per_fx, per_fy = rows
    if len(cloud) > 0:
        for axis in range(3):
            for column in range(points.shape[1]):
                points[axis, column] = cloud[row, column, axis]
    else:
        x, y, z, d = points[0], points[1], points[2], depth[row]
        below = below_axis[row]
        for i in range(uint64(len(d))):
            z[i] = d[i]
            x[i] = right_of_axis[i] * d[i] * per_fx
            y[i] = below * d[i] * per_fy


def transform(a_T_b: NDArray[np.float64], points: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return points given in frame b, shape (N, 3), as points in frame a.

    The same as `transform_points` to the last bit, but faster for many points.
    """
    moved = np.empty((3, len(points)), np.float32)  # each axis is contiguous
    _transform(a_T_b.astype(np.float32), points, moved)
    return moved.T


def _rays(K: NDArray[np.float64], rows: IntArray, columns: IntArray) -> _Rays:
    right_of_axis, below_axis = columns - K[0, 2], rows - K[1, 2]
    per_fx, per_fy = np.float32(1 / K[0, 0]), np.float32(1 / K[1, 1])
    return right_of_axis.astype(np.float32), below_axis.astype(np.float32), per_fx, per_fy


@loop()
def _project(
    depth: NDArray[np.float32],
    right_of_axis: NDArray[np.float32],
    below_axis: NDArray[np.float32],
    per_fx: np.float32,
    per_fy: np.float32,
    points: NDArray[np.float32],
) -> None:
    height, width = depth.shape
    for row in range(height):
        for column in range(width):
            z = depth[row, column]
            points[row, column, 0] = right_of_axis[column] * z * per_fx
            points[row, column, 1] = below_axis[row] * z * per_fy
            points[row, column, 2] = z


@loop()
def _project_pixels(
    flat: NDArray[np.float32],
    pixels: IntArray,
    right_of_axis: NDArray[np.float32],
    below_axis: NDArray[np.float32],
    per_fx: np.float32,
    per_fy: np.float32,
    points: NDArray[np.float32],
) -> None:
    width = len(right_of_axis)
    row = first = 0
    for i in range(len(pixels)):
        pixel = pixels[i]
        if not 0 <= pixel - first < width:  # rare: pixels come row by row
            row = pixel // width
            first = row * width
        column = pixel - first
        z = flat[pixel]
        points[i, 0] = right_of_axis[column] * z * per_fx
        points[i, 1] = below_axis[row] * z * per_fy
        points[i, 2] = z


@loop()
def _transform(
    a_T_b: NDArray[np.float32], points: NDArray[np.float32], moved: NDArray[np.float32]
) -> None:
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        for axis in range(3):
            to_x, to_y, to_z = a_T_b[axis, 0], a_T_b[axis, 1], a_T_b[axis, 2]
            moved[axis, i] = x * to_x + y * to_y + z * to_z + a_T_b[axis, 3]
