"""The points of a depth image."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray


def project(depth: NDArray[np.float32], K: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return the organised cloud of a depth image in the camera's optical frame.

    Args:
        depth: metres along the optical axis, float32, shape (H, W).
        K: intrinsic matrix [pixels], shape (3, 3).

    Returns:
        Points [m], float32, shape (H, W, 3).

    Source: depth_image_proc's order of operations, so that the points are the same to the last
    bit; neighbours at equal distance, common on flat surfaces, then rank alike.
    """
    height, width = depth.shape
    right_of_axis = (np.arange(width) - K[0, 2]).astype(np.float32)
    below_axis = (np.arange(height) - K[1, 2]).astype(np.float32)
    return _project(
        np.ascontiguousarray(depth),
        right_of_axis,
        below_axis,
        np.float32(1 / K[0, 0]),
        np.float32(1 / K[1, 1]),
    )


@njit(cache=True)
def _project(
    depth: NDArray[np.float32],
    right_of_axis: NDArray[np.float32],
    below_axis: NDArray[np.float32],
    per_fx: np.float32,
    per_fy: np.float32,
) -> NDArray[np.float32]:
    height, width = depth.shape
    points = np.empty((height, width, 3), np.float32)
    for row in range(height):
        for column in range(width):
            z = depth[row, column]
            points[row, column, 0] = right_of_axis[column] * z * per_fx
            points[row, column, 1] = below_axis[row] * z * per_fy
            points[row, column, 2] = z
    return points
