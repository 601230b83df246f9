"""Keyframe selection: skip frames whose camera has hardly moved."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hypermap.core.trajectory import invert
from hypermap.mapping.stages import KeyframeConfig


class KeyframeSelector:
    """Keeps the pose of the last keyframe.

    Otherwise a camera at rest would count the same view of an object again and again.
    """

    def __init__(self, config: KeyframeConfig) -> None:
        self.config = config
        self._last: NDArray[np.float64] | None = None
        self._before: NDArray[np.float64] | None = None

    def accept(self, map_T_camera: NDArray[np.float64]) -> bool:
        """Return whether a pose, shape (4, 4), is far enough from the last accepted one.

        It is if the camera has moved by `min_distance` or rotated by `min_angle_deg`. The first
        pose is always accepted.
        """
        if self._last is not None:
            last_T_camera = invert(self._last) @ map_T_camera
            distance = float(np.linalg.norm(last_T_camera[:3, 3]))
            angle_deg = np.degrees(rotation_angle(last_T_camera[:3, :3]))
            if distance < self.config.min_distance and angle_deg < self.config.min_angle_deg:
                return False
        self._before, self._last = self._last, map_T_camera
        return True

    @property
    def last(self) -> NDArray[np.float64] | None:
        """The last accepted pose, shape (4, 4); None if there is none."""
        return self._last

    def go_on_from(self, map_T_camera: NDArray[np.float64] | None) -> None:
        """Compare the next pose with this one, shape (4, 4); None to accept any."""
        self._before = self._last = map_T_camera

    def undo(self) -> None:
        """Drop the last accepted pose, whose frame could not be processed."""
        self._last = self._before


def rotation_angle(rotation: NDArray[np.float64]) -> float:
    """Return the angle of a rotation matrix, shape (3, 3), [rad], 0..pi; exact for small angles."""
    axis = rotation[[2, 0, 1], [1, 2, 0]] - rotation[[1, 2, 0], [2, 0, 1]]
    return float(np.arctan2(np.linalg.norm(axis), np.trace(rotation) - 1))
