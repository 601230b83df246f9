"""Looks up transforms of tf in ROS 2."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rclpy.clock import JumpThreshold
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.time import Time

from hypermap.core.errors import FrameError, HypermapError
from hypermap.core.trajectory import pose_matrix
from hypermap.ros.newest_transforms import NewestTransforms
from hypermap.ros.ros2.ending import end_executor

try:
    import tf2_ros
except ImportError as missing:
    distribution = os.environ.get("ROS_DISTRO", "DISTRO")
    raise HypermapError(
        f"tf2_ros is missing ({missing}): apt-get install ros-{distribution}-tf2-ros-py, and use "
        "the Python version that it is for"
    ) from None


class Transforms:
    """Listens to tf from a node and a thread of its own.

    A handler that waits for a transform can so never keep it from arriving, however many wait.

    Args:
        name: of the node that it belongs to.
        clock: of that node; when it jumps back, as with a bag in a loop, what is known is forgotten
            but for static transforms.
        run: runs an executor until it is shut down.
    """

    def __init__(self, name: str, clock: Any, run: Callable[[Any], None]) -> None:
        own_name = f"{name}_tf"
        # The argument keeps a `__node:=` that is meant for the other node from renaming this one.
        self._node = Node(
            own_name,
            cli_args=["--ros-args", "-r", f"__node:={own_name}"],
            start_parameter_services=False,
        )
        self._buffer = tf2_ros.Buffer()
        self._listener = _Listener(self._buffer, self._node, clock)
        threshold = JumpThreshold(
            min_forward=None, min_backward=Duration(nanoseconds=-1), on_clock_change=False
        )
        self._jumps = clock.create_jump_callback(
            threshold, post_callback=lambda _: self._buffer.clear()
        )
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=run, args=(self._executor,), daemon=True)
        self._thread.start()

    def lookup(
        self, target: str, source: str, stamp: int | None, timeout: float
    ) -> NDArray[np.float64]:
        """Return `target_T_source`, shape (4, 4); see `Port.lookup`."""
        try:
            time = Time() if stamp is None else Time(nanoseconds=stamp)
            found = self._buffer.lookup_transform(
                target, source, time, Duration(nanoseconds=int(timeout * 1e9))
            )
        except (tf2_ros.TransformException, ValueError, OverflowError) as error:
            reason = str(error).lstrip(", ")  # tf2's may begin with nothing
            raise FrameError(
                f"tf has no transform from {source!r} to {target!r}: {reason}"
            ) from None
        p, q = found.transform.translation, found.transform.rotation
        return pose_matrix((p.x, p.y, p.z), (q.x, q.y, q.z, q.w))

    def forget(self) -> None:
        """Forget where moving frames were."""
        self._buffer.clear()

    def close(self) -> bool:
        """Listen no more; return whether that has ended in time."""
        self._jumps.unregister()
        ended = end_executor(self._executor, self._thread)
        if ended:
            self._node.destroy_node()
        return ended


class _Listener(tf2_ros.TransformListener):  # type: ignore[misc]
    """Listens to tf, and forgets transforms of a time to come; see `NewestTransforms`."""

    def __init__(self, buffer: Any, node: Any, clock: Any) -> None:
        self._newest, self._clock = NewestTransforms(buffer.clear), clock
        super().__init__(buffer, node)

    def callback(self, data: Any) -> None:
        """Take a message of /tf."""
        now = self._clock.now().nanoseconds
        for transform in data.transforms:
            stamp = transform.header.stamp
            self._newest.take(transform, stamp.sec * 10**9 + stamp.nanosec, now)
        super().callback(data)
