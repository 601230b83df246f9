"""Our nodes on the real ROS 2, wherever it is found: rclpy, its tools, and its launch files."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hypermap.core.grid import GridGeometry
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.formats import open_map, save_map

from .conftest import ROS, Process, wait_for
from .map_server_tools import building, saved
from .ros2_real import Ros2, environment, launch2, ros2
from .ros2_robot import DEPTH, DETECTIONS, drive

__all__ = ["environment", "launch2", "ros2"]

pytestmark = [pytest.mark.xdist_group("ros2"), pytest.mark.slow]

NODE = "/hypermap_server"
SIDE = 140  # cells of the large layer
LATCHED = ("--qos-durability", "transient_local", "--qos-reliability", "reliable")
ENDS = pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=["INT", "TERM"])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A building whose second floor, of many cells, has a name that ROS 2 does not take."""
    hypermap = building(publish_global_topics=True)
    grid = GridGeometry(SIDE, SIDE, 0.1)
    hypermap.add(OccupancyLayer("2nd floor", "map", grid, np.zeros((SIDE, SIDE), np.int8)))
    return saved(hypermap, tmp_path_factory.mktemp("maps") / "building.hmap").parent


@pytest.fixture(scope="module")
def server(ros2: Ros2, folder: Path) -> Iterator[Process]:
    """A map server that `ros2 launch` has started, and Ctrl-C ends."""
    words = [f"file:={folder / 'building.hmap'}", f"map_directory:={folder}", "rviz:=false"]
    command = ["ros2", "launch", "hypermap", "show_map.launch.xml", *words]
    process = Process(command, folder / "server.log", env=ros2.environment)
    process.expect("loaded ", 90)
    yield process
    process.stop()
    assert "Traceback" not in process.output, process.output
    assert "process has finished cleanly" in process.output, process.output


def point(x: float, y: float, frame: str = "map") -> dict[str, Any]:
    return {"header": {"frame_id": frame}, "point": {"x": float(x), "y": float(y)}}


def box(x0: float, y0: float, x1: float, y1: float) -> dict[str, Any]:
    corners = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
    points = [{"x": float(x), "y": float(y)} for x, y in corners]
    return {"header": {"frame_id": "map"}, "polygon": {"points": points}}


def string_at(ros2: Ros2, layer: str, where: dict[str, Any]) -> str:
    kind = "hypermap_msgs/srv/GetStringAtPoint"
    name = ros2.call(f"{NODE}/get_string_at_point", kind, layer=layer, location=where)["name"]
    return str(name)


def has(ros2: Ros2, package: str) -> bool:
    check = f"import importlib.util as u, sys; sys.exit(u.find_spec({package!r}) is None)"
    done = subprocess.run([sys.executable, "-c", check], env=ros2.environment, check=False)
    return done.returncode == 0


# What is served


def test_topics_and_services_are_there_with_their_types(ros2: Ros2, server: Process) -> None:
    found = ros2.ask("names")
    topics = {
        f"{NODE}/hypermap_metadata": ["hypermap_msgs/msg/HypermapMetaData"],
        f"{NODE}/occupancy_map": ["nav_msgs/msg/OccupancyGrid"],
        f"{NODE}/layer_2nd_floor_map": ["nav_msgs/msg/OccupancyGrid"],
        f"{NODE}/semantic_semmap": ["hypermap_msgs/msg/SemanticMap"],
        f"{NODE}/semantic_markers": ["visualization_msgs/msg/MarkerArray"],
        "/map": ["nav_msgs/msg/OccupancyGrid"],
        "/semantic_map": ["hypermap_msgs/msg/SemanticMap"],
        "/diagnostics": ["diagnostic_msgs/msg/DiagnosticArray"],
        "/tf_static": ["tf2_msgs/msg/TFMessage"],
    }
    assert found["topics"].items() >= topics.items()
    services = {
        f"{NODE}/find_objects": ["hypermap_msgs/srv/FindObjects"],
        f"{NODE}/layer_2nd_floor_static_map": ["nav_msgs/srv/GetMap"],
        "/static_map": ["nav_msgs/srv/GetMap"],
        f"{NODE}/change_state": ["lifecycle_msgs/srv/ChangeState"],
    }
    assert found["services"].items() >= services.items()
    assert {NODE, f"{NODE}_tf"} <= set(found["nodes"])


def test_latched_topics_reach_those_that_come_later(ros2: Ros2, server: Process) -> None:
    grid = ros2.latest(f"{NODE}/occupancy_map", "nav_msgs/msg/OccupancyGrid")
    assert (grid["header"]["frame_id"], grid["data"]) == ("map", [0, 0, 100, 100, 100, -1])
    semantic = ros2.latest("/semantic_map", "hypermap_msgs/msg/SemanticMap")
    names = {item["name"] for item in semantic["objects"]}
    assert names == {"table", "cup", "chair", "sofa"}
    markers = ros2.latest(f"{NODE}/semantic_markers", "visualization_msgs/msg/MarkerArray")
    assert any(marker["text"] == "chair" for marker in markers["markers"])
    frames = ros2.latest("/tf_static", "tf2_msgs/msg/TFMessage")
    assert [item["child_frame_id"] for item in frames["transforms"]] == ["lab"]


@pytest.mark.parametrize(
    ("topic", "text"),
    [
        (f"{NODE}/hypermap_metadata", "base_frame"),
        (f"{NODE}/semantic_semmap", "name: chair"),
        ("/tf_static", "child_frame_id: lab"),
    ],
)
def test_topics_are_shown_as_the_page_says(
    ros2: Ros2, server: Process, topic: str, text: str
) -> None:
    assert text in ros2.tool("topic", "echo", "--once", *LATCHED, topic)


def test_services_answer(ros2: Ros2, server: Process) -> None:
    assert string_at(ros2, "occupancy", point(0.5, 0.5)) == "Free"
    assert string_at(ros2, "semantic", point(1.0, 0.5, "lab")) == "table"
    found = ros2.call(
        f"{NODE}/find_objects",
        "hypermap_msgs/srv/FindObjects",
        tags=["stool"],
        origin=point(5, 5, "lab"),
        within=9.0,
    )
    assert (found["success"], found["distances"]) == (True, [0.0])
    assert [item["object"]["name"] for item in found["objects"]] == ["chair"]
    assert np.isnan(found["objects"][0]["first_seen"])
    request = "{layer: semantic, location: {header: {frame_id: lab}, point: {x: 0.5, y: 0.5}}}"
    words = ("hypermap_msgs/srv/GetStringAtPoint", request)
    assert "name='cup'" in ros2.tool("service", "call", f"{NODE}/get_string_at_point", *words)


def test_every_cell_of_a_large_area_arrives(ros2: Ros2, server: Process) -> None:
    hits = ros2.call(
        f"{NODE}/get_strings_by_area",
        "hypermap_msgs/srv/GetStringsByArea",
        layer="2nd floor",
        area=box(0, 0, SIDE * 0.1, SIDE * 0.1),
    )
    assert set(hits["names"]) <= {"Free", "Occupied"}
    assert len(hits["names"]) == SIDE**2
    places = {(round(place["x"], 2), round(place["y"], 2)) for place in hits["locations"]}
    assert len(places) == SIDE**2


def test_errors_reach_the_caller(ros2: Ros2, server: Process) -> None:
    assert string_at(ros2, "oops", point(0, 0)) == ""
    server.expect("there is no layer 'oops'")
    assert string_at(ros2, "occupancy", point(0, 0, "moon")) == ""
    server.expect("moon")
    found = ros2.call(f"{NODE}/find_objects", "hypermap_msgs/srv/FindObjects", layer="oops")
    assert (found["success"], "oops" in found["message"]) == (False, True)


def test_questions_come_in_a_frame_of_tf(ros2: Ros2, server: Process) -> None:
    robot = {
        "header": {"frame_id": "map"},
        "child_frame_id": "robot",
        "transform": {"translation": {"x": 2.0}, "rotation": {"w": 1.0}},
    }
    ros2.ask(
        "publish",
        topic="/tf_static",
        type="tf2_msgs/msg/TFMessage",
        latched=True,
        transforms=[robot],
    )
    wait_for(lambda: string_at(ros2, "occupancy", point(0.5, 0.5, "robot")) == "Occupied", "tf")


def test_updates_change_layers(ros2: Ros2, server: Process) -> None:
    ros2.ask(
        "publish",
        topic=f"{NODE}/layer_2nd_floor_map_updates",
        type="map_msgs/msg/OccupancyGridUpdate",
        header={"frame_id": "map"},
        width=1,
        height=1,
        data=[100],
    )
    where = point(0.05, 0.05)
    wait_for(lambda: string_at(ros2, "2nd floor", where) == "Occupied", "the update")


def test_parameters_are_described_checked_and_changed(ros2: Ros2, server: Process) -> None:
    described = ros2.tool("param", "describe", NODE, "label_height")
    assert "Type: double" in described
    assert "Min value: 0.0" in described
    for shown in ("false", "true"):
        done = ros2.tool("param", "set", NODE, "show_labels", shown)
        assert "Set parameter successful" in done
        markers = ros2.latest(f"{NODE}/semantic_markers", "visualization_msgs/msg/MarkerArray")
        assert any(marker["text"] for marker in markers["markers"]) == (shown == "true")
    for name, value, reason in (
        ("label_height", "-1.0", "out of range"),
        ("label_height", "high", "Wrong parameter type"),
        ("file", "x.hmap", "read-only"),
        ("keepout", "['desk']", "desk"),
    ):
        shown = ros2.tool("param", "set", NODE, name, value, is_ok=False)
        assert "Setting parameter failed" in shown
        assert reason in shown


def test_masks_are_drawn_where_a_parameter_says(ros2: Ros2, server: Process) -> None:
    ros2.tool("param", "set", NODE, "keepout", "['chair 0.5']")
    mask = ros2.latest(f"{NODE}/keepout_mask", "nav_msgs/msg/OccupancyGrid")
    assert set(mask["data"]) <= {-1, 100}
    if has(ros2, "nav2_msgs"):
        info = ros2.latest(f"{NODE}/keepout_filter_info", "nav2_msgs/msg/CostmapFilterInfo")
        assert (info["type"], info["filter_mask_topic"]) == (0, f"{NODE}/keepout_mask")


def test_maps_are_stored_and_loaded(ros2: Ros2, server: Process, folder: Path) -> None:
    done = ros2.call(f"{NODE}/store_map", "hypermap_msgs/srv/StoreMap", filename="copy.hmap")
    assert done["success"]
    assert len(open_map(folder / "copy.hmap").layers) == 3
    for name, is_there in (("copy.hmap", True), ("../secret.hmap", False), ("no.hmap", False)):
        answer = ros2.call(f"{NODE}/load_map", "hypermap_msgs/srv/LoadMap", filename=name)
        assert answer["success"] == is_there
    assert string_at(ros2, "occupancy", point(0.5, 0.5)) == "Free"


# nav2


def test_the_tools_of_nav2_load_maps(
    ros2: Ros2, start: Callable[..., Process], folder: Path
) -> None:
    if not has(ros2, "nav2_msgs"):
        pytest.skip("nav2_msgs is not here")
    (folder / "bad.yaml").write_text("image: floor.png\nresolution: wide\n")
    words = ("-p", f"map_directory:={folder}", "-p", "console:=false")
    remap = ("-r", "~/nav2_load_map:=/map_server/load_map")
    start("hypermap", "serve", "--ros2", "--ros-args", "-r", "__node:=maps", *words, *remap,
          env=ros2.environment)  # fmt: skip
    kind = "nav2_msgs/srv/LoadMap"
    answer = ros2.call("/map_server/load_map", kind, map_url=str(folder / "building.hmap"))
    assert (answer["result"], answer["map"]["info"]["width"]) == (0, 3)
    for url, result in (("no.yaml", 1), ("bad.yaml", 3), ("/etc/passwd", 255)):
        answer = ros2.call("/map_server/load_map", kind, map_url=url)
        assert (answer["result"], answer["map"]["data"]) == (result, [])


def test_a_lifecycle_manager_bonds_with_the_node(ros2: Ros2, start: Callable[..., Process]) -> None:
    if not has(ros2, "bondpy"):
        pytest.skip("bondpy is not here")
    name = "bonded"
    process = start("hypermap", "serve", "--ros2", "--ros-args", "-r", f"__node:={name}",
                    "-p", "console:=false", env=ros2.environment)  # fmt: skip
    ros2.ask("bond", name=name)
    assert not ros2.ask("is_bond_broken")
    assert process.stop(signal.SIGKILL) == -signal.SIGKILL
    wait_for(lambda: ros2.ask("is_bond_broken"), "the manager to miss the node")


# Its life


def test_the_lifecycle_is_that_of_ros(ros2: Ros2, launch2: Any, folder: Path) -> None:
    process = launch2(
        "show_map.launch.xml", file=folder / "building.hmap", autostart="false", rviz="false"
    )
    process.expect("waiting for a lifecycle manager", 90)
    steps = {
        "configure": "inactive [2]",
        "activate": "active [3]",
        "deactivate": "inactive [2]",
        "cleanup": "unconfigured [1]",
        "shutdown": "finalized [4]",
    }
    for step, state in steps.items():
        wait_for(lambda: NODE in ros2.tool("lifecycle", "nodes"), "the node")
        assert "Transitioning successful" in ros2.tool("lifecycle", "set", NODE, step)
        assert ros2.tool("lifecycle", "get", NODE).strip() == state
    assert process.stop() == 0
    assert "Traceback" not in process.output, process.output


def test_what_cannot_be_configured_says_why_and_may_be_tried_again(
    ros2: Ros2, launch2: Any, tmp_path: Path
) -> None:
    file = tmp_path / "late.hmap"
    process = launch2("show_map.launch.xml", file=file, autostart="false", rviz="false")
    process.expect("waiting for a lifecycle manager", 90)
    wait_for(lambda: NODE in ros2.tool("lifecycle", "nodes"), "the node")
    shown = ros2.tool("lifecycle", "set", NODE, "configure", is_ok=False)
    assert "Transitioning failed" in shown
    process.expect("late.hmap")
    save_map(building(), file)
    assert "Transitioning successful" in ros2.tool("lifecycle", "set", NODE, "configure")
    assert "Traceback" not in process.output, process.output


@ENDS
def test_a_launched_node_ends_in_order(launch2: Any, folder: Path, number: signal.Signals) -> None:
    process = launch2("show_map.launch.xml", file=folder / "building.hmap", rviz="false")
    process.expect("loaded ", 90)
    process.stop(number)
    assert "process has finished cleanly" in process.output, process.output
    assert "SIGKILL" not in process.output
    assert "Traceback" not in process.output


def test_a_map_that_is_missing_is_one_line(ros2: Ros2, launch2: Any, tmp_path: Path) -> None:
    process = launch2("show_map.launch.xml", file=tmp_path / "no.hmap", rviz="false")
    process.expect("process has died", 90)
    assert "no.hmap" in process.output
    assert "Traceback" not in process.output


def test_a_misspelled_parameter_is_a_warning(ros2: Ros2, start: Callable[..., Process]) -> None:
    process = start("hypermap", "serve", "--ros2", "--ros-args", "-p", "keepuot:=['desk 0.2']",
                    "-p", "console:=false", "-r", "__node:=misspelled",
                    env=ros2.environment)  # fmt: skip
    process.expect("nobody heeds the parameter 'keepuot'; did you mean 'keepout'?", 90)


@pytest.mark.parametrize(
    "file", sorted(file.name for file in (ROS / "hypermap" / "launch").glob("*.launch.xml"))
)
def test_launch_files_show_their_arguments(ros2: Ros2, file: str) -> None:
    shown = ros2.tool("launch", "hypermap", file, "--show-args")
    assert "'rviz'" in shown


# Mapping


def test_a_drive_becomes_a_map(
    ros2: Ros2, launch2: Any, start: Callable[..., Process], tmp_path: Path
) -> None:
    file = tmp_path / "drive.hmap"
    process = launch2(
        "semantic_mapping.launch.xml",
        depth_topic=DEPTH,
        detections_topic=DETECTIONS,
        save_to=file,
    )
    robot = Path(__file__).with_name("ros2_robot.py")
    start(sys.executable, robot, "12", "0.5", env=ros2.environment, stdin=subprocess.PIPE)
    ros2.ask("listen", topic="/semantic_map", type="hypermap_msgs/msg/SemanticMap", latched=True)
    wait_for(lambda: ros2.ask("heard", topic="/semantic_map")[-1]["objects"], "objects", 120)
    wait_for(lambda: string_of_objects(ros2), "objects of the map server")
    process.stop()
    assert process.output.count("process has finished cleanly") == 2, process.output
    assert "Traceback" not in process.output
    saved_map = open_map(file)
    layer = saved_map["semantic"]
    assert isinstance(layer, SemanticLayer)
    seen = {str(n) for f in drive(12) if f.detections is not None for n in f.detections.names}
    assert {item.name for item in layer.objects()} <= seen
    assert len(layer) > 0
    grid = next(item for item in saved_map if isinstance(item, OccupancyLayer))
    assert grid.cells is not None  # without map_topic, it is made from depth


def string_of_objects(ros2: Ros2) -> list[str]:
    kind = "hypermap_msgs/srv/FindObjects"
    return [item["object"]["name"] for item in ros2.call(f"{NODE}/find_objects", kind)["objects"]]


def test_the_map_of_another_node_is_recorded(ros2: Ros2, launch2: Any, tmp_path: Path) -> None:
    file = tmp_path / "recorded.hmap"
    process = launch2("record_map.launch.xml", save_to=file, map_topic="/slam/map")
    ros2.ask(
        "publish",
        topic="/slam/map",
        type="nav_msgs/msg/OccupancyGrid",
        latched=True,
        header={"frame_id": "map"},
        info={"width": 2, "height": 2, "resolution": 0.05},
        data=[0, 100, -1, 7],
    )
    wait_for(lambda: string_at(ros2, "occupancy", point(0.07, 0.02)) == "Occupied", "the map")
    process.stop()
    assert "process has finished cleanly" in process.output, process.output
    (layer,) = open_map(file)
    assert isinstance(layer, OccupancyLayer)
    np.testing.assert_array_equal(layer.cells, [[0, 100], [-1, 7]])
