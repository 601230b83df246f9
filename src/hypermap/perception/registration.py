"""Depth registration: a depth image as the color camera would have measured it.

Boxes are found in the color image. If depth comes from another camera, the same pixel of both shows
different places, and a box cuts the wrong points out of the depth.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hypermap._loops import loop
from hypermap.core.trajectory import compose, invert
from hypermap.perception.frame import Camera
from hypermap.perception.projection import project

_MORE = 0.25  # pixels by which to enlarge a point on each side, so that slopes have no gaps


@dataclass(frozen=True, eq=False)
class Registration:
    """Where the color camera is, as seen from the depth camera.

    Attributes:
        camera: intrinsics of the color images.
        color_T_depth: pose of the depth camera's optical frame in the color camera's, shape (4, 4).
    """

    camera: Camera
    color_T_depth: NDArray[np.float64]

    def depth(
        self,
        depth: NDArray[np.float32],
        camera: Camera,
        cloud: NDArray[np.float32] | None = None,
    ) -> NDArray[np.float32]:
        """Return the depth in each pixel of the color image.

        Each point covers the area of its pixel as seen from the color camera; of several
        points in a pixel, the nearest counts.

        Args:
            depth: as the depth camera measured it [m], float32, NaN for no return, shape (H, W).
            camera: intrinsics of the depth camera.
            cloud: its points [m], shape (H, W, 3), if they differ from those of `depth`.

        Returns:
            Meters along the color camera's optical axis, float32, NaN where it sees none of the
            points, in the color image's shape.

        Source: `register.cpp` of ROS's depth_image_proc, with `fill_upsampling_holes`.
        """
        points_xyz = project(depth, camera.K) if cloud is None else cloud
        registered = np.full((self.camera.height, self.camera.width), np.inf, np.float32)
        _splat(
            np.ascontiguousarray(points_xyz, np.float32).reshape(-1, 3),
            0.5 / camera.K[0, 0],
            0.5 / camera.K[1, 1],
            np.ascontiguousarray(self.color_T_depth, np.float64),
            np.ascontiguousarray(self.camera.K, np.float64),
            registered,
        )
        registered[np.isinf(registered)] = np.nan
        return registered

    def pose(self, map_T_depth: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the pose of the color camera, shape (4, 4), given that of the depth camera."""
        return compose(map_T_depth, invert(self.color_T_depth))


@loop()
def _splat(
    points_xyz: NDArray[np.float32],
    half_x: float,
    half_y: float,
    color_T_depth: NDArray[np.float64],
    K: NDArray[np.float64],
    registered: NDArray[np.float32],
) -> None:
    """Write the depth of points into an image of infinities, the nearest last."""
    height, width = registered.shape
    T = color_T_depth
    for i in range(len(points_xyz)):
        x, y, z = points_xyz[i, 0], points_xyz[i, 1], points_xyz[i, 2]
        if not 0 < z < math.inf:
            continue
        depth = T[2, 0] * x + T[2, 1] * y + T[2, 2] * z + T[2, 3]
        if not depth > 0:
            continue
        left, right, top, bottom = math.inf, -math.inf, math.inf, -math.inf
        for corner in range(4):  # of the area of the point's pixel at its depth
            at_x = x + (half_x if corner & 1 else -half_x) * z
            at_y = y + (half_y if corner & 2 else -half_y) * z
            there = T[2, 0] * at_x + T[2, 1] * at_y + T[2, 2] * z + T[2, 3]
            if there <= 0:
                there = depth
            column = (T[0, 0] * at_x + T[0, 1] * at_y + T[0, 2] * z + T[0, 3]) / there
            row = (T[1, 0] * at_x + T[1, 1] * at_y + T[1, 2] * z + T[1, 3]) / there
            column, row = K[0, 0] * column + K[0, 2], K[1, 1] * row + K[1, 2]
            left, right = min(left, column), max(right, column)
            top, bottom = min(top, row), max(bottom, row)
        if not (left < width and right > -1 and top < height and bottom > -1):
            continue
        first_row, first_column = max(top - _MORE, 0.0), max(left - _MORE, 0.0)
        last_row, last_column = min(bottom + _MORE, height - 1.0), min(right + _MORE, width - 1.0)
        for v in range(math.ceil(first_row), math.floor(last_row) + 1):
            for u in range(math.ceil(first_column), math.floor(last_column) + 1):
                registered[v, u] = min(registered[v, u], depth)
