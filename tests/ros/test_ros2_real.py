"""What the map server serves on the real ROS 2, wherever it is found."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hypermap.core.grid import GridGeometry
from hypermap.core.occupancy import OccupancyLayer
from hypermap.formats import open_map

from .conftest import Process, wait_for
from .map_server_tools import building, saved
from .ros2_real import Ros2, environment, point, ros2, string_at

__all__ = ["environment", "ros2"]

pytestmark = [pytest.mark.xdist_group("ros2"), pytest.mark.slow]

NODE = "/hypermap_server"
SIDE = 140  # cells of the large layer
LATCHED = ("--qos-durability", "transient_local", "--qos-reliability", "reliable")


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


def box(x0: float, y0: float, x1: float, y1: float) -> dict[str, Any]:
    corners = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
    points = [{"x": float(x), "y": float(y)} for x, y in corners]
    return {"header": {"frame_id": "map"}, "polygon": {"points": points}}


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
        (f"{NODE}/hypermap_metadata", "name: 2nd floor"),
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
        "header": {"frame_id": "map", "stamp": {"sec": 1}},
        "child_frame_id": "robot",
        "transform": {"translation": {"x": 2.0}, "rotation": {"w": 1.0}},
    }
    ros2.ask(
        "publish",
        topic="/tf",
        type="tf2_msgs/msg/TFMessage",
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
    if ros2.has("nav2_msgs"):
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
