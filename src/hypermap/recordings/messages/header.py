"""Fields that all messages have: times, frames and bytes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def nanoseconds(stamp: Any) -> int:
    """Return a message's time in nanoseconds; rospy spells its parts `secs` and `nsecs`."""
    if hasattr(stamp, "secs"):
        return int(stamp.secs) * 1_000_000_000 + int(stamp.nsecs)
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def as_seconds(stamp: int) -> float:
    """Return nanoseconds as seconds, rounded correctly.

    Integer division rounds only once; dividing floats by 1e9 would be off by up to 0.2 us.
    """
    return stamp / 10**9


def clean_frame(frame_id: str) -> str:
    """Return a frame's name without the leading slash that old ROS 1 programs write."""
    return frame_id.lstrip("/")


def octets(data: Any) -> NDArray[np.uint8]:
    """Return the bytes of a message, which rospy carries as `bytes`, others as an array."""
    if isinstance(data, (bytes, bytearray)):
        return np.frombuffer(data, dtype=np.uint8)
    return np.asarray(data, dtype=np.uint8)
