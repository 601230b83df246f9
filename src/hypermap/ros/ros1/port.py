"""ROS 1 as a port of our nodes."""

from __future__ import annotations

import contextlib
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import FrameError, HypermapError
from hypermap.core.trajectory import pose_matrix
from hypermap.ros.callbacks import Closing, guarded
from hypermap.ros.log_text import log_text
from hypermap.ros.parameters import ParameterSet
from hypermap.ros.port import Closable, Level, Message, Parameter, Publisher, Value
from hypermap.ros.ros1.arrays import reading_arrays
from hypermap.ros.ros1.libraries import (
    load_command_line_node_params,
    rosgraph,
    rospy,
    tf2_ros,
)
from hypermap.ros.ros1.logs import (
    forward_logs,
    keep_rosout_settings,
    show_lines_at_once,
    show_lines_without_file,
)
from hypermap.ros.ros1.master import MasterWatch, owns_its_name, require_master
from hypermap.ros.ros1.messages import message_class, service_class
from hypermap.ros.ros1.respawn import RESPAWN, Respawn
from hypermap.ros.ros1.tf import TransformListener
from hypermap.ros.signals import end_signals

_TF_START = 1.0  # s until a new listener has heard what is known
_BUFFER_SIZE = 1 << 24  # bytes read at once; with less, large messages arrive late
_QUEUE = 100  # messages that wait for a slow subscriber


class Ros1Port:
    """A ROS 1 node; there is one in a process, and one that runs already is used.

    Ctrl-C, SIGTERM and the end of its terminal are a KeyboardInterrupt, and the end of `spin` also
    where that got lost. The node's parameters end with it: the roscore would hold them against the
    next one of that name. They stay if it was ended by another node of that name or by `rosnode
    kill`, and wait for its next life (`Respawn`) if it failed or was terminated, after which
    roslaunch may start it again.

    Args:
        name: the node's name, unless an argument gives it another.
        argv: the program's name and the arguments of ROS; None for those of the process.

    Raises:
        HypermapError: If no roscore answers.
    """

    def __init__(self, name: str, argv: Sequence[str] | None = None) -> None:
        self._is_ending = False
        if not rospy.core.is_initialized():
            require_master()
            show_lines_at_once()
            rospy.init_node(name, argv=None if argv is None else list(argv), disable_signals=True)
            show_lines_without_file()
            _end_threads_with_node()
            if threading.current_thread() is threading.main_thread():
                self._take_signals()
        keep_rosout_settings()
        forward_logs(self.log)
        words = sys.argv if argv is None else argv
        self._arguments = frozenset(load_command_line_node_params(words))
        self._respawn = Respawn(words)
        self._may_return = True  # but for Ctrl-C, which is how roslaunch ends for good
        self._given: dict[str, Any] = {}
        self._lock = threading.Lock()
        self._buffer: Any = None
        self._tf_began = 0.0
        self._static: Any = None
        self._parameters = ParameterSet((), {})
        self._names: tuple[str, ...] = ()  # of the parameters
        self._watch = MasterWatch(
            lambda given: self._parameters.update(given),
            lambda: {**self._parameters.given, **self._respawn.parameters},
            self._end,
        )

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
            rospy.Publisher(
                _resolved(topic),
                message_class(type_name),
                latch=latched,
                queue_size=1 if latched else _QUEUE,
            )
        )

    def topic_type(self, topic: str) -> str | None:
        """Return the type of a topic that someone publishes."""
        known = dict(rospy.get_published_topics())
        found = known.get(rospy.resolve_name(_resolved(topic)))
        return None if found is None else str(found)

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
        subscriber = rospy.Subscriber(
            _resolved(topic),
            reading_arrays(message_class(type_name)),
            lambda message: guarded(self.log, topic, lambda: callback(message)),
            queue_size=queue,
            buff_size=_BUFFER_SIZE,
        )
        return _Closing(lambda: _unregister(subscriber))

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
            except Exception as error:
                self.log("error", f"{name}: {traceback.format_exc()}")
                raise rospy.ServiceException(f"{type(error).__name__}: {error}") from None

        return _Closing(rospy.Service(_resolved(name), service_class(type_name), handle).shutdown)

    def timer(self, period: float, callback: Callable[[], None]) -> Closable:
        """Call back every `period` seconds of the machine's clock."""
        ends = threading.Event()

        def run() -> None:
            while not ends.wait(period) and not self.is_shut_down:
                guarded(self.log, "timer", callback)

        threading.Thread(target=run, name="timer", daemon=True).start()
        return _Closing(ends.set)

    def now(self) -> int:
        """Return the time [ns]."""
        return int(rospy.Time.now().to_nsec())

    def stamp(self, nanoseconds: int) -> Message:
        """Return a time as messages carry it."""
        return rospy.Time(*divmod(nanoseconds, 1_000_000_000))

    def static_transforms(self, transforms: Sequence[Message]) -> None:
        """Make transforms known to everyone, instead of those of an earlier call."""
        if self._static is None:
            self._static = self.publisher("/tf_static", "tf2_msgs/TFMessage", latched=True)
        self._static.publish(self.message("tf2_msgs/TFMessage")(transforms=list(transforms)))

    def lookup(
        self, target: str, source: str, stamp: int | None = None, timeout: float = 0.0
    ) -> NDArray[np.float64]:
        """Return `target_T_source`, shape (4, 4).

        The first call starts to listen to tf, and waits a second for it if it must.
        """
        buffer, began = self._tf()
        stamp_ros = rospy.Time(0) if stamp is None else self.stamp(stamp)
        end = max(time.monotonic() + timeout, began + _TF_START)
        while True:
            try:
                found = buffer.lookup_transform(target.lstrip("/"), source.lstrip("/"), stamp_ros)
            except (tf2_ros.TransformException, ValueError) as error:
                may_come = not isinstance(error, ValueError)  # as of a name with NUL
                if may_come and time.monotonic() < end and not self.is_shut_down:
                    time.sleep(0.01)
                    continue
                reason = str(error).lstrip(", ")  # tf2's may begin with nothing
                raise FrameError(
                    f"tf has no transform from {source!r} to {target!r}: {reason}"
                ) from None
            p, q = found.transform.translation, found.transform.rotation
            return pose_matrix((p.x, p.y, p.z), (q.x, q.y, q.z, q.w))

    def forget_transforms(self) -> None:
        """Forget where moving frames were."""
        self._tf()[0].clear()

    def parameters(
        self,
        parameters: Sequence[Parameter],
        on_change: Callable[[Mapping[str, Value]], None] | None = None,
    ) -> dict[str, Value]:
        """Declare parameters and return their values."""
        self._names = tuple(parameter.name for parameter in parameters)
        given = self._given_to_this_life({p.name for p in parameters if p.once})
        self._parameters = ParameterSet(
            parameters,
            given,
            on_change
            and (lambda changed: guarded(self.log, "parameters", lambda: on_change(changed))),
        )
        return dict(self._parameters.values)

    def origins(self) -> Mapping[str, str]:
        """Return where the values of parameters were given, in words."""
        return {
            name: "as an argument"
            if name in self._arguments
            else f"on the parameter server, as {self.node_name}/{name}"
            for name in self._parameters.given
        }

    def log(self, level: Level, text: str) -> None:
        """Write a line to the node's log."""
        write = {
            "debug": rospy.logdebug,
            "info": rospy.loginfo,
            "warning": rospy.logwarn,
            "error": rospy.logerr,
        }[level]
        write("%s", log_text(text))

    @property
    def is_shut_down(self) -> bool:
        """Whether the node is to end."""
        return self._is_ending or bool(rospy.is_shutdown())

    def spin(self) -> None:
        """Return when the node is to end."""
        try:
            while not self.is_shut_down:
                time.sleep(0.1)
        except KeyboardInterrupt:
            self._is_ending = True

    def shut_down(self) -> None:
        """End the node."""
        if not rospy.is_shutdown():
            # Ctrl-C amid a request leaves that connection unfit for one more, which mends it.
            for _ in range(3):
                with contextlib.suppress(Exception):  # or the roscore is gone
                    if owns_its_name():
                        self._forget(self._names)
                        self._respawn.taken()
                        if self._may_return:
                            self._respawn.keep({**self._given, **self._parameters.given})
                    break
        self._end()

    def _given_to_this_life(self, once: set[str]) -> dict[str, Any]:
        """Return parameters on the server, and those that an earlier life has kept.

        Args:
            once: names of those that no other run is to find on the server.
        """
        there = rospy.get_param(rospy.get_name(), {})
        if not isinstance(there, Mapping):
            raise HypermapError(
                f"parameter {rospy.get_name()} is {there!r}, but should hold those of the node: "
                f"rosparam delete {rospy.get_name()}"
            )
        kept = self._respawn.taken()
        there = {name: value for name, value in there.items() if name != RESPAWN}
        for name in kept.keys() - there.keys() - once:
            rospy.set_param(f"~{name}", kept[name])
        given = {**kept, **there}
        self._given = {name: given[name] for name in self._names if name in given}
        self._forget(once)
        self._respawn.keep({name: self._given[name] for name in once & self._given.keys()})
        return given

    def _end(self) -> None:
        self._is_ending = True
        self._watch.close()
        rospy.signal_shutdown("asked to")

    def _forget(self, names: Iterable[str]) -> None:
        """Take private parameters from the parameter server."""
        there = rospy.get_param(rospy.get_name(), {})
        for name in set(there if isinstance(there, Mapping) else ()) & set(names):
            with contextlib.suppress(KeyError):  # somebody else was faster
                rospy.delete_param(f"~{name}")

    def _take_signals(self) -> None:
        # A script's background process inherits that Ctrl-C is ignored; roslaunch sends it.
        for number in end_signals():
            signal.signal(number, self._interrupt)
        before = sys.unraisablehook

        def pass_on(lost: sys.UnraisableHookArgs) -> None:
            # A finalizer drops an interrupt that comes while it runs; the node ends all the same.
            if not (self._is_ending and issubclass(lost.exc_type, KeyboardInterrupt)):
                before(lost)

        sys.unraisablehook = pass_on

    def _interrupt(self, number: int, _: object) -> None:
        self._is_ending = True
        self._may_return &= number == signal.SIGTERM
        raise KeyboardInterrupt

    def _tf(self) -> tuple[Any, float]:
        with self._lock:
            if self._buffer is None:
                self._buffer = tf2_ros.Buffer(debug=False)
                self._listener = TransformListener(self._buffer)
                self._tf_began = time.monotonic()
            return self._buffer, self._tf_began


class _Closing(Closing):
    def close(self) -> None:
        if rospy.is_shutdown():  # which has closed everything
            self._close = None
        super().close()


class _Publisher(_Closing):
    def __init__(self, publisher: Any) -> None:
        super().__init__(lambda: _unregister(publisher))
        self._publisher = publisher

    @property
    def listeners(self) -> int:
        return 0 if self._close is None else int(self._publisher.get_num_connections())

    def publish(self, message: Message) -> None:
        try:
            self._publisher.publish(message)
        except rospy.ROSException:
            if self._close is not None and not rospy.is_shutdown():
                raise


def _unregister(topic: Any) -> None:
    """Close a topic with its epoll, which rospy leaves to the garbage collector."""
    connections = topic.impl
    topic.unregister()
    if connections is not None and connections.closed:
        with contextlib.suppress(AttributeError):  # of other systems, which have no epoll
            connections.connection_poll.poller.close()


def _end_threads_with_node() -> None:
    """Let the threads of this node end as soon as it does.

    rospy closes the socket of the node's XML-RPC server, for which the server's thread then asks
    without a pause, and waits up to half a second for the thread that connects topics.
    """
    for node in [getattr(hook, "__self__", None) for hook in rospy.core._shutdown_hooks]:
        if isinstance(node, rosgraph.xmlrpc.XmlRpcNode) and node.server is not None:
            rospy.core.add_shutdown_hook(partial(_end_threads, node.server, node.handler.reg_man))


def _end_threads(server: Any, connector: Any, _reason: str) -> None:
    with connector.cond:
        connector.cond.notify_all()
    threading.Thread(target=server.shutdown, daemon=True).start()  # which waits for the end


def _resolved(name: str) -> str:
    return name if name.startswith("/") else f"~{name}"
