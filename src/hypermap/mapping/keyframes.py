"""Keyframe selection: skip most frames whose camera has hardly moved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hypermap.core.trajectory import invert
from hypermap.mapping.stages import KeyframeConfig

_LONGEST_WAIT = 60.0  # seconds until a camera at rest is looked through again


@dataclass(frozen=True, eq=False)
class _Keyframe:
    """The pose and time of a keyframe, and how long to wait for the next if the camera rests."""

    map_T_camera: NDArray[np.float64]
    stamp: float | None
    wait: float


class KeyframeSelector:
    """Keeps the last keyframe.

    Otherwise a camera at rest would count the same view of an object again and again. It is looked
    through again, but less and less often: first after `look_again` seconds, then after twice as
    long, at last every minute.
    """

    def __init__(self, config: KeyframeConfig) -> None:
        self.config = config
        self._last: _Keyframe | None = None
        self._before: _Keyframe | None = None

    def accept(self, map_T_camera: NDArray[np.float64], stamp: float) -> bool:
        """Return whether a frame is a keyframe.

        It is if the camera has moved by `min_distance` or rotated by `min_angle_deg` since the
        last one, or has been at rest for long enough. The first frame always is one.

        Args:
            map_T_camera: its pose, shape (4, 4).
            stamp: its time [s].
        """
        wait, last = self.config.look_again, self._last
        if last is not None and not self._has_moved(last.map_T_camera, map_T_camera):
            if last.stamp is None:
                self._last = _Keyframe(last.map_T_camera, stamp, last.wait)
                return False
            if not wait or abs(stamp - last.stamp) < last.wait:
                return False
            map_T_camera, wait = last.map_T_camera, min(2 * last.wait, _LONGEST_WAIT)
        self._before, self._last = last, _Keyframe(map_T_camera, stamp, wait)
        return True

    @property
    def last(self) -> NDArray[np.float64] | None:
        """The pose of the last keyframe, shape (4, 4); None if there is none."""
        return None if self._last is None else self._last.map_T_camera

    def go_on_from(self, map_T_camera: NDArray[np.float64] | None) -> None:
        """Compare the next pose with this one, shape (4, 4); None to accept any."""
        wait = self.config.look_again
        self._last = None if map_T_camera is None else _Keyframe(map_T_camera, None, wait)
        self._before = self._last

    def undo(self) -> None:
        """Drop the last keyframe, which could not be processed."""
        self._last = self._before

    def _has_moved(self, last: NDArray[np.float64], now: NDArray[np.float64]) -> bool:
        last_T_camera = invert(last) @ now
        distance = float(np.linalg.norm(last_T_camera[:3, 3]))
        angle_deg = np.degrees(rotation_angle(last_T_camera[:3, :3]))
        return distance >= self.config.min_distance or angle_deg >= self.config.min_angle_deg


def rotation_angle(rotation: NDArray[np.float64]) -> float:
    """Return the angle of a rotation matrix, shape (3, 3), [rad], 0..pi; exact for small angles."""
    axis = rotation[[2, 0, 1], [1, 2, 0]] - rotation[[1, 2, 0], [2, 0, 1]]
    return float(np.arctan2(np.linalg.norm(axis), np.trace(rotation) - 1))
