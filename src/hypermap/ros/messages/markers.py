"""Markers, which rviz and others draw, one by one: `visualization_msgs/Marker`."""

from __future__ import annotations

import math
import zlib

import numpy as np
from numpy.typing import NDArray

from hypermap.core.frames import Pose2D
from hypermap.recordings.messages.header import clean_frame
from hypermap.ros.messages.geometry_messages import Types
from hypermap.ros.messages.points import is_ros1, many_points
from hypermap.ros.port import Message
from hypermap.ros.ros1.arrays import writing_arrays
from hypermap.text import printable

# visualization_msgs/Marker
ARROW, LINE_LIST, CUBE_LIST, TEXT_VIEW_FACING, TRIANGLE_LIST = 0, 5, 6, 9, 11
DELETE_ALL = 3

_LONGEST_LABEL, _LONGEST_NAMESPACE = 60, 200  # characters

INK = (0.08, 0.08, 0.08, 1.0)  # of labels


class MarkerMaker:
    """Makes markers in one frame."""

    def __init__(self, types: Types, frame_id: str) -> None:
        self._types = types
        self._marker = writing_arrays(types.message("visualization_msgs/Marker"))
        self._stamp = types.stamp(0)  # the latest transform
        self._frame_id = frame_id

    def marker(
        self,
        namespace: str,
        number: int,
        kind: int,
        *,
        color: tuple[float, float, float, float],
    ) -> Message:
        """Return a marker without content."""
        marker = self._marker()
        marker.header.frame_id = clean_frame(self._frame_id)
        marker.header.stamp = self._stamp
        marker.ns, marker.id, marker.type = _shortened(namespace), number, kind
        marker.pose.orientation.w = 1.0
        marker.color.r, marker.color.g, marker.color.b, marker.color.a = color
        marker.frame_locked = True
        return marker

    def delete_all(self) -> Message:
        """Return the marker that deletes all others."""
        marker = self.marker("", 0, TRIANGLE_LIST, color=INK)
        marker.action = DELETE_ALL
        return marker

    def array(self, markers: list[Message]) -> Message:
        """Return markers as one message."""
        array = writing_arrays(self._types.message("visualization_msgs/MarkerArray"))()
        array.markers = markers
        return array

    def draw(self, marker: Message, points: NDArray[np.float64], scale: float = 1.0) -> None:
        """Give a marker points; the scale is the width of lines, or the side of cubes [m]."""
        marker.scale.x = marker.scale.y = marker.scale.z = float(scale)
        marker.points = many_points(points, self._types)

    def unshade(self, marker: Message) -> None:
        """Give each triangle the marker's color, which rviz then draws as it is, without light."""
        count = len(marker.points) // 3
        color = marker.color
        if is_ros1(self._marker):
            marker.colors = np.tile((color.r, color.g, color.b, color.a), (count, 1))
        else:
            marker.colors = [color] * count

    def write(
        self, marker: Message, text: str, at: tuple[float, float, float], height: float
    ) -> None:
        """Give a marker text, its place and the height of its letters [m]."""
        marker.pose.position.x, marker.pose.position.y, marker.pose.position.z = at
        marker.scale.z = float(height)
        marker.text = label_text(text)

    def point_along(self, marker: Message, pose: Pose2D, length: float, height: float) -> None:
        """Give an arrow its pose, its length and its height above the floor [m]."""
        at, turn = marker.pose.position, marker.pose.orientation
        at.x, at.y, at.z = float(pose.x), float(pose.y), float(height)
        turn.z, turn.w = math.sin(pose.yaw / 2), math.cos(pose.yaw / 2)
        marker.scale.x = float(length)
        marker.scale.y = marker.scale.z = length / 5


def label_text(text: str) -> str:
    """Return the text of a label; to rviz, one without text is an error."""
    return printable(text, _LONGEST_LABEL)


def _shortened(namespace: str) -> str:
    """Return a namespace that is not endless, as each marker repeats it, but still its own."""
    if len(namespace) <= _LONGEST_NAMESPACE:
        return namespace
    return f"{namespace[:_LONGEST_NAMESPACE]} {zlib.crc32(namespace.encode(errors='replace')):08x}"
