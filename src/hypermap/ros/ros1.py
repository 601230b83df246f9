"""ROS 1 as a port of our nodes."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import FrameError, HypermapError
from hypermap.core.trajectory import pose_matrix
from hypermap.ros.parameters import checked
from hypermap.ros.port import Closable, Level, Message, Parameter, Publisher, Value
from hypermap.ros.ros1_libraries import rospy, tf2_ros
from hypermap.ros.ros1_messages import message_class, service_class

_POLL_PERIOD = 0.5  # s between looks at parameters that may change


class Ros1Port:
    """A ROS 1 node; there is one in a process.

    Raises:
        HypermapError: If no roscore answers.
    """

    def __init__(self, name: str, argv: Sequence[str] | None = None) -> None:
        rospy.init_node(name, argv=None if argv is None else list(argv))
        self._buffer: Any = None
        self._broadcaster: Any = None

    @property
    def node_name(self) -> str:
        """The node's full name."""
        return str(rospy.get_name())

    def message(self, type_name: str) -> type[Any]:
        """Return the class of a message."""
        return message_class(type_name)

    def response(self, type_name: str) -> type[Any]:
        """Return the class of a service's response."""
        response: type[Any] = service_class(type_name)._response_class
        return response

    def publisher(self, topic: str, type_name: str, *, latched: bool = False) -> Publisher:
        """Publish on a topic."""
        return _Publisher(
            rospy.Publisher(_resolved(topic), message_class(type_name), latch=latched, queue_size=1)
        )

    def subscribe(
        self,
        topic: str,
        type_name: str,
        callback: Callable[[Message], None],
        *,
        latched: bool = False,  # noqa: ARG002 - ROS 1 brings what is latched to everyone
        queue: int = 1,
    ) -> Closable:
        """Call back with each message of a topic."""
        kind = message_class(type_name)
        return _Closing(
            rospy.Subscriber(
                _resolved(topic), kind, callback, queue_size=queue, buff_size=1 << 24
            ).unregister
        )

    def service(
        self,
        name: str,
        type_name: str,
        handler: Callable[[Message], Message],
        failed: Callable[[str], Message],  # noqa: ARG002 - services of ROS 1 can fail
    ) -> Closable:
        """Offer a service."""

        def handle(request: Message) -> Message:
            try:
                return handler(request)
            except HypermapError as error:
                self.log("error", f"{name}: {error}")
                raise rospy.ServiceException(str(error)) from None

        return _Closing(rospy.Service(_resolved(name), service_class(type_name), handle).shutdown)

    def timer(self, period: float, callback: Callable[[], None]) -> Closable:
        """Call back every `period` seconds."""
        return _Closing(rospy.Timer(rospy.Duration(period), lambda _: callback()).shutdown)

    def now(self) -> int:
        """Return the time [ns]."""
        return int(rospy.Time.now().to_nsec())

    def stamp(self, nanoseconds: int) -> Message:
        """Return a time as messages carry it."""
        return rospy.Time(*divmod(nanoseconds, 1_000_000_000))

    def static_transforms(self, transforms: Sequence[Message]) -> None:
        """Make transforms known to everyone."""
        if self._broadcaster is None:
            self._broadcaster = tf2_ros.StaticTransformBroadcaster()
        self._broadcaster.sendTransform(list(transforms))

    def lookup(
        self, target: str, source: str, stamp: int | None = None, timeout: float = 0.0
    ) -> NDArray[np.float64]:
        """Return `target_T_source`, shape (4, 4)."""
        if self._buffer is None:
            self._buffer = tf2_ros.Buffer()
            self._listener = tf2_ros.TransformListener(self._buffer)
        time = rospy.Time(0) if stamp is None else self.stamp(stamp)
        try:
            found = self._buffer.lookup_transform(target, source, time, rospy.Duration(timeout))
        except tf2_ros.TransformException as error:
            raise FrameError(f"tf does not lead from {source!r} to {target!r}: {error}") from None
        p, q = found.transform.translation, found.transform.rotation
        return pose_matrix((p.x, p.y, p.z), (q.x, q.y, q.z, q.w))

    def parameters(
        self,
        parameters: Sequence[Parameter],
        on_change: Callable[[Mapping[str, Value]], None] | None = None,
    ) -> dict[str, Value]:
        """Declare parameters and return their values."""
        values = {
            parameter.name: checked(
                parameter, rospy.get_param(f"~{parameter.name}", parameter.default)
            )
            for parameter in parameters
        }
        # TODO: poll those that may change
        return values

    def log(self, level: Level, text: str) -> None:
        """Write a line to the node's log."""
        write = {
            "debug": rospy.logdebug,
            "info": rospy.loginfo,
            "warning": rospy.logwarn,
            "error": rospy.logerr,
        }[level]
        write("%s", text)

    @property
    def is_shut_down(self) -> bool:
        """Whether the node is to end."""
        return bool(rospy.is_shutdown())

    def spin(self) -> None:
        """Return when the node is to end."""
        rospy.spin()

    def shut_down(self) -> None:
        """End the node."""
        rospy.signal_shutdown("asked to")


class _Closing:
    def __init__(self, close: Callable[[], object]) -> None:
        self._close: Callable[[], object] | None = close

    def close(self) -> None:
        close, self._close = self._close, None
        if close is not None:
            close()


class _Publisher(_Closing):
    def __init__(self, publisher: Any) -> None:
        super().__init__(publisher.unregister)
        self._publisher = publisher
        self._lock = threading.Lock()

    @property
    def listeners(self) -> int:
        return int(self._publisher.get_num_connections())

    def publish(self, message: Message) -> None:
        self._publisher.publish(message)


def _resolved(name: str) -> str:
    return name if name.startswith("/") else f"~{name}"
