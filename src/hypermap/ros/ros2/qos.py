"""The quality of service of our topics in ROS 2."""

from __future__ import annotations

from typing import Any

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

_QUEUE = 10
_CHANGES = ("hypermap_msgs/", "map_msgs/", "nav_msgs/", "rtabmap_msgs/")


def publisher_qos(latched: bool) -> Any:
    """Return what a publisher offers.

    A latched topic is transient local and keeps its last message, as those of nav2's map server.
    Others are volatile and keep some for slow listeners. Both are reliable, which serves those that
    ask for best effort as well.
    """
    return _profile(1 if latched else _QUEUE, reliable=True, latched=latched)


def subscription_qos(type_name: str, *, latched: bool, queue: int) -> Any:
    """Return what a subscription asks for.

    Changes of maps must not be lost, so they are asked for reliably. From cameras and detectors
    best effort is enough, and what is asked for so comes from reliable publishers too. A latched
    topic must be transient local on the other side: ROS 2 warns in the log where it is not.
    """
    return _profile(queue, reliable=latched or type_name.startswith(_CHANGES), latched=latched)


def _profile(depth: int, *, reliable: bool, latched: bool) -> Any:
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )
