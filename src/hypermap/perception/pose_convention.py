"""Conventions for the pose of a camera.

Hypermap's is that of REP 103 and OpenCV: the pose of the camera's optical frame in the world.
Programs and data sets that use another one look the same, and give a map that makes no sense.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from hypermap.core.trajectory import invert, pose_matrix, quats_of

OPTICAL = "optical"

CONVENTIONS: Mapping[str, str] = MappingProxyType(
    {
        OPTICAL: "those of the camera's optical frame (x right, y down, z forward)",
        "body": "those of the camera's body (x forward, y left, z up)",
        "frd": "those of the camera's body (x forward, y right, z down)",
        "opengl": "those of an OpenGL camera (x right, y up, z backward), as of ARKit or Blender",
        "world-to-camera": "inverse: those of the world in the camera's optical frame",
        "w-first": "quaternions in the order w, x, y, z",
        "mirrored": "those of a mirrored world (y negated in it and in the image), as of ICL-NUIM",
    }
)

# From the axes of a convention to those of the optical frame: pose @ this.
_TO_OPTICAL = {
    "body": np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]]),
    "frd": np.array([[0.0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]]),
    "opengl": np.diag([1.0, -1, -1, 1]),
}
_MIRROR = np.diag([1.0, -1, 1, 1])


def optical_poses(poses: NDArray[np.float64], convention: str) -> NDArray[np.float64]:
    """Return the poses of the optical frame in the world from poses of another convention.

    Args:
        poses: as recorded, shape (..., 4, 4).
        convention: one of `CONVENTIONS`.

    Returns:
        `world_T_camera`, shape (..., 4, 4).

    Raises:
        KeyError: If there is no such convention.
    """
    if convention == OPTICAL:
        return poses
    if convention == "world-to-camera":
        return invert(poses)
    if convention == "w-first":
        w, x, y, z = np.moveaxis(quats_of(poses[..., :3, :3].reshape(-1, 3, 3)), 1, 0)
        quats = np.stack([x, y, z, w], axis=1).reshape(*poses.shape[:-2], 4)
        return pose_matrix(poses[..., :3, 3], quats)
    if convention == "mirrored":
        return np.asarray(_MIRROR @ poses @ _MIRROR)
    return np.asarray(poses @ _TO_OPTICAL[convention])


def optical_offset(offset: NDArray[np.float64], convention: str) -> NDArray[np.float64]:
    """Return the pose of one camera's optical frame in another's, from that of their frames in tf.

    Args:
        offset: as tf says, shape (4, 4).
        convention: one of `CONVENTIONS`, of both frames. Only its axes count, as tf says itself
            which frame a pose is of.

    Returns:
        Shape (4, 4).
    """
    to_optical = _TO_OPTICAL.get(convention)
    return offset if to_optical is None else np.asarray(to_optical.T @ offset @ to_optical)
