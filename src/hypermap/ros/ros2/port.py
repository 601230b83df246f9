"""ROS 2 as a port of our nodes: Humble, Jazzy and newer."""

from __future__ import annotations

import math
import threading
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import HypermapError
from hypermap.ros.callbacks import Closing, guarded
from hypermap.ros.log_text import log_text
from hypermap.ros.port import Closable, Level, Message, Node, Parameter, Publisher, Value

try:
    import rclpy
    from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
    from rclpy.clock import Clock, ClockType
    from rclpy.exceptions import NameValidationException
    from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
    from rclpy.signals import SignalHandlerOptions
except ImportError as missing:
    raise HypermapError(
        f"rclpy is missing ({missing}): source /opt/ros/DISTRO/setup.bash, and use the Python "
        "version that it is for (a virtual environment with --system-site-packages)"
    ) from None

from hypermap.ros.ros2.ending import end_executor
from hypermap.ros.ros2.entities import RclpyPublisher, resolved, valid
from hypermap.ros.ros2.life import LifecycleNode
from hypermap.ros.ros2.messages import message_class, service_class
from hypermap.ros.ros2.parameters import Changes, declared, overrides, warn_of_others
from hypermap.ros.ros2.qos import publisher_qos, subscription_qos
from hypermap.ros.ros2.tf import Transforms
from hypermap.ros.signals import on_end_signals

_THREADS = 4
_DISCOVERY = 2.0  # s after which a node knows the others
_AUTOSTART = Parameter(
    "autostart",
    True,
    "Whether the node configures and activates itself; false leaves it to a lifecycle manager.",
)


class Ros2Port:
    """A ROS 2 lifecycle node; there is one in a process.

    Callbacks run in threads of their own, those of one topic or timer one after another.

    Args:
        name: the node's name, unless the arguments remap it.
        argv: the program's arguments, ROS's among them.

    Raises:
        HypermapError: If ROS does not take the arguments.

    Attributes:
        is_stuck: whether the node has ended, but a callback of it has not.
    """

    def __init__(self, name: str, argv: Sequence[str] | None = None) -> None:
        self.is_stuck = False
        self._is_ending = False  # no event: a handler of signals could wait for its lock
        self._closed = False
        self._static: Publisher | None = None
        self._changes: Changes | None = None
        try:
            # Signals are ours: the node still publishes and logs while it ends.
            rclpy.init(
                args=None if argv is None else list(argv),
                signal_handler_options=SignalHandlerOptions.NO,
            )
            self._node = LifecycleNode(name, self.log)
        except (RuntimeError, NameValidationException) as error:
            _shut_down_rclpy()
            raise HypermapError(f"ROS 2 does not start the node {name!r}: {error}") from None
        self._executor = MultiThreadedExecutor(num_threads=_THREADS)
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._run, args=(self._executor,), daemon=True)
        self._transforms = Transforms(self._node.get_name(), self._node.get_clock(), self._run)

    @property
    def node_name(self) -> str:
        """The node's full name."""
        return str(self._node.get_fully_qualified_name())

    def message(self, type_name: str) -> type[Any]:
        """Return the class of a message."""
        return message_class(type_name)

    def response(self, type_name: str) -> type[Any]:
        """Return the class of a service's response."""
        response: type[Any] = service_class(type_name).Response
        return response

    def publisher(self, topic: str, type_name: str, *, latched: bool = False) -> Publisher:
        """Publish on a topic; what is latched is transient local."""
        kind = message_class(type_name)
        with valid(topic):
            made = self._node.create_publisher(kind, resolved(topic), publisher_qos(latched))
        return RclpyPublisher(self._node, made)

    def topic_type(self, topic: str) -> str | None:
        """Return the type of a topic that someone publishes or listens to, as PACKAGE/NAME."""
        wanted = self._node.resolve_topic_name(resolved(topic))
        types = dict(self._node.get_topic_names_and_types()).get(wanted, [])
        return types[0].replace("/msg/", "/") if types else None

    def subscribe(
        self,
        topic: str,
        type_name: str,
        callback: Callable[[Message], None],
        *,
        latched: bool = False,
        queue: int = 1,
    ) -> Closable:
        """Call back with each message of a topic, in order."""

        def receive(message: Message) -> None:
            self._guarded(topic, lambda: callback(message))

        kind = message_class(type_name)
        with valid(topic):
            made = self._node.create_subscription(
                kind,
                resolved(topic),
                receive,
                subscription_qos(type_name, latched=latched, queue=queue),
                callback_group=MutuallyExclusiveCallbackGroup(),
            )
        return Closing(lambda: self._node.destroy_subscription(made))

    def service(
        self,
        name: str,
        type_name: str,
        handler: Callable[[Message], Message],
        failed: Callable[[str], Message],
    ) -> Closable:
        """Offer a service. Every request is answered, if need be by `failed`."""

        def handle(request: Message, _: Message) -> Message:
            try:
                return handler(request)
            except HypermapError as error:
                self.log("error", f"{name}: {error}")
                return failed(str(error))
            except Exception as error:
                self._log_bug(name)
                return failed(f"internal error: {error!r}")

        kind = service_class(type_name)
        with valid(name):
            made = self._node.create_service(
                kind, resolved(name), handle, callback_group=ReentrantCallbackGroup()
            )
        return Closing(lambda: self._node.destroy_service(made))

    def timer(self, period: float, callback: Callable[[], None]) -> Closable:
        """Call back every `period` seconds, whatever is done to the clocks of the node."""

        def ring() -> None:
            self._guarded("a timer", callback)

        group = MutuallyExclusiveCallbackGroup()
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        made = self._node.create_timer(period, ring, callback_group=group, clock=steady)
        return Closing(lambda: self._node.destroy_timer(made))

    def now(self) -> int:
        """Return the time [ns]; that of `/clock` with the parameter `use_sim_time`."""
        return int(self._node.get_clock().now().nanoseconds)

    def stamp(self, nanoseconds: int) -> Message:
        """Return a time as messages carry it."""
        seconds, rest = divmod(int(nanoseconds), 1_000_000_000)
        return message_class("builtin_interfaces/Time")(sec=seconds, nanosec=rest)

    def static_transforms(self, transforms: Sequence[Message]) -> None:
        """Make transforms known to everyone, instead of those of an earlier call.

        Some versions of tf2_ros' broadcaster add to what they sent before, others replace it; so
        this publishes what it publishes, as one message.
        """
        if self._static is None:
            self._static = self.publisher("/tf_static", "tf2_msgs/TFMessage", latched=True)
        self._static.publish(message_class("tf2_msgs/TFMessage")(transforms=list(transforms)))

    def lookup(
        self, target: str, source: str, stamp: int | None = None, timeout: float = 0.0
    ) -> NDArray[np.float64]:
        """Return `target_T_source`, shape (4, 4)."""
        return self._transforms.lookup(target, source, stamp, timeout)

    def forget_transforms(self) -> None:
        """Forget where moving frames were."""
        self._transforms.forget()

    def parameters(
        self,
        parameters: Sequence[Parameter],
        on_change: Callable[[Mapping[str, Value]], None] | None = None,
    ) -> dict[str, Value]:
        """Declare parameters, with descriptions and ranges, and return their values."""
        if self._changes is not None:
            self._node.remove_on_set_parameters_callback(self._changes)
            self._changes = None
        values = {parameter.name: declared(self._node, parameter) for parameter in parameters}
        warn_of_others(self._node, (*parameters, _AUTOSTART), self.log)
        if on_change is not None:
            self._changes = Changes(parameters, on_change, self._log_bug)
            self._node.add_on_set_parameters_callback(self._changes)
        return values

    def origins(self) -> Mapping[str, str]:
        """Return where the values of parameters were given, in words."""
        return dict.fromkeys(overrides(self._node), "as an argument or in a file of parameters")

    def log(self, level: Level, text: str) -> None:
        """Write a line to the node's log."""
        text = log_text(text)
        logger = self._node.get_logger()
        # rclpy remembers the level of each line of code that logs, and refuses another there.
        if level == "debug":
            logger.debug(text)
        elif level == "info":
            logger.info(text)
        elif level == "warning":
            logger.warning(text)
        else:
            logger.error(text)

    def manage(self, node: Node) -> None:
        """Let ROS's lifecycle call the node; with `autostart`, bring it to life at once.

        Raises:
            HypermapError: If it cannot be configured or activated.
        """
        with on_end_signals(self._interrupt):
            try:
                self._node.manage(node)
                self._thread.start()
                if declared(self._node, _AUTOSTART):
                    self._node.start()
                else:
                    self.log("info", "waiting for a lifecycle manager to configure and activate")
            except BaseException:
                self._close()
                raise

    @property
    def is_shut_down(self) -> bool:
        """Whether the node is to end."""
        return self._is_ending or not rclpy.ok()

    def spin(self) -> None:
        """Return when the node is to end, and has ended."""
        with on_end_signals(lambda *_: self.shut_down()):
            try:
                look_at = time.monotonic() + _DISCOVERY
                while not self.is_shut_down:
                    time.sleep(0.1)
                    if time.monotonic() >= look_at:
                        look_at = math.inf
                        self._guarded("rclpy", self._warn_of_namesakes)
            finally:
                self._close()

    def shut_down(self) -> None:
        """End the node: `spin` returns."""
        self._is_ending = True

    def _interrupt(self, *_: object) -> None:
        """End the start at once. What comes again, as from `ros2 launch`, disturbs no end."""
        if not self._is_ending:
            self._is_ending = True
            raise KeyboardInterrupt

    def _run(self, executor: Any) -> None:
        """Run an executor until the node ends, whatever a callback of rclpy's own raises."""
        while not self.is_shut_down:
            self._guarded("rclpy", executor.spin)
        self._is_ending = True

    def _close(self) -> None:
        self._is_ending = True
        if self._closed:
            return
        self._closed = True
        self._node.finish()
        ended = self._transforms.close()
        self.is_stuck = not (end_executor(self._executor, self._thread) and ended)
        if self.is_stuck:  # what it uses must stay; all that is to be saved is
            self.log("error", "a callback does not end; the node ends without it")
            return
        self._node.destroy_node()
        _shut_down_rclpy()

    def _warn_of_namesakes(self) -> None:
        """Say that another node has this one's name, which ROS 2 lets happen."""
        others = self._node.get_node_names_and_namespaces()
        if others.count((self._node.get_name(), self._node.get_namespace())) > 1:
            self.log(
                "warning",
                f"another node is named {self.node_name}, too, and may answer calls of this one's "
                "services: end it, or name this one by --ros-args -r __node:=NAME",
            )

    def _guarded(self, what: str, call: Callable[[], None]) -> None:
        def unless_shut_down() -> None:
            try:
                call()
            except ExternalShutdownException:
                self.shut_down()

        guarded(self.log, what, unless_shut_down, lambda: self.is_shut_down)

    def _log_bug(self, what: str) -> None:
        self.log("error", f"{what}: {traceback.format_exc()}")


def _shut_down_rclpy() -> None:
    if rclpy.ok():
        rclpy.shutdown()
