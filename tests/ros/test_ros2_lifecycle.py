"""How a node of ROS 2 starts and ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from typing import Any

import pytest

from hypermap.core.errors import HypermapError

from .amid_locks import signals_amid_locks
from .conftest import wait_for
from .fake_rclpy import other_node
from .fake_rclpy_node import Graph
from .ros2_fixtures import Idle, graph, make_port, port

__all__ = ["graph", "make_port", "port"]


def test_a_node_starts_by_itself(graph: Graph, make_port: Any) -> None:
    port, node = make_port(), Idle()
    port.manage(node)
    assert node.calls == ["configure", "activate"]
    assert graph.node("/hypermap_server").state == "active"


def test_without_autostart_a_lifecycle_manager_starts_it(graph: Graph, make_port: Any) -> None:
    port, node = make_port("hypermap_server", "--ros-args", "-p", "autostart:=false"), Idle()
    port.manage(node)
    ours = graph.node("/hypermap_server")
    assert node.calls == []
    steps = ["configure", "activate", "deactivate", "activate", "deactivate", "cleanup"]
    for step in steps:
        assert ours.change_state(step)
    assert node.calls == steps
    assert ours.state == "unconfigured"


def test_a_start_that_fails_is_the_error_of_the_program(graph: Graph, make_port: Any) -> None:
    port, node = make_port(), Idle()
    node.fails["configure"] = HypermapError("lab.hmap: there is no such file")
    with pytest.raises(HypermapError, match="no such file"):
        port.manage(node)
    assert graph.logged == []  # the program prints it
    assert not graph.ok
    assert graph.nodes == []


def test_a_transition_that_fails_leaves_the_state(graph: Graph, make_port: Any) -> None:
    port, node = make_port("hypermap_server", "--ros-args", "-p", "autostart:=false"), Idle()
    node.fails["configure"] = HypermapError("lab.hmap: there is no such file")
    port.manage(node)
    ours = graph.node("/hypermap_server")
    assert not ours.change_state("configure")
    assert ours.state == "unconfigured"
    assert ("error", "configure: lab.hmap: there is no such file") in graph.logged
    node.fails.clear()
    assert ours.change_state("configure")
    node.fails["activate"] = ValueError("a bug")
    assert not ours.change_state("activate")
    assert ours.state == "inactive"
    assert node.calls[-2:] == ["activate", "deactivate"]  # what was begun is undone
    assert "Traceback" in graph.logged[-1][1]


def test_a_wrong_transition_does_not_end_the_node(graph: Graph, port: Any) -> None:
    ours = graph.node("/hypermap_server")
    assert not ours.change_state("activate")  # is active already; the executor raises in Humble
    wait_for(lambda: any("No transition" in text for _, text in graph.logged), "the refusal")
    assert not port.is_shut_down
    assert ours.change_state("deactivate")


def test_a_node_ends_in_order(graph: Graph, make_port: Any) -> None:
    port, node = make_port(), Idle()
    port.manage(node)
    threading.Timer(0.2, port.shut_down).start()
    port.spin()
    assert node.calls == ["configure", "activate", "deactivate", "cleanup"]
    assert port.is_shut_down
    assert not graph.ok
    assert graph.nodes == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_end_it_while_it_can_still_publish(
    graph: Graph, make_port: Any, number: signal.Signals
) -> None:
    port, node = make_port(), Idle()
    last = port.publisher("goodbye", "std_msgs/String", latched=True)
    node.deactivate = lambda: last.publish(port.message("std_msgs/String")(data="bye"))  # type: ignore[method-assign]
    port.manage(node)
    before = signal.getsignal(number)

    def send() -> None:
        wait_for(lambda: signal.getsignal(number) is not before, "the node to take signals")
        os.kill(os.getpid(), number)

    threading.Thread(target=send).start()
    port.spin()
    assert graph.latest("/hypermap_server/goodbye").data == "bye"
    assert signal.getsignal(number) is before


@pytest.mark.parametrize(("name", "is_warned"), [("hypermap_server", True), ("other", False)])
def test_a_node_warns_of_another_with_its_name(
    graph: Graph, make_port: Any, monkeypatch: pytest.MonkeyPatch, name: str, is_warned: bool
) -> None:
    port = make_port()
    port.manage(Idle())
    monkeypatch.setattr("hypermap.ros.ros2.port._DISCOVERY", 0.0)
    monkeypatch.setattr("hypermap.ros.ros2.port.time.sleep", lambda _: None)
    looked = port._warn_of_namesakes
    monkeypatch.setattr(port, "_warn_of_namesakes", lambda: (looked(), port.shut_down()))
    with other_node(graph, name):
        port.spin()
    assert any("another node is named /hypermap_server" in t for _, t in graph.logged) == is_warned


def test_a_node_whose_ros_ends_while_it_looks_for_others_ends_in_order(
    graph: Graph, make_port: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    port = make_port()
    port.manage(Idle())
    monkeypatch.setattr("hypermap.ros.ros2.port._DISCOVERY", 0.0)

    def names() -> Any:
        port.shut_down()
        raise RuntimeError("the given context is not valid")

    monkeypatch.setattr(port._node, "get_node_names_and_namespaces", names)
    port.spin()
    assert not [text for level, text in graph.logged if level == "error"]


@pytest.mark.timeout(60)
def test_a_signal_waits_for_no_lock(make_port: Any) -> None:
    port = make_port()
    port.manage(Idle())
    port.shut_down()
    with signals_amid_locks():
        port.spin()
    assert port.is_shut_down


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_amid_the_start_ends_it_in_order_and_another_disturbs_nothing(
    graph: Graph, make_port: Any, number: signal.Signals
) -> None:
    port, node = make_port(), Idle()
    saved: list[str] = []

    def activate() -> None:
        os.kill(os.getpid(), number)
        saved.append("too much")

    def cleanup() -> None:
        os.kill(os.getpid(), number)  # as `ros2 launch` sends it after a terminal
        saved.append("the map")

    node.activate, node.cleanup = activate, cleanup  # type: ignore[method-assign]
    before = signal.getsignal(number)
    with pytest.raises(KeyboardInterrupt):
        port.manage(node)
    assert saved == ["the map"]
    assert node.calls == ["configure", "deactivate"]
    assert not [text for level, text in graph.logged if level == "error"]
    assert graph.nodes == []
    assert signal.getsignal(number) is before


def test_a_signal_between_the_node_and_its_state_ends_it_in_order(
    graph: Graph, make_port: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    port, node = make_port(), Idle()
    monkeypatch.setattr(  # what ROS still does once the node is active
        "hypermap.ros.ros2.life.Bond", lambda _: os.kill(os.getpid(), signal.SIGINT)
    )
    with pytest.raises(KeyboardInterrupt):
        port.manage(node)
    assert node.calls == ["configure", "activate", "deactivate", "cleanup"]
    assert not [text for level, text in graph.logged if level == "error"]


def test_a_signal_amid_the_configuration_cleans_nothing_up(graph: Graph, make_port: Any) -> None:
    port, node = make_port(), Idle()
    node.configure = lambda: os.kill(os.getpid(), signal.SIGINT)  # type: ignore[method-assign]
    with pytest.raises(KeyboardInterrupt):
        port.manage(node)
    assert node.calls == []
    assert not [text for level, text in graph.logged if level == "error"]


def test_a_callback_that_does_not_end_keeps_no_node_from_ending(
    graph: Graph, make_port: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    port, node = make_port(), Idle()
    port.manage(node)
    may_end = threading.Event()
    monkeypatch.setattr("hypermap.ros.ros2.ending.LIMIT", 0.1)
    # rclpy waits so for callbacks that run, whatever it is given as a limit.
    monkeypatch.setattr(port._executor, "shutdown", lambda: may_end.wait(240))
    threading.Timer(0.2, port.shut_down).start()
    port.spin()
    may_end.set()
    assert port.is_stuck
    assert node.calls[-1] == "cleanup"
    assert ("error", "a callback does not end; the node ends without it") in graph.logged


STUCK = """
import threading
from concurrent.futures import ThreadPoolExecutor
from hypermap.ros.nodes import run_node

class Port:
    is_stuck = True
    def manage(self, node): ThreadPoolExecutor(1).submit(threading.Event().wait)
    def spin(self): print("saved", flush=True)
    def shut_down(self): pass

run_node(Port(), None)
"""


def test_a_program_with_a_stuck_thread_ends() -> None:
    done = subprocess.run(
        [sys.executable, "-c", STUCK], capture_output=True, text=True, timeout=240, check=False
    )
    assert (done.returncode, done.stdout) == (1, "saved\n"), done.stderr


def test_a_context_that_others_shut_down_ends_the_node(graph: Graph, make_port: Any) -> None:
    port = make_port()
    port.manage(Idle())
    threading.Timer(0.2, lambda: setattr(graph, "ok", False)).start()
    port.spin()
    assert graph.nodes == []


def test_a_shutdown_from_outside_is_not_repeated(graph: Graph, make_port: Any) -> None:
    port, node = make_port(), Idle()
    port.manage(node)
    assert graph.node("/hypermap_server").change_state("shutdown")
    assert node.calls[-2:] == ["deactivate", "cleanup"]
    port.shut_down()
    port.spin()
    assert node.calls[-2:] == ["deactivate", "cleanup"]
    assert not [text for level, text in graph.logged if level == "error"]


def test_wrong_arguments_are_an_error_of_the_operator(make_port: Any, graph: Graph) -> None:
    with pytest.raises(HypermapError, match="hypermap_server"):
        make_port("hypermap_server", "--ros-args", "-p", "file")
    assert not graph.ok
