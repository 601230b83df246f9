"""Nodes of the fake rclpy: what they publish, hear, serve and are set to."""

from __future__ import annotations

import inspect
import itertools
import math
import re
import threading
import time as wall
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import yaml

from .fake_rclpy_values import (
    Clock,
    DurabilityPolicy,
    Duration,
    InvalidHandle,
    InvalidTopicNameException,
    Logger,
    Parameter,
    ParameterException,
    ParameterType,
    QoSProfile,
    compatible,
)
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


class Publisher:
    def __init__(self, node: Node, msg_type: Any, topic: str, qos: QoSProfile) -> None:
        self.node, self.msg_type, self.qos = node, msg_type, qos
        self.full_name = node.resolved(topic)

        self.is_acknowledged = True

    def publish(self, msg: Any) -> None:
        graph = self.node.graph
        self.is_acknowledged = False
        if self not in self.node._publishers:
            raise InvalidHandle("cannot use Destroyable because destruction was requested")
        assert graph.ok, "publisher's context is invalid"
        assert isinstance(msg, self.msg_type), f"{self.full_name} got {msg!r}"
        data = graph.types.to_cdr(msg)
        if self.qos.durability == DurabilityPolicy.TRANSIENT_LOCAL:
            graph.kept[self.full_name] = data, msg.TYPE_NAME
        for subscription in graph.subscriptions(self.full_name):
            subscription.offer(self, data)

    def wait_for_all_acked(self, timeout: Duration | None = None) -> bool:
        assert timeout is not None, "a subscriber that was killed acknowledges nothing"
        self.is_acknowledged = True
        return True

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
    def __init__(self, node: Node, period: float, callback: Callable[[], None], clock: Any) -> None:
        self.node, self.period, self.callback, self.clock = node, period, callback, clock
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
        self._parameter_overrides = {
            name: Parameter(name, value=yaml.safe_load(text)) for name, text in values
        }
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
        end = wall.monotonic() + 60
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

    def get_namespace(self) -> str:
        return self._namespace

    def get_node_names_and_namespaces(self) -> list[tuple[str, str]]:
        return [(node.get_name(), node.get_namespace()) for node in self.graph.nodes]

    def get_fully_qualified_name(self) -> str:
        return f"{self._namespace.rstrip('/')}/{self._name}"

    def get_topic_names_and_types(self) -> list[tuple[str, list[str]]]:
        types = self.graph.topics().items()
        return [(topic, [name]) for topic, name in types]

    def resolve_topic_name(self, topic: str) -> str:
        return self.resolved(topic)

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
        made = Timer(self, timer_period_sec, callback, clock)
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
        given = self._parameter_overrides.get(name)
        parameter = Parameter(name, value=value if given is None else given.value)
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
