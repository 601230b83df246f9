"""Planar poses as arrays: x, y [m] and yaw [rad], and their relation to poses in space."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def heading(map_T_camera: Array) -> float:
    """Return the yaw of a camera's optical axis [rad]; of its up axis if it looks up or down."""
    ahead, up = map_T_camera[:2, 2], -map_T_camera[:2, 1]
    x, y = ahead if np.hypot(*ahead) >= np.hypot(*up) else up
    return math.atan2(y, x)


def planar(map_T_camera: Array) -> Array:
    """Return x, y [m] and yaw [rad] of a pose in space, shape (3,)."""
    return np.array([map_T_camera[0, 3], map_T_camera[1, 3], heading(map_T_camera)])


def moved(map_T_camera: Array, before: Array, after: Array) -> Array:
    """Return a pose in space, shape (4, 4), after the planar motion from one pose to another."""
    turn = after[2] - before[2]
    cos, sin = math.cos(turn), math.sin(turn)
    rotation = np.array([[cos, -sin], [sin, cos]])
    result = map_T_camera.copy()
    result[:2, :3] = rotation @ map_T_camera[:2, :3]
    result[:2, 3] = rotation @ (map_T_camera[:2, 3] - before[:2]) + after[:2]
    return result


def wrapped(angles: Array) -> Array:
    """Return angles [rad] normalized to -pi..pi, in the same shape."""
    return np.asarray((angles + math.pi) % math.tau - math.pi)


def compose(a_T_b: Array, b_T_c: Array) -> Array:
    """Return `a_T_c`; shapes (..., 3) broadcast."""
    cos, sin = np.cos(a_T_b[..., 2]), np.sin(a_T_b[..., 2])
    x, y = b_T_c[..., 0], b_T_c[..., 1]
    return np.stack(
        [
            a_T_b[..., 0] + cos * x - sin * y,
            a_T_b[..., 1] + sin * x + cos * y,
            wrapped(a_T_b[..., 2] + b_T_c[..., 2]),
        ],
        axis=-1,
    )


def between(map_T_a: Array, map_T_b: Array) -> Array:
    """Return `a_T_b`; shapes (..., 3) broadcast."""
    cos, sin = np.cos(map_T_a[..., 2]), np.sin(map_T_a[..., 2])
    dx, dy = map_T_b[..., 0] - map_T_a[..., 0], map_T_b[..., 1] - map_T_a[..., 1]
    return np.stack(
        [cos * dx + sin * dy, cos * dy - sin * dx, wrapped(map_T_b[..., 2] - map_T_a[..., 2])],
        axis=-1,
    )


def inverse(a_T_b: Array) -> Array:
    """Return `b_T_a`; shape (..., 3)."""
    return between(a_T_b, np.zeros(3))


def apply(a_T_b: Array, points_xy: Array) -> Array:
    """Return points in frame b, shape (N, 2), as points in frame a."""
    cos, sin = math.cos(a_T_b[2]), math.sin(a_T_b[2])
    x, y = points_xy.T
    return np.column_stack([cos * x - sin * y + a_T_b[0], sin * x + cos * y + a_T_b[1]])
