"""What nav2's tools want of a node of ROS 2: a bond, and a service that loads maps."""

from __future__ import annotations

import shutil
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hypermap.formats import save_map
from hypermap.ros.server.map_server import MapServer

from .fake_rclpy import other_node
from .fake_rclpy_node import Graph
from .fake_rclpy_values import ClockType, QoSProfile
from .map_server_tools import building, saved
from .ros2_fixtures import Idle, graph, make_port

__all__ = ["graph", "make_port"]

NODE = "/hypermap_server"
SUCCESS, MISSING, BAD_DATA, BAD_METADATA, REFUSED = 0, 1, 2, 3, 255


# The bond


@pytest.fixture
def manager(graph: Graph, make_port: Callable[..., Any]) -> Any:
    """Make a node, and hear its bond as a lifecycle manager does."""

    class Manager:
        def __init__(self, *arguments: str) -> None:
            self.heard: list[Any] = []
            self.port = make_port("hypermap_server", "--ros-args", *arguments)
            self.port.manage(Idle())

        def listen(self, node: Any, topic: str = "/bond") -> None:
            kind = graph.types.message("bond/Status")
            node.create_subscription(kind, topic, self.heard.append, QoSProfile(depth=100))

        def ring(self) -> None:
            (timer,) = (t for n in graph.nodes for t in n._timers if t.period == 0.1)
            assert timer.clock.clock_type == ClockType.STEADY_TIME  # a simulator may stand still
            timer.callback()

    return Manager


def test_an_active_node_says_that_it_lives_to_who_listens(graph: Graph, manager: Any) -> None:
    ours = manager("-r", "__ns:=/robot", "-r", "__node:=maps")
    ours.ring()
    with other_node(graph) as node:
        ours.listen(node, "/robot/bond")
        ours.ring()
        ours.ring()
    first, second = ours.heard
    assert (first.id, first.active) == ("maps", True)
    assert first.heartbeat_period == pytest.approx(0.1)
    assert first.instance_id == second.instance_id != ""


@pytest.mark.parametrize("step", ["deactivate", "shutdown"])
def test_a_node_that_is_active_no_more_breaks_its_bond(
    graph: Graph, manager: Any, step: str
) -> None:
    ours = manager()
    with other_node(graph) as node:
        ours.listen(node)
        (publisher,) = (p for n in graph.nodes for p in n._publishers if p.full_name == "/bond")
        assert graph.node(NODE).change_state(step)
        assert [status.active for status in ours.heard] == [False]
    assert publisher.is_acknowledged  # DDS may drop what is sent right before its publisher ends
    assert "/bond" not in graph.topics()
    assert not [timer for n in graph.nodes for timer in n._timers]


def test_each_activation_is_a_bond_of_its_own(graph: Graph, manager: Any) -> None:
    ours = manager()
    with other_node(graph) as node:
        ours.listen(node)
        ours.ring()
        assert graph.node(NODE).change_state("deactivate")
        assert graph.node(NODE).change_state("activate")
        ours.ring()
    assert [status.active for status in ours.heard] == [True, False, True]
    assert ours.heard[0].instance_id != ours.heard[2].instance_id


def test_a_node_that_fails_to_activate_has_no_bond(graph: Graph, make_port: Any) -> None:
    port, node = make_port("hypermap_server", "--ros-args", "-p", "autostart:=false"), Idle()
    node.fails["activate"] = ValueError("a bug")
    port.manage(node)
    assert graph.node(NODE).change_state("configure")
    assert not graph.node(NODE).change_state("activate")
    assert "/bond" not in graph.topics()


def test_without_the_package_a_node_does_without(
    graph: Graph, make_port: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "bond.msg", None)
    port = make_port()
    port.manage(Idle())
    assert graph.node(NODE).state == "active"
    assert "/bond" not in graph.topics()
    assert {level for level, _ in graph.logged} == {"debug"}


# Loading maps


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Maps of all kinds, and a file next to them that nobody may load."""
    folder = tmp_path / "maps"
    folder.mkdir()
    saved(building(), tmp_path / "secret.hmap")
    saved(building(), folder / "lab.hmap")
    with zipfile.ZipFile(folder / "lab.hmap") as archive:
        archive.extractall(folder / "files")
    picture, text = (folder / "files" / f"occupancy.{end}" for end in ("png", "yaml"))
    shutil.copy(picture, folder)
    shutil.copy(text, folder / "floor 2.yaml")
    (folder / "bad.yaml").write_text("image: floor.png\nresolution: wide\n")
    (folder / "broken.yaml").write_text(text.read_text().replace(picture.name, "broken.png"))
    (folder / "broken.png").write_bytes(picture.read_bytes()[:60])
    (folder / "broken.hmap").write_bytes((folder / "lab.hmap").read_bytes()[:200])
    return folder


@pytest.fixture
def load(graph: Graph, make_port: Any, folder: Path) -> Callable[[str], Any]:
    """Load a map by nav2's service, into a server without one."""
    words = ("--ros-args", "-p", f"map_directory:={folder}", "-p", "console:=false")
    port = make_port("hypermap_server", *words)
    port.manage(MapServer(port))
    return lambda url: graph.call(f"{NODE}/nav2_load_map", map_url=url)


@pytest.mark.parametrize(
    "url",
    ["lab.hmap", "{}/lab.hmap", "file://{}/lab.hmap", "floor 2.yaml", "file://{}/floor%202.yaml"],
)
def test_maps_are_loaded_by_name_path_and_url(
    graph: Graph, load: Callable[[str], Any], folder: Path, url: str
) -> None:
    answer = load(url.format(folder))
    assert (answer.result, answer.RESULT_SUCCESS) == (SUCCESS, SUCCESS)
    assert (answer.map.info.width, answer.map.info.height) == (3, 2)
    assert list(answer.map.data) == [0, 0, 100, 100, 100, -1]
    assert graph.latest(f"{NODE}/occupancy_map").data == answer.map.data


@pytest.mark.parametrize(
    ("url", "result"),
    [
        ("nowhere.yaml", MISSING),
        ("file:///nowhere/at/all.yaml", REFUSED),
        ("../secret.hmap", REFUSED),
        ("{}/../secret.hmap", REFUSED),
        ("", REFUSED),
        ("package://maps/floor.yaml", MISSING),
        ("bad.yaml", BAD_METADATA),
        ("broken.yaml", BAD_DATA),
        ("broken.hmap", BAD_DATA),
    ],
)
def test_a_map_that_cannot_be_loaded_has_a_result_and_leaves_the_old_one(
    graph: Graph, load: Callable[[str], Any], folder: Path, url: str, result: int
) -> None:
    assert load("lab.hmap").result == SUCCESS
    answer = load(url.format(folder))
    assert (answer.result, len(answer.map.data)) == (result, 0)
    assert graph.logged[-1][0] == "error"
    assert "Traceback" not in graph.logged[-1][1]
    assert len(graph.latest(f"{NODE}/occupancy_map").data) == 6


def test_the_service_of_ours_takes_the_same_files(graph: Graph, load: Any) -> None:
    assert graph.call(f"{NODE}/load_map", filename="floor 2.yaml").success
    assert len(graph.latest(f"{NODE}/occupancy_map").data) == 6


def test_a_map_without_a_grid_is_loaded_too(
    graph: Graph, load: Callable[[str], Any], folder: Path
) -> None:
    objects = building()
    objects.remove("occupancy")
    save_map(objects, folder / "objects.hmap")
    answer = load("objects.hmap")
    assert (answer.result, len(answer.map.data)) == (SUCCESS, 0)
    assert np.isclose(answer.map.info.resolution, 0)


def test_an_address_that_is_none_is_refused(load: Callable[[str], Any]) -> None:
    assert load("file://[").result == REFUSED


def test_without_map_directory_nothing_is_loaded(graph: Graph, make_port: Any) -> None:
    port = make_port("hypermap_server", "--ros-args", "-p", "console:=false")
    port.manage(MapServer(port))
    assert graph.call(f"{NODE}/nav2_load_map", map_url="lab.hmap").result == REFUSED


def test_a_bug_is_no_success(
    graph: Graph, load: Callable[[str], Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any) -> None:
        raise KeyError("a bug")

    monkeypatch.setattr("hypermap.ros.server.map_files.open_any", fail)
    assert load("lab.hmap").result == REFUSED


def test_without_nav2_msgs_there_is_no_such_service(
    graph: Graph, make_port: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "nav2_msgs.srv", None)
    port = make_port("hypermap_server", "--ros-args", "-p", "console:=false")
    port.manage(MapServer(port))
    assert f"{NODE}/load_map" in graph.services()
    assert f"{NODE}/nav2_load_map" not in graph.services()
