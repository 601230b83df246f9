"""A heartbeat for Nav2's lifecycle manager."""

from __future__ import annotations

import threading
import uuid
from typing import Any

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration

from hypermap.ros.ros2.messages import message_class
from hypermap.ros.ros2.qos import publisher_qos

PERIOD = 0.1  # s; nav2's nodes and its manager have the same
_TIMEOUT = 4.0  # s; the manager counts with its own, `bond_timeout`
_DELIVERY = 0.5  # s that the last sign may take; a manager that was killed acknowledges nothing


class Bond:
    """A node's end of a bond (`bond_core`): it says that the node lives until it is broken.

    The manager at the other end takes all its nodes down where this falls silent. The node itself
    goes on without a manager, as nav2's do, so it need not listen. It speaks by a clock that
    runs also while a simulator stands still, and only where somebody listens.

    Args:
        node: the node of rclpy; its name without its namespace is the bond's.

    Raises:
        HypermapError: If the package `bond` is not installed.
    """

    def __init__(self, node: Any) -> None:
        self._status = message_class("bond/Status")
        self._node = node
        self._instance = str(uuid.uuid4())
        self._guard = threading.Lock()  # the timer may ring while the bond is broken
        self._is_whole = True
        self._publisher = node.create_publisher(self._status, "bond", publisher_qos(False))
        self._timer = node.create_timer(
            PERIOD,
            self._ring,
            callback_group=MutuallyExclusiveCallbackGroup(),
            clock=Clock(clock_type=ClockType.STEADY_TIME),
        )

    def break_(self) -> None:
        """Say that it ends, so that nobody waits for the next sign."""
        with self._guard:
            self._is_whole = False
            self._say(is_alive=False)
            # DDS may drop what a publisher has sent right before it is destroyed.
            self._publisher.wait_for_all_acked(Duration(seconds=_DELIVERY))
        self._node.destroy_timer(self._timer)
        self._node.destroy_publisher(self._publisher)

    def _ring(self) -> None:
        with self._guard:
            if self._is_whole and self._publisher.get_subscription_count() > 0:
                self._say(is_alive=True)

    def _say(self, *, is_alive: bool) -> None:
        message = self._status(
            id=self._node.get_name(),
            instance_id=self._instance,
            active=is_alive,
            heartbeat_timeout=_TIMEOUT,
            heartbeat_period=PERIOD,
        )
        now = self._node.get_clock().now().nanoseconds
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(now, 10**9)
        self._publisher.publish(message)
