"""Our ROS 2 port on the fake of rclpy, with the types of Humble and of Jazzy."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from .fake_rclpy import modules
from .fake_rclpy_node import Graph
from .strict_messages import StrictTypes, humble_store, jazzy_store

STORES = {"humble": humble_store, "jazzy": jazzy_store}


@pytest.fixture(params=sorted(STORES))
def graph(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[Graph]:
    """A ROS 2 graph of this process; its modules are those that `import` finds."""
    shared = Graph(StrictTypes(STORES[request.param]()))
    for name, module in modules(shared).items():
        monkeypatch.setitem(sys.modules, name, module)
    _forget_port()
    yield shared
    _forget_port()


def _forget_port() -> None:
    """Let the port be imported again: it must not keep the rclpy of another test."""
    for name in [name for name in sys.modules if name.startswith("hypermap.ros.ros2")]:
        del sys.modules[name]


@pytest.fixture
def make_port(graph: Graph) -> Iterator[Callable[..., Any]]:
    """Make a port as a program does; it ends with the test."""
    made: list[Any] = []

    def make(name: str = "hypermap_server", *arguments: str) -> Any:
        importlib.import_module("hypermap.ros.ros2.ending").LIMIT = 240.0  # s; nothing is stuck
        ros2 = importlib.import_module("hypermap.ros.ros2.port")
        made.append(ros2.Ros2Port(name, [name, *arguments]))
        return made[-1]

    yield make
    for port in made:
        port._close()


class Idle:
    """A node that does nothing but note what is asked of it."""

    def __init__(self) -> None:
        self.calls: list[str] = []
        self.fails: dict[str, Exception] = {}

    def _note(self, step: str) -> None:
        self.calls.append(step)
        if step in self.fails:
            raise self.fails[step]

    def configure(self) -> None:
        self._note("configure")

    def activate(self) -> None:
        self._note("activate")

    def deactivate(self) -> None:
        self._note("deactivate")

    def cleanup(self) -> None:
        self._note("cleanup")


@pytest.fixture
def port(make_port: Callable[..., Any]) -> Any:
    """A port whose node is active."""
    made = make_port()
    made.manage(Idle())
    return made
