"""Keyframe selection: skip most frames whose camera has hardly moved."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hypermap.core.trajectory import invert
from hypermap.mapping.stages import KeyframeConfig

_LONGEST_WAIT = 60.0  # seconds until a camera at rest is looked through again


@dataclass(frozen=True, eq=False)
class Keyframe:
    """A keyframe.

    Attributes:
        map_T_camera: its pose, shape (4, 4).
        stamp: its time [s]; None if that is unknown, or of another clock.
        wait: after how long a camera that has not moved since gives the next one [s].
    """

    map_T_camera: NDArray[np.float64]
    stamp: float | None
    wait: float


class KeyframeSelector:
    """Keeps the last keyframe.

    Otherwise a camera at rest would count the same view of an object again and again. It is looked
    through again, but less and less often: first after `look_again` seconds, then after twice as
    long, at last every minute.

    Attributes:
        config: the settings.
        last: the last keyframe; None if there is none.
    """

    def __init__(self, config: KeyframeConfig) -> None:
        self.config = config
        self.last: Keyframe | None = None
        self._before: Keyframe | None = None

    def accept(self, map_T_camera: NDArray[np.float64], stamp: float) -> bool:
        """Return whether a frame is a keyframe.

        It is if the camera has moved by `min_distance` or rotated by `min_angle_deg` since the
        last one, or has been at rest for long enough. The first frame always is one.

        Args:
            map_T_camera: its pose, shape (4, 4).
            stamp: its time [s].
        """
        last = self.last
        if last is None or self._has_moved(last.map_T_camera, map_T_camera):
            now = Keyframe(map_T_camera, stamp, self.config.look_again)
        elif last.stamp is None:
            self.last = replace(last, stamp=stamp)
            return False
        elif not self.config.look_again or abs(stamp - last.stamp) < last.wait:
            return False
        else:
            now = _looked_again(last, stamp)
        self._before, self.last = last, now
        return True

    def repeat(self, map_T_camera: NDArray[np.float64], stamp: float) -> None:
        """Take a frame for the last keyframe that an earlier run has accepted.

        Args:
            map_T_camera: its pose, shape (4, 4).
            stamp: its time [s].
        """
        last = self.last
        if (
            last is None
            or last.stamp is None
            or stamp <= last.stamp  # the recording begins again
            or self._has_moved(last.map_T_camera, map_T_camera)
        ):
            self.go_on_from(map_T_camera, stamp)
        else:
            self.go_on_with(_looked_again(last, stamp))

    def go_on_with(self, keyframe: Keyframe) -> None:
        """Make this the last keyframe, which `undo` does not drop."""
        self._before = self.last = keyframe

    def go_on_from(self, map_T_camera: NDArray[np.float64], stamp: float | None = None) -> None:
        """Compare the next frame with this pose, shape (4, 4), of a time [s]; None if unknown."""
        self.go_on_with(Keyframe(map_T_camera, stamp, self.config.look_again))

    def undo(self) -> None:
        """Drop the last keyframe, which could not be processed."""
        self.last = self._before

    def _has_moved(self, last: NDArray[np.float64], now: NDArray[np.float64]) -> bool:
        last_T_camera = invert(last) @ now
        distance = float(np.linalg.norm(last_T_camera[:3, 3]))
        angle_deg = np.degrees(rotation_angle(last_T_camera[:3, :3]))
        return distance >= self.config.min_distance or angle_deg >= self.config.min_angle_deg


def _looked_again(last: Keyframe, stamp: float) -> Keyframe:
    """Return the next keyframe of a camera at rest."""
    wait = max(last.wait, min(2 * last.wait, _LONGEST_WAIT))
    return Keyframe(last.map_T_camera, stamp, wait)


def rotation_angle(rotation: NDArray[np.float64]) -> float:
    """Return the angle of a rotation matrix, shape (3, 3), [rad], 0..pi; exact for small angles."""
    axis = rotation[[2, 0, 1], [1, 2, 0]] - rotation[[1, 2, 0], [2, 0, 1]]
    return float(np.arctan2(np.linalg.norm(axis), np.trace(rotation) - 1))
