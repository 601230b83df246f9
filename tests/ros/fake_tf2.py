"""The part of tf2_ros that our ROS 2 port uses, on the fake of rclpy."""

from __future__ import annotations

import time as wall
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from hypermap.core.trajectory import pose_matrix

from .fake_rclpy_values import DurabilityPolicy, Duration, QoSProfile, Time
from .strict_messages import StrictTypes

_KEPT = 10 * 10**9  # [ns]; older transforms are refused


class TransformException(Exception):
    pass


class Buffer:
    types: StrictTypes

    def __init__(self, cache_time: Duration | None = None, node: Any = None) -> None:
        self.known: dict[str, list[Any]] = {}
        self.fixed: dict[str, Any] = {}

    def clear(self) -> None:
        self.known.clear()

    def lookup_transform(
        self, target_frame: str, source_frame: str, time: Time, timeout: Duration | None = None
    ) -> Any:
        assert isinstance(time, Time)
        end = wall.monotonic() + (timeout.nanoseconds / 1e9 if timeout else 0)
        while True:
            try:
                target = self._to_root(target_frame, source_frame, time)
                source = self._to_root(source_frame, target_frame, time)
                return self._stamped(np.linalg.inv(target) @ source)
            except TransformException:
                if wall.monotonic() >= end:
                    raise
            wall.sleep(0.01)

    def _to_root(self, frame: str, other: str, time: Time) -> Any:
        if frame != other and not self._links(frame):
            raise TransformException(f'"{frame}" passed to lookupTransform does not exist.')
        matrix = np.eye(4)
        while frame in self.known or frame in self.fixed:
            message = self._at(frame, time) if frame in self.known else self.fixed[frame]
            matrix = _matrix(message.transform) @ matrix
            frame = message.header.frame_id
        return matrix

    def _at(self, frame: str, time: Time) -> Any:
        """Return a transform of that very time, or the latest; this tf does not interpolate."""
        for message in reversed(self.known[frame]):
            if time.nanoseconds in (0, _stamp(message)):
                return message
        raise TransformException("Lookup would require extrapolation into the future.")

    def _links(self, frame: str) -> bool:
        every = [*self.fixed.values(), *(m for ms in self.known.values() for m in ms)]
        return any(frame in (m.child_frame_id, m.header.frame_id) for m in every)

    def _stamped(self, matrix: Any) -> Any:
        found = self.types.message("geometry_msgs/TransformStamped")()
        t, q = found.transform.translation, found.transform.rotation
        t.x, t.y, t.z = (float(v) for v in matrix[:3, 3])
        q.x, q.y, q.z, q.w = _quaternion(matrix[:3, :3])
        return found


class TransformListener:
    def __init__(self, buffer: Buffer, node: Any, *, spin_thread: bool = False) -> None:
        kind = buffer.types.message("tf2_msgs/TFMessage")
        node.create_subscription(kind, "/tf", self.callback, QoSProfile(depth=100))
        late = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        node.create_subscription(kind, "/tf_static", self._take_static, late)
        self.buffer = buffer

    def callback(self, data: Any) -> None:
        for transform in data.transforms:
            known = self.buffer.known.setdefault(transform.child_frame_id, [])
            if not known or _stamp(transform) >= max(map(_stamp, known)) - _KEPT:
                known.append(transform)

    def _take_static(self, message: Any) -> None:
        for transform in message.transforms:
            self.buffer.fixed[transform.child_frame_id] = transform


def _stamp(transform: Any) -> int:
    return int(transform.header.stamp.sec * 10**9 + transform.header.stamp.nanosec)


def _matrix(transform: Any) -> Any:
    t, q = transform.translation, transform.rotation
    return pose_matrix((t.x, t.y, t.z), (q.x, q.y, q.z, q.w))


def _quaternion(rotation: Any) -> tuple[float, ...]:
    return tuple(float(v) for v in Rotation.from_matrix(rotation).as_quat())
