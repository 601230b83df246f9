"""The life of a ROS 1 node, in a process of its own, on a real roscore."""

from __future__ import annotations

import os
import signal
import socket
import socketserver
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from ..roscore import free_port, is_missing, roscore_command
from .conftest import Process

pytestmark = pytest.mark.xdist_group("ros")

NODE = [sys.executable, str(Path(__file__).with_name("port_node.py"))]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_node_ends_cleanly(
    roscore: str, start: Callable[..., Process], number: signal.Signals
) -> None:
    name = f"ending_{number.name.lower()}"
    node = start(*NODE, name)
    node.expect("ready")
    assert not is_missing(f"/{name}/ask")
    assert node.stop(number) == 0
    assert node.output.splitlines()[-2:] == ["ending", "ended"]
    assert "Traceback" not in node.output
    assert is_missing(f"/{name}/ask")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_node_ends_also_if_its_interrupt_gets_lost(
    roscore: str, start: Callable[..., Process], number: int
) -> None:
    script = f"""
import time
from hypermap.ros.ros1.port import Ros1Port
port = Ros1Port("swallows_{number}")
try:
    print("busy", flush=True)
    while True:
        time.sleep(0.01)  # a signal just before a long sleep would be seen after it
except BaseException as error:
    print("lost a", type(error).__name__, flush=True)
port.spin()
port.shut_down()
"""
    node = start(sys.executable, "-c", script)
    node.expect("busy")
    assert node.stop(number) == 0
    assert "lost a KeyboardInterrupt" in node.output


def test_nothing_runs_on_when_a_node_has_ended(roscore: str, start: Callable[..., Process]) -> None:
    script = """
import sys, time, traceback
from hypermap.ros.ros1.port import Ros1Port
port = Ros1Port("quiet")
port.shut_down()
end = time.monotonic() + 30
while time.monotonic() < end:
    stacks = map(traceback.walk_stack, sys._current_frames().values())
    if not any(frame.f_code.co_name == "serve_forever" for stack in stacks for frame, _ in stack):
        sys.exit()
    time.sleep(0.02)
sys.exit("rospy asks for connections to a closed socket, again and again")
"""
    node = start(sys.executable, "-c", script)
    assert node.popen.wait(240) == 0, node.output


def test_rosnode_kill_ends_a_node(roscore: str, start: Callable[..., Process]) -> None:
    node = start(*NODE, "to_kill")
    node.expect("ready")
    start("rosnode", "kill", "/to_kill").expect("killed")
    assert node.popen.wait(240) == 0
    assert node.output.splitlines()[-1] == "ended"


def test_a_second_node_of_that_name_takes_over(roscore: str, start: Callable[..., Process]) -> None:
    first = start(*NODE, "twin")
    first.expect("ready")
    second = start(*NODE, "twin")
    second.expect("ready")
    assert first.popen.wait(240) == 0
    first.expect("ended")
    assert second.popen.poll() is None
    assert not is_missing("/twin/ask")


def test_a_node_that_is_replaced_while_it_logs_leaves_its_name_to_the_other(
    roscore: str, start: Callable[..., Process]
) -> None:
    script = """
from hypermap.ros.ros1.port import Ros1Port
port = Ros1Port("talker")
port.timer(0.001, lambda: port.log("info", "still here"))
port.spin()
port.shut_down()
"""
    first = start(sys.executable, "-c", script)
    first.expect("still here")
    second = start(*NODE, "talker")
    second.expect("ready")
    assert first.popen.wait(240) == 0
    assert second.popen.poll() is None
    assert not is_missing("/talker/ask")


@pytest.mark.parametrize(
    ("uri", "problem"),
    [
        ("http://127.0.0.1:{closed}", "Connection refused"),
        ("http://127.0.0.1:{deaf}", "not a roscore"),
        ("nonsense", "no roscore at ROS_MASTER_URI=nonsense"),
    ],
)
def test_without_a_roscore_a_node_ends_at_once(
    start: Callable[..., Process], needs_ros1: None, uri: str, problem: str
) -> None:
    class Deaf(socketserver.StreamRequestHandler):
        def handle(self) -> None:
            self.wfile.write(b"SSH-2.0-none\r\n")

    with (
        socketserver.TCPServer(("127.0.0.1", 0), Deaf) as server,
        socket.socket() as closed,  # it has a port, so that nobody else has, but does not listen
    ):
        closed.bind(("127.0.0.1", 0))
        threading.Thread(target=server.serve_forever, daemon=True).start()
        uri = uri.format(closed=closed.getsockname()[1], deaf=server.server_address[1])
        node = start(*NODE, "lonely", env={**os.environ, "ROS_MASTER_URI": uri})
        assert node.popen.wait(240) != 0
        server.shutdown()
    last = node.output.splitlines()[-1]
    assert problem in last
    assert f"ROS_MASTER_URI={uri}" in last
    assert "start one with: roscore" in last


def test_a_node_outlives_its_roscore(
    start: Callable[..., Process], needs_ros1: None, tmp_path: Path
) -> None:
    port = free_port()
    environment = {
        **os.environ,
        "ROS_MASTER_URI": f"http://127.0.0.1:{port}",
        "ROS_HOSTNAME": "127.0.0.1",
        "ROS_HOME": str(tmp_path / "home"),
        "PYTHONUNBUFFERED": "1",
    }

    def tool(*words: str) -> Process:
        return start(*words, env=environment)

    core = tool(*roscore_command(port))
    core.expect("started core service")
    node = tool(*NODE, "survivor", "_height:=2.0")
    node.expect("ready, height 2.0")
    early = tool("rostopic", "pub", "-r", "5", "/port_node_in", "std_msgs/String", "data: one")
    node.expect("heard one")
    early.stop()
    core.stop()
    node.expect("the roscore does not answer")

    core = tool(*roscore_command(port))
    core.expect("started core service")
    # A publisher that comes before the node has noticed, and tools that come later.
    between = tool("rostopic", "pub", "-r", "5", "/port_node_in", "std_msgs/String", "data: two")
    node.expect("registered with it again")
    node.expect("heard two")
    between.stop()
    assert tool("rosparam", "get", "/survivor/height").popen.wait(240) == 0
    tool("rostopic", "echo", "-n1", "/survivor/greeting").expect("hello")
    after = tool("rostopic", "pub", "-r", "5", "/port_node_in", "std_msgs/String", "data: three")
    node.expect("heard three")
    after.stop()
    assert tool("rosparam", "set", "/survivor/height", "3.5").popen.wait(240) == 0
    node.expect("changed 3.5")
    nodes = tool("rosnode", "info", "/survivor")
    nodes.expect("/survivor/ask")
    assert "/port_node_in" in nodes.output
    assert node.output.count("registered with it again") == 1
    core.stop()
    node.stop()  # while there is no roscore to tell
    assert node.output.splitlines()[-1] == "ended"
