"""Listens to tf in ROS 1."""

from __future__ import annotations

from typing import Any

from hypermap.ros.newest_transforms import NewestTransforms
from hypermap.ros.ros1.libraries import rospy, tf2_ros


class TransformListener(tf2_ros.TransformListener):  # type: ignore[misc]
    """Listens to tf, and forgets transforms of a time to come; see `NewestTransforms`."""

    def __init__(self, buffer: Any) -> None:
        self._newest = NewestTransforms(buffer.clear)
        super().__init__(buffer)

    def callback(self, data: Any) -> None:
        """Take a message of /tf."""
        now = rospy.Time.now().to_nsec()
        for transform in data.transforms:
            self._newest.take(transform, transform.header.stamp.to_nsec(), now)
        super().callback(data)
