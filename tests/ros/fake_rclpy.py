"""The part of rclpy, tf2_ros and rcl_interfaces that our ROS 2 port uses, within one process.

It is as strict as rclpy where that matters to a node: types of message fields, quality of service,
parameters, names, the lifecycle, log levels. Everything that is published, asked and answered goes
through CDR. `rclpy_signatures.py` holds the signatures to which test_rclpy_signatures.py holds it.

Source: ros2/rclpy and ros2/geometry2, at the commits named in rclpy_signatures.py.
"""

from __future__ import annotations

import enum
import inspect
import itertools
import math
import re
import threading
import time as wall
import types
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import yaml

from .fake_rclpy_values import (
    Clock,
    DurabilityPolicy,
    Duration,
    ExternalShutdownException,
    HistoryPolicy,
    InvalidHandle,
    InvalidTopicNameException,
    JumpThreshold,
    Logger,
    MutuallyExclusiveCallbackGroup,
    NameValidationException,
    Parameter,
    ParameterException,
    ParameterType,
    QoSProfile,
    ReentrantCallbackGroup,
    ReliabilityPolicy,
    Time,
    compatible,
)
from .fake_tf2 import Buffer, TransformException, TransformListener
from .strict_messages import StrictTypes


@dataclass
class Graph:
    """What rclpy's nodes of this process share, and what a test sees of it."""

    types: StrictTypes
    ok: bool = False
    arguments: list[str] = field(default_factory=list)
    nodes: list[Any] = field(default_factory=list)
    logged: list[tuple[str, str]] = field(default_factory=list)
    kept: dict[tuple[str, str], bytes] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    time: int | None = None  # ns, of /clock
    ends: threading.Event = field(default_factory=threading.Event)
    errors: list[Exception] = field(default_factory=list)  # what executors are to raise

    def publishers(self, topic: str) -> list[Any]:
        return [p for node in self.nodes for p in node._publishers if p.full_name == topic]

    def subscriptions(self, topic: str) -> list[Any]:
        return [s for node in self.nodes for s in node._subscriptions if s.full_name == topic]

    def node(self, name: str) -> Any:
        return next(node for node in self.nodes if node.get_fully_qualified_name() == name)

    def topics(self) -> dict[str, str]:
        return {p.full_name: p.msg_type.TYPE_NAME for n in self.nodes for p in n._publishers}

    def services(self) -> dict[str, Any]:
        return {s.full_name: s for node in self.nodes for s in node._services}

    def latest(self, topic: str) -> Any:
        """Return what a late subscriber that asks for transient local gets."""
        data, name = self.kept[topic]
        return self.types.from_cdr(data, name)

    def call(self, name: str, /, **request: Any) -> Any:
        """Call a service as another node does."""
        service = self.services()[name]
        service.node.needs_executor()
        halves = service.srv_type
        data = self.types.to_cdr(halves.Request(**request))
        given = self.types.from_cdr(data, halves.Request.TYPE_NAME)
        response = service.callback(given, halves.Response())
        assert isinstance(response, halves.Response), f"{name} answered {response!r}"
        return self.types.from_cdr(self.types.to_cdr(response), halves.Response.TYPE_NAME)


# rclpy.node


class Publisher:
    def __init__(self, node: Node, msg_type: Any, topic: str, qos: QoSProfile) -> None:
        self.node, self.msg_type, self.qos = node, msg_type, qos
        self.full_name = node.resolved(topic)

    def publish(self, msg: Any) -> None:
        graph = self.node.graph
        if self not in self.node._publishers:
            raise InvalidHandle("cannot use Destroyable because destruction was requested")
        assert graph.ok, "publisher's context is invalid"
        assert isinstance(msg, self.msg_type), f"{self.full_name} got {msg!r}"
        data = graph.types.to_cdr(msg)
        if self.qos.durability == DurabilityPolicy.TRANSIENT_LOCAL:
            graph.kept[self.full_name] = data, msg.TYPE_NAME
        for subscription in graph.subscriptions(self.full_name):
            subscription.offer(self, data)

    def get_subscription_count(self) -> int:
        return len(self.node.graph.subscriptions(self.full_name))


class Subscription:
    def __init__(self, node: Node, msg_type: Any, topic: str, callback: Any, qos: Any) -> None:
        self.node, self.msg_type, self.callback, self.qos = node, msg_type, callback, qos
        self.full_name = node.resolved(topic)
        self.callback_group: Any = None

    def offer(self, publisher: Publisher, data: bytes) -> None:
        assert publisher.msg_type is self.msg_type
        if self not in self.node._subscriptions:
            return
        if not compatible(publisher.qos, self.qos):
            self.node.graph.warnings.append(self.full_name)
            return
        self.node.needs_executor()
        self.callback(self.node.graph.types.from_cdr(data, self.msg_type.TYPE_NAME))


class Service:
    def __init__(self, node: Node, srv_type: Any, name: str, callback: Any) -> None:
        self.node, self.srv_type, self.callback = node, srv_type, callback
        self.full_name = node.resolved(name)
        self.callback_group: Any = None


class Timer:
    def __init__(self, node: Node, period: float, callback: Callable[[], None]) -> None:
        self.node, self.period, self.callback = node, period, callback
        self.callback_group: Any = None


class Node:
    graph: Graph  # set where the modules are made

    def __init__(
        self,
        node_name: str,
        *,
        context: Any = None,
        cli_args: list[str] | None = None,
        namespace: str | None = None,
        use_global_arguments: bool = True,
        enable_rosout: bool = True,
        start_parameter_services: bool = True,
        parameter_overrides: list[Parameter] | None = None,
        allow_undeclared_parameters: bool = False,
        automatically_declare_parameters_from_overrides: bool = False,
    ) -> None:
        assert self.graph.ok, "rclpy.init() has not been called"
        words = [*(cli_args or []), *self.graph.arguments]  # the node's own come first
        remaps = [w.split(":=") for o, w in itertools.pairwise(words) if o == "-r"]
        values = [w.split(":=") for o, w in itertools.pairwise(words) if o == "-p"]
        rules = dict(reversed(remaps))
        self._name, self._namespace = rules.get("__node", node_name), rules.get("__ns", "/")
        self._rules = rules
        self._overrides = {name: yaml.safe_load(text) for name, text in values}
        self._publishers: list[Publisher] = []
        self._subscriptions: list[Subscription] = []
        self._services: list[Service] = []
        self._timers: list[Timer] = []
        self._parameters: dict[str, Parameter] = {}
        self._descriptors: dict[str, Any] = {}
        self._callbacks_on_set: list[Any] = []
        self._clock, self._logger = Clock(self.graph), Logger(self.graph)
        self.executor: Any = None
        self.graph.nodes.append(self)

    def needs_executor(self) -> None:
        end = wall.monotonic() + 10
        while self.executor is None or not self.executor.spins.is_set():
            assert wall.monotonic() < end, f"no executor runs the node {self._name}"
            wall.sleep(0.005)

    def resolved(self, name: str) -> str:
        bad = re.search(r"[^A-Za-z0-9_/~]|/[0-9]|//|./$|^[0-9]", name)
        if bad or not name:
            raise InvalidTopicNameException(f"Invalid topic name: must not hold {bad}:\n  {name}")
        own = self.get_fully_qualified_name()
        prefix = "" if name.startswith("/") else f"{self._namespace.rstrip('/')}/"
        full = f"{own}{name[1:]}" if name.startswith("~") else f"{prefix}{name}"
        return self._rules.get(name, self._rules.get(full, full))

    def get_name(self) -> str:
        return self._name

    def get_fully_qualified_name(self) -> str:
        return f"{self._namespace.rstrip('/')}/{self._name}"

    def get_clock(self) -> Clock:
        return self._clock

    def get_logger(self) -> Logger:
        return self._logger

    def create_publisher(
        self,
        msg_type: Any,
        topic: str,
        qos_profile: Any,
        *,
        callback_group: Any = None,
        event_callbacks: Any = None,
        qos_overriding_options: Any = None,
    ) -> Publisher:
        self._publishers.append(Publisher(self, msg_type, topic, qos_profile))
        return self._publishers[-1]

    def create_subscription(
        self,
        msg_type: Any,
        topic: str,
        callback: Callable[[Any], None],
        qos_profile: Any,
        *,
        callback_group: Any = None,
        event_callbacks: Any = None,
        qos_overriding_options: Any = None,
        raw: bool = False,
    ) -> Subscription:
        inspect.signature(callback).bind(object())  # rclpy: otherwise it wants a MessageInfo too
        made = Subscription(self, msg_type, topic, callback, qos_profile)
        made.callback_group = callback_group
        self._subscriptions.append(made)
        for publisher in self.graph.publishers(made.full_name):
            if (
                made.qos.durability == DurabilityPolicy.TRANSIENT_LOCAL
                and made.full_name in self.graph.kept
            ):
                data = self.graph.kept[made.full_name][0]
                # As with rclpy, it comes when the caller is done.
                threading.Timer(0.02, made.offer, (publisher, data)).start()
        return made

    def create_service(
        self,
        srv_type: Any,
        srv_name: str,
        callback: Callable[[Any, Any], Any],
        *,
        qos_profile: Any = None,
        callback_group: Any = None,
    ) -> Service:
        made = Service(self, srv_type, srv_name, callback)
        made.callback_group = callback_group
        self._services.append(made)
        return made

    def create_timer(
        self,
        timer_period_sec: float,
        callback: Callable[[], None],
        callback_group: Any = None,
        clock: Any = None,
    ) -> Timer:
        made = Timer(self, timer_period_sec, callback)
        made.callback_group = callback_group
        self._timers.append(made)
        return made

    def destroy_publisher(self, publisher: Publisher) -> bool:
        return _removed(self._publishers, publisher)

    def destroy_subscription(self, subscription: Subscription) -> bool:
        return _removed(self._subscriptions, subscription)

    def destroy_service(self, service: Service) -> bool:
        return _removed(self._services, service)

    def destroy_timer(self, timer: Timer) -> bool:
        return _removed(self._timers, timer)

    def destroy_node(self) -> None:
        for things in (self._publishers, self._subscriptions, self._services, self._timers):
            things.clear()  # type: ignore[attr-defined]
        self.graph.nodes.remove(self)

    # Parameters

    def has_parameter(self, name: str) -> bool:
        return name in self._parameters

    def get_parameter(self, name: str) -> Parameter:
        if name not in self._parameters:
            raise ParameterException(f"Invalid access to undeclared parameter(s): {name}")
        return self._parameters[name]

    def declare_parameter(
        self, name: str, value: Any = None, descriptor: Any = None, ignore_override: bool = False
    ) -> Parameter:
        if name in self._parameters:
            raise ParameterException(f"Parameter(s) already declared: {name}")
        self.graph.types.to_cdr(descriptor)
        descriptor.name = name
        if not descriptor.dynamic_typing:
            descriptor.type = ParameterType.from_parameter_value(value).value
        parameter = Parameter(name, value=self._overrides.get(name, value))
        reason = self._refusal(parameter, descriptor, read_only=False)
        if reason:
            raise ParameterException(reason)
        self._parameters[name], self._descriptors[name] = parameter, descriptor
        return parameter

    def add_on_set_parameters_callback(self, callback: Callable[[list[Parameter]], Any]) -> None:
        self._callbacks_on_set.insert(0, callback)

    def remove_on_set_parameters_callback(self, callback: Callable[[list[Parameter]], Any]) -> None:
        self._callbacks_on_set.remove(callback)

    def set_parameter(self, name: str, value: Any) -> str:
        """Set a parameter as `ros2 param set` does; return why it was refused, or ""."""
        self.needs_executor()
        parameter = Parameter(name, value=value)
        reason = self._refusal(parameter, self._descriptors[name], read_only=True)
        if not reason:
            self._parameters[name] = parameter
        return reason

    def _refusal(self, parameter: Parameter, descriptor: Any, *, read_only: bool) -> str:
        if read_only and descriptor.read_only:
            return f"Trying to set a read-only parameter: {parameter.name}."
        if not descriptor.dynamic_typing and parameter.type_.value != descriptor.type:
            wanted = ParameterType(descriptor.type)
            return f"Wrong parameter type, expected '{wanted}' got '{parameter.type_}'"
        ranges = {
            ParameterType.INTEGER: descriptor.integer_range,
            ParameterType.DOUBLE: descriptor.floating_point_range,
        }.get(parameter.type_)
        if ranges:
            low, high, value = ranges[0].from_value, ranges[0].to_value, parameter.value
            if not (low < value < high or math.isclose(value, low) or math.isclose(value, high)):
                return f"Parameter {parameter.name} out of range Min: {low}, Max: {high}"
        for callback in self._callbacks_on_set:
            result = callback([parameter])
            self.graph.types.to_cdr(result)
            if not result.successful:
                return str(result.reason)
        return ""


def _removed(things: list[Any], thing: Any) -> bool:
    if thing not in things:
        return False
    things.remove(thing)
    return True


# rclpy.lifecycle


class TransitionCallbackReturn(enum.Enum):
    SUCCESS = 97
    FAILURE = 98
    ERROR = 99


@dataclass(frozen=True)
class LifecycleState:
    label: str
    state_id: int


STATES = ("unknown", "unconfigured", "inactive", "active", "finalized")
TRANSITIONS = {
    "configure": ("unconfigured", "inactive"),
    "cleanup": ("inactive", "unconfigured"),
    "activate": ("inactive", "active"),
    "deactivate": ("active", "inactive"),
}


class LifecycleNode(Node):
    def __init__(
        self, node_name: str, *, enable_communication_interface: bool = True, **kwargs: Any
    ) -> None:
        super().__init__(node_name, **kwargs)
        self.state = "unconfigured"

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        return TransitionCallbackReturn.SUCCESS

    on_cleanup = on_activate = on_deactivate = on_shutdown = on_error = on_configure

    def trigger_configure(self) -> TransitionCallbackReturn:
        return self._change("configure")

    def trigger_cleanup(self) -> TransitionCallbackReturn:
        return self._change("cleanup")

    def trigger_activate(self) -> TransitionCallbackReturn:
        return self._change("activate")

    def trigger_deactivate(self) -> TransitionCallbackReturn:
        return self._change("deactivate")

    def trigger_shutdown(self) -> TransitionCallbackReturn:
        return self._change("shutdown")

    def change_state(self, label: str) -> bool:
        """Call the service `change_state`, as `ros2 lifecycle set` does."""
        self.needs_executor()
        try:
            return self._change(label) == TransitionCallbackReturn.SUCCESS
        except RuntimeError as error:  # before Jazzy, this reaches the executor
            self.graph.errors.append(error)
            return False

    def _change(self, label: str) -> TransitionCallbackReturn:
        start, goal = TRANSITIONS.get(label, (self.state, "finalized"))
        if self.state in (f"{label}ing", "finalized") or start != self.state:
            raise RuntimeError(f"No transition matching {label} found for state {self.state}")
        before, self.state = self.state, f"{label}ing"
        try:
            outcome = getattr(self, f"on_{label}")(LifecycleState(before, STATES.index(before)))
        except Exception:
            outcome = TransitionCallbackReturn.ERROR
        if outcome == TransitionCallbackReturn.SUCCESS:
            self.state = goal
        elif outcome == TransitionCallbackReturn.FAILURE:
            self.state = before
        else:
            self.state = "unconfigured"
        return outcome


# rclpy.executors


class Executor:
    graph: Graph

    def __init__(self, *, context: Any = None) -> None:
        self.spins, self._ends = threading.Event(), threading.Event()
        self._nodes: list[Node] = []

    def add_node(self, node: Node) -> bool:
        self._nodes.append(node)
        node.executor = self
        return True

    def spin(self) -> None:
        self.spins.set()
        while self.graph.ok and not self._ends.wait(0.01):
            if self.graph.errors:
                raise self.graph.errors.pop()
        if not self.graph.ok and not self._ends.is_set():
            raise ExternalShutdownException

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        self._ends.set()
        self.spins.clear()
        return True


class SingleThreadedExecutor(Executor):
    pass


class MultiThreadedExecutor(Executor):
    def __init__(self, num_threads: int | None = None, *, context: Any = None) -> None:
        super().__init__(context=context)


# rclpy.signals and rclpy itself


class SignalHandlerOptions(enum.Enum):
    NO, SIGINT, SIGTERM, ALL = range(4)


def rclpy_functions(graph: Graph) -> dict[str, Any]:
    def init(
        *,
        args: list[str] | None = None,
        context: Any = None,
        domain_id: int | None = None,
        signal_handler_options: SignalHandlerOptions | None = None,
    ) -> None:
        if graph.ok:
            raise RuntimeError("Context.init() must only be called once")
        words = list(args or [])
        inside = words.index("--ros-args") if "--ros-args" in words else len(words)
        graph.arguments = words[inside:]
        for option, word in itertools.pairwise(graph.arguments):
            if option == "-p" and ":=" not in word:
                raise RuntimeError(f"Couldn't parse parameter override rule: '-p {word}'")
        graph.ok = True

    def ok(*, context: Any = None) -> bool:
        return graph.ok

    def shutdown(*, context: Any = None, uninstall_handlers: bool | None = None) -> None:
        if not graph.ok:
            raise RuntimeError("Context must be initialized before it can be shutdown")
        graph.ok = False

    return {"init": init, "ok": ok, "shutdown": shutdown}


# The modules


class Package(types.ModuleType):
    """A module of a ROS package's message or service classes."""

    def __init__(self, name: str, find: Callable[[str], Any]) -> None:
        super().__init__(name)
        self.__dict__["find"] = find

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        try:
            return self.find(name)
        except KeyError:
            raise AttributeError(name) from None


def modules(graph: Graph) -> dict[str, Any]:
    """Return all modules by name, of which `graph` is what they share."""
    node = type("Node", (Node,), {"graph": graph})
    life = type("LifecycleNode", (LifecycleNode,), {"graph": graph})
    single = type("SingleThreadedExecutor", (SingleThreadedExecutor,), {"graph": graph})
    multi = type("MultiThreadedExecutor", (MultiThreadedExecutor,), {"graph": graph})
    contents: dict[str, dict[str, Any]] = {
        "rclpy": rclpy_functions(graph),
        "rclpy.callback_groups": _named(MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup),
        "rclpy.clock": _named(JumpThreshold),
        "rclpy.duration": _named(Duration),
        "rclpy.exceptions": _named(NameValidationException, ParameterException),
        "rclpy.executors": {
            "SingleThreadedExecutor": single,
            "MultiThreadedExecutor": multi,
            "ExternalShutdownException": ExternalShutdownException,
        },
        "rclpy.lifecycle": {
            "LifecycleNode": life,
            "TransitionCallbackReturn": TransitionCallbackReturn,
        },
        "rclpy.node": {"Node": node},
        "rclpy.qos": _named(HistoryPolicy, ReliabilityPolicy, DurabilityPolicy, QoSProfile),
        "rclpy.signals": _named(SignalHandlerOptions),
        "rclpy.time": _named(Time),
        "tf2_ros": {
            "Buffer": type("Buffer", (Buffer,), {"types": graph.types}),
            "TransformListener": TransformListener,
            "TransformException": TransformException,
        },
    }
    made: dict[str, Any] = {}
    for name, content in contents.items():
        made[name] = types.ModuleType(name)
        made[name].__dict__.update(content)
        made[name].__path__ = []
    kept: dict[tuple[str, str], Any] = {}
    for package in {name.partition("/")[0] for name in graph.types.store.fielddefs}:
        made[package] = types.ModuleType(package)
        made[package].__path__ = []
        made[f"{package}.msg"] = Package(
            f"{package}.msg", lambda name, package=package: graph.types.message(f"{package}/{name}")
        )
        made[f"{package}.srv"] = Package(
            f"{package}.srv", lambda name, package=package: _service(graph, kept, package, name)
        )
    return made


def _service(graph: Graph, kept: dict[tuple[str, str], Any], package: str, name: str) -> Any:
    if (package, name) not in kept:
        kept[package, name] = graph.types.service(f"{package}/{name}")
    return kept[package, name]


def _named(*things: Any) -> dict[str, Any]:
    return {thing.__name__: thing for thing in things}


@contextmanager
def other_node(graph: Graph, name: str = "other") -> Iterator[Node]:
    """A node beside ours, whose callbacks are called at once."""
    node = type("Node", (Node,), {"graph": graph})(name, use_global_arguments=False)
    node._name = name  # whatever ours was remapped to
    node.executor = Executor()
    node.executor.spins.set()
    yield node
    node.destroy_node()
