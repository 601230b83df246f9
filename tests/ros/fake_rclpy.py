"""The part of rclpy, tf2_ros and rcl_interfaces that our ROS 2 port uses, within one process.

It is as strict as rclpy where that matters to a node: types of message fields, quality of service,
parameters, names, the lifecycle, log levels. Everything that is published, asked and answered goes
through CDR. `rclpy_signatures.py` holds the signatures to which test_rclpy_signatures.py holds it.

Source: ros2/rclpy and ros2/geometry2, at the commits named in rclpy_signatures.py.
"""

from __future__ import annotations

import enum
import itertools
import threading
import types
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from .fake_rclpy_node import Graph, Node
from .fake_rclpy_values import (
    ClockType,
    DurabilityPolicy,
    Duration,
    ExternalShutdownException,
    HistoryPolicy,
    JumpThreshold,
    MutuallyExclusiveCallbackGroup,
    NameValidationException,
    OwnClock,
    ParameterException,
    QoSProfile,
    ReentrantCallbackGroup,
    ReliabilityPolicy,
    Time,
)
from .fake_tf2 import Buffer, TransformException, TransformListener


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
        if self.state not in STATES[1:4]:
            raise RuntimeError("Shutdown transtion not possible")
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
        "rclpy.clock": {"Clock": OwnClock, **_named(ClockType, JumpThreshold)},
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
    """A node next to ours, whose callbacks are called at once."""
    node = type("Node", (Node,), {"graph": graph})(name, use_global_arguments=False)
    node._name = name  # whatever ours was remapped to
    node.executor = Executor()
    node.executor.spins.set()
    yield node
    node.destroy_node()
