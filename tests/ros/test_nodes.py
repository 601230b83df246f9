"""The map server as a command on ROS 1: ROS's arguments reach it, and signals end it."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest
import shapely

from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.formats import save_map
from hypermap.ros.nodes import Address, run_map_server

from .. import prepared
from .conftest import wait_for

pytestmark = pytest.mark.xdist_group("ros")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_command_is_a_node_of_ros_1(rospy, start, tmp_path, number):
    things = [SemanticObject("chair", shapely.box(0, 0, 1, 1))]
    path = tmp_path / "room.hmap"
    save_map(Hypermap([SemanticLayer("semantic", "map", things)]), path)
    name = f"office_{number}"
    server = start(
        "hypermap",
        "serve",
        path,
        "--ros1",
        "--param",
        "tf_timeout=0.25",
        f"__name:={name}",
        is_new=True,
    )
    rospy.wait_for_service(f"/{name}/get_string_at_point", timeout=240)
    assert rospy.get_param(f"/{name}/tf_timeout") == 0.25
    from hypermap.ros.ros1.messages import message_class, service_class

    ask = rospy.ServiceProxy(
        f"/{name}/get_string_at_point", service_class("hypermap_msgs/GetStringAtPoint")
    )
    place = message_class("geometry_msgs/PointStamped")()
    place.header.frame_id = "map"
    place.point.x = place.point.y = 0.5
    answered = partial(ask, "semantic", place)
    assert wait_for(answered, "an answer").name == "chair"
    assert server.stop(number, timeout=240.0) == 0
    assert "Traceback" not in server.output


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_before_the_node_runs_is_a_clean_end(
    number: signal.Signals, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Clients are told where the server listens before it has loaded its map."""
    pytest.importorskip("foxglove")
    from hypermap.ros.server import map_server

    class Interrupted(map_server.MapServer):
        def __init__(self, *arguments: object) -> None:
            signal.raise_signal(number)
            raise AssertionError("it goes on")

    monkeypatch.setattr(map_server, "MapServer", Interrupted)
    before = signal.getsignal(number)
    run_map_server(["none.hmap"], middleware="foxglove", address=Address(port=0))
    assert signal.getsignal(number) is before


def test_a_signal_while_the_middleware_starts_is_a_clean_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip("foxglove")
    from hypermap.ros.foxglove import port

    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(port, "FoxglovePort", interrupted)
    run_map_server(["none.hmap"], middleware="foxglove", address=Address(port=0))


INTERRUPTED = """
from hypermap.ros.nodes import run_node

class Port:
    def shut_down(self): print("down")

class Node:
    def configure(self): pass
    def activate(self): exec("raise KeyboardInterrupt")  # as amid the import of a dataclass
    def deactivate(self): pass
    def cleanup(self): print("saved")

run_node(Port(), Node())
"""


def test_ctrl_c_amid_an_import_is_a_clean_end(tmp_path: Path) -> None:
    (tmp_path / "interrupted.py").write_text(INTERRUPTED, encoding="utf-8")
    command = [sys.executable, "-m", "interrupted"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "saved\ndown\n"), done.stderr


WITHOUT_TF = """
import sys
sys.modules["tf2_ros"] = None
from hypermap.core.errors import HypermapError
try:
    import hypermap.ros.ros1.libraries
except HypermapError as error:
    print(error)
"""


def test_without_tf2_ros_the_error_says_what_to_install(needs_ros1: None) -> None:
    command = [sys.executable, "-c", WITHOUT_TF]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "apt-get install python3-tf2-ros" in done.stdout, done.stderr


def test_the_process_that_is_copied_waits_for_the_next_command() -> None:
    """With rospy's timeout for all sockets it ended, and each node of a test took seconds."""
    before = socket.getdefaulttimeout()
    socket.setdefaulttimeout(60.0)
    try:
        made = prepared._socket()
    finally:
        socket.setdefaulttimeout(before)
    with made:
        assert os.get_blocking(made.fileno())
