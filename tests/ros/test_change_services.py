"""What changed in a map over ROS 1, asked through a real roscore, and over ROS 2's classes."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import shapely

from hypermap import Hypermap, SemanticLayer, SemanticObject
from hypermap.history import begin_history
from hypermap.ros.server.map_server import MapServer

from .conftest import Process
from .map_server_tools import Client, saved
from .ros2_fixtures import graph, make_port

__all__ = ["graph", "make_port"]


def office(folder: Path, expires: float) -> Path:
    """Return the file of a map of which a chair was moved, and in which a zone expires."""
    zone = SemanticObject("zone", shapely.box(5, 5, 6, 6), attributes={"expires": expires})
    chair = SemanticObject("chair", shapely.box(0, 0, 1, 1))
    hypermap = Hypermap([SemanticLayer("semantic", "map", [chair, zone])])
    begin_history(hypermap)
    for x in (3, 4):
        hypermap.semantic().update(0, SemanticObject("chair", shapely.box(x, 0, x + 1, 1)))
        saved(hypermap, folder / "office.hmap")
    return folder / "office.hmap"


@pytest.fixture(scope="module")
def client(rospy: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    folder = tmp_path_factory.mktemp("changes")
    file = office(folder, time.time() + 20)
    command = [sys.executable, "-m", "hypermap", "serve", str(file), "--ros1"]
    process = Process([*command, "__name:=changing"], folder / "server.log")
    yield Client(rospy, "changing")
    process.stop()


@pytest.mark.xdist_group("ros")
def test_changes_are_answered_and_published(client: Client) -> None:
    answer = client.call("get_changes", "GetChanges")
    assert (answer.success, answer.message, answer.frame_id) == (True, "", "map")
    first, second, *_ = answer.changes
    assert (first.kind, first.name, first.id, first.version) == ("moved", "chair", 0, 2)
    assert (first.before.x, first.after.x, first.distance) == (0.5, 3.5, 3.0)
    assert (first.cause, first.drive, first.confidence) == ("edit", "", 1.0)
    assert abs(second.time - time.time()) < 3600
    assert client.call("get_changes", "GetChanges", since="v2").changes[0].version == 3
    assert client.call("get_changes", "GetChanges", names=["sofa"]).changes == []
    assert "expected a time" in client.refused("get_changes", "GetChanges", since="soon")
    heard = client.heard("changes", "hypermap_msgs/ObjectChangeArray")
    assert heard.header.frame_id == "map"
    assert heard.changes[0].version in (3, 4)


@pytest.mark.xdist_group("ros")
def test_what_expires_is_taken_out_while_the_server_runs(client: Client) -> None:
    deadline = time.monotonic() + 240
    while client.call("get_semantic_by_string", "GetSemanticByString", name="zone").objects:
        assert time.monotonic() < deadline
        time.sleep(0.2)
    kinds = [change.kind for change in client.call("get_changes", "GetChanges").changes]
    assert kinds == ["moved", "moved", "expired"]


def test_ros_2_answers_the_same_without_what_has_expired(
    graph: Any, make_port: Any, tmp_path: Path
) -> None:
    file = office(tmp_path, time.time() - 1)
    words = ["-p", f"file:={file}", "-p", "load_map:=true", "-p", "console:=false"]
    port = make_port("hypermap_server", "--ros-args", *words)
    port.manage(MapServer(port))
    node = "/hypermap_server"
    assert graph.call(f"{node}/get_semantic_by_string", name="zone").objects == []
    answer = graph.call(f"{node}/get_changes", since="v2")
    assert answer.success
    assert [change.kind for change in answer.changes] == ["moved", "expired"]
    assert math.isnan(answer.changes[1].distance)
