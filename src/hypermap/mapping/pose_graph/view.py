"""The upright surfaces in a depth image, in leveled coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hypermap.mapping.pose_graph.planar import Array, planar
from hypermap.perception.frame import RgbdFrame

_COLUMNS = 80  # of blocks of pixels over which depth is averaged, about
_NEAR, _FAR = 0.2, 6.0  # meters between which depth is used
_SMOOTH = 0.03  # 1/m; a larger difference in disparity between blocks is a depth edge
_UPRIGHT = 0.7  # least horizontal part of the normal of an upright surface
_LOWEST = 0.05  # meters above the floor

Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class View:
    """A depth image in blocks of pixels.

    Its coordinates are leveled: x forward, y left, z up from the floor, (0, 0) below the camera.

    Attributes:
        stamp: of the frame [s].
        pose: x, y, yaw of the camera as recorded [m, m, rad], shape (3,).
        level_R_camera: rotation from the camera's optical frame, shape (3, 3).
        height: of the camera above the floor [m].
        intrinsics: fx, fy, cx, cy of the blocks [blocks], shape (4,).
        points: of each block [m], NaN without one, float32, shape (H, W, 3).
        normals: of the surface there, NaN without one, float32, shape (H, W, 3).
        upright: points of upright surfaces [m], shape (N, 3).
        upright_normals: their normals, shape (N, 3).
    """

    stamp: float
    pose: Array
    level_R_camera: Array
    height: float
    intrinsics: Array
    points: Floats
    normals: Floats
    upright: Floats
    upright_normals: Floats

    @classmethod
    def of(cls, frame: RgbdFrame) -> View:
        """Return what a frame shows."""
        step = max(1, round(frame.camera.width / _COLUMNS))
        pose = planar(frame.map_T_camera)
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        level_R_map = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
        level_R_camera = level_R_map @ frame.map_T_camera[:3, :3]
        height = float(frame.map_T_camera[2, 3])
        optical = _block_means(frame.points(), step)
        points = optical @ level_R_camera.T.astype(np.float32)
        points[..., 2] += np.float32(height)
        normals = _normals(optical) @ level_R_camera.T.astype(np.float32)
        with np.errstate(invalid="ignore"):
            chosen = np.hypot(normals[..., 0], normals[..., 1]) > _UPRIGHT
            chosen &= points[..., 2] > _LOWEST
        K = frame.camera.K / [[step], [step], [1]]
        middle = (step - 1) / 2 / step  # pixel coordinates of a block are those of its center
        return cls(
            frame.stamp,
            pose,
            level_R_camera,
            height,
            np.array([K[0, 0], K[1, 1], K[0, 2] - middle, K[1, 2] - middle]),
            points,
            normals,
            points[chosen],
            normals[chosen],
        )


def _block_means(points: Floats, step: int) -> Floats:
    """Return the mean point of each block of an organized cloud, NaN at edges and without depth."""
    height, width = (size // step for size in points.shape[:2])
    blocks = points[: height * step, : width * step].reshape(height, step, width, step, 3)
    z = blocks[..., 2]
    with np.errstate(invalid="ignore", divide="ignore"):
        is_seen = (z > _NEAR) & (z < _FAR)
        counts = is_seen.sum(axis=(1, 3))
        sums = np.where(is_seen[..., np.newaxis], blocks, np.float32(0)).sum(axis=(1, 3))
        means = sums / counts[..., np.newaxis]
        nearest = np.where(is_seen, z, np.inf).min(axis=(1, 3))
        farthest = np.where(is_seen, z, 0).max(axis=(1, 3))
        is_good = (counts >= step * step / 2) & (1 / nearest - 1 / farthest < _SMOOTH)
    means[~is_good] = np.nan
    return np.ascontiguousarray(means, dtype=np.float32)


def _normals(points: Floats) -> Floats:
    """Return normals toward the camera of an organized cloud of means, NaN at edges."""
    normals = np.full_like(points, np.nan)
    across = points[1:-1, 2:] - points[1:-1, :-2]
    down = points[2:, 1:-1] - points[:-2, 1:-1]
    normal = np.cross(across, down)
    with np.errstate(invalid="ignore", divide="ignore"):
        normal /= np.linalg.norm(normal, axis=2, keepdims=True)
        away = np.sum(normal * points[1:-1, 1:-1], axis=2) > 0
        disparity = 1 / points[..., 2]
        middle = disparity[1:-1, 1:-1]
        near = (
            disparity[1:-1, 2:],
            disparity[1:-1, :-2],
            disparity[2:, 1:-1],
            disparity[:-2, 1:-1],
        )
        smooth = np.all([np.abs(other - middle) < _SMOOTH for other in near], axis=0)
    normal[away] *= -1
    normal[~smooth] = np.nan
    normals[1:-1, 1:-1] = normal
    return normals
