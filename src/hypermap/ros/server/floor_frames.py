"""Frames of requests and messages: those of the map, or else those of tf, seen from above."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import FrameError
from hypermap.core.frames import Pose2D
from hypermap.core.hypermap import Hypermap
from hypermap.recordings.messages.header import clean_frame
from hypermap.ros.port import Port

MAX_TILT = math.radians(5)
"""Frames that lean more than this against the floor are refused [rad]."""


class FloorFrames:
    """Finds how frames lie on the floor; what the map says comes before what tf says.

    Attributes:
        timeout: seconds to wait for tf.
    """

    def __init__(self, port: Port, timeout: float = 0.5) -> None:
        self._port = port
        self.timeout = timeout

    def pose(
        self, hypermap: Hypermap, target: str, source: str | None, stamp: int | None = None
    ) -> Pose2D:
        """Return `target_T_source`.

        Args:
            hypermap: the map.
            target: a frame of the map.
            source: any frame; None for the map's base frame.
            stamp: when [ns], for tf; None for the latest.

        Raises:
            FrameError: If neither the map nor tf knows it, or tf says that it is tilted.
        """
        frame = hypermap.base_frame if source is None else _as_the_map_spells(hypermap, source)
        try:
            return hypermap.frames.lookup(target, frame)
        except FrameError:
            known = ", ".join(dict.fromkeys(layer.frame_id for layer in hypermap)) or "none"
        try:
            matrix = self._port.lookup(clean_frame(target), clean_frame(frame), stamp, self.timeout)
        except FrameError as error:
            raise FrameError(
                f"frame {frame!r} is unknown to the map, whose layers have the frames {known}; "
                f"{error}"
            ) from None
        return floor_pose(matrix, frame)


def _as_the_map_spells(hypermap: Hypermap, frame: str) -> str:
    """Return a frame as the map writes it: in old maps, names start with a slash."""
    names = dict.fromkeys([*(layer.frame_id for layer in hypermap), *hypermap.frames.frames])
    if frame in names:
        return frame
    return next((name for name in names if clean_frame(name) == frame), frame)


def floor_pose(target_T_source: NDArray[np.float64], source: str) -> Pose2D:
    """Return a rigid transform, shape (4, 4), as seen from above: x, y and yaw.

    Raises:
        FrameError: If the frame is tilted, so that its plane is not the floor.

    >>> floor_pose(np.eye(4), "odom")
    Pose2D(x=0.0, y=0.0, yaw=0.0)
    """
    tilt = math.acos(np.clip(target_T_source[2, 2], -1.0, 1.0))
    if tilt > MAX_TILT:
        raise FrameError(
            f"frame {source!r} is tilted by {math.degrees(tilt):.0f} degrees against the floor; "
            "give places on the floor in a frame whose z axis points up"
        )
    x, y = target_T_source[:2, 3]
    return Pose2D(float(x), float(y), math.atan2(target_T_source[1, 0], target_T_source[0, 0]))
