"""Places in requests, brought into the base frame of the map that is asked."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.frames import Pose2D
from hypermap.core.hypermap import Hypermap
from hypermap.recordings.messages.header import nanoseconds
from hypermap.ros.messages.from_messages import area_of, is_empty_area, point_of, pose_of
from hypermap.ros.port import Message
from hypermap.ros.server.floor_frames import FloorFrames


class Requests:
    """Reads the points and areas of requests, in any frame that the map or tf knows."""

    def __init__(self, frames: FloorFrames) -> None:
        self._frames = frames

    def point(self, hypermap: Hypermap, message: Message) -> NDArray[np.float64]:
        """Return a `geometry_msgs/PointStamped` in the base frame, shape (1, 2).

        Raises:
            FormatError: If it is not finite.
            FrameError: If its frame is unknown or tilted.
        """
        xy, frame_id = point_of(message)
        pose = self._frames.pose(hypermap, hypermap.base_frame, frame_id, _stamp(message))
        return pose.apply(xy)

    def pose(self, hypermap: Hypermap, message: Message) -> Pose2D:
        """Return a `geometry_msgs/PoseStamped` in the base frame, as seen from above.

        Raises:
            FormatError: If it is not finite.
            FrameError: If its frame is unknown or tilted.
        """
        pose, frame_id = pose_of(message)
        return self._frames.pose(hypermap, hypermap.base_frame, frame_id, _stamp(message)) @ pose

    def area(self, hypermap: Hypermap, message: Message) -> BaseGeometry:
        """Return a `geometry_msgs/PolygonStamped` in the base frame.

        Raises:
            FormatError: If it has fewer than three points, is not finite or crosses itself.
            FrameError: If its frame is unknown or tilted.
        """
        area, frame_id = area_of(message)
        pose = self._frames.pose(hypermap, hypermap.base_frame, frame_id, _stamp(message))
        return pose.apply_geometry(area)

    def area_or_all(self, hypermap: Hypermap, message: Message) -> BaseGeometry | None:
        """Return what `area` does, or None for an area without points: everything."""
        return None if is_empty_area(message) else self.area(hypermap, message)


def _stamp(message: Message) -> int | None:
    """Return when a place was meant [ns]; None, the latest, where the message does not say."""
    return nanoseconds(message.header.stamp) or None
