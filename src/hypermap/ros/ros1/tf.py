"""Listens to tf in ROS 1."""

from __future__ import annotations

from typing import Any

from hypermap.ros.ros1.libraries import rospy, tf2_ros

_BACK = 1.0  # [s] by which a frame's stamps go back where time has begun again


class TransformListener(tf2_ros.TransformListener):  # type: ignore[misc]
    """Listens to tf, and forgets transforms of a time to come.

    tf2 refuses transforms much older than its newest, and forgets all when the clock jumps back, as
    with a bag in a loop. A transform of before the jump that arrives after it, or one of a machine
    whose clock was ahead, would keep out all others until its time has come.
    """

    def __init__(self, buffer: Any) -> None:
        self._newest: dict[str, float] = {}  # stamp by the name of the frame
        super().__init__(buffer)

    def callback(self, data: Any) -> None:
        """Take a message of /tf."""
        now = rospy.Time.now().to_sec()
        for transform in data.transforms:
            frame, stamp = transform.child_frame_id, transform.header.stamp.to_sec()
            newest = self._newest.get(frame, stamp)
            if stamp < newest - _BACK and abs(now - stamp) < abs(now - newest):
                self.buffer.clear()
                self._newest, newest = {}, stamp
            self._newest[frame] = max(stamp, newest)
        super().callback(data)
