"""The map server on ROS 2: names, types of every field, quality of service, lifecycle, services."""

from __future__ import annotations

import array
import json
import threading
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hypermap.core.errors import HypermapError
from hypermap.formats import open_map
from hypermap.ros.nodes import run_map_server
from hypermap.ros.server.map_server import MapServer

from .conftest import wait_for
from .fake_rclpy import other_node
from .fake_rclpy_node import Graph
from .fake_rclpy_values import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from .map_server_tools import building, saved
from .ros2_fixtures import graph, make_port

__all__ = ["graph", "make_port"]

NODE = "/hypermap_server"
LATE = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@pytest.fixture
def serve(make_port: Callable[..., Any], tmp_path: Path) -> Callable[..., Any]:
    """Start a map server with a building, or with a file; more arguments are parameters."""

    def start(*parameters: str, file: Path | None = None, **settings: Any) -> Any:
        file = file or saved(building(**settings), tmp_path / "building.hmap")
        is_archive = file.suffix == ".hmap"
        given = [
            f"file:={file}",
            f"load_map:={json.dumps(is_archive)}",
            f"load_map_config:={json.dumps(not is_archive)}",
            "console:=false",
            *parameters,
        ]
        words = [word for value in given for word in ("-p", value)]
        port = make_port("hypermap_server", "--ros-args", *words)
        port.manage(MapServer(port))
        return port

    return start


def point(graph: Graph, x: float, y: float, frame: str = "") -> Any:
    message = graph.types.message("geometry_msgs/PointStamped")()
    message.header.frame_id, message.point.x, message.point.y = frame, float(x), float(y)
    return message


def box(graph: Graph, x0: float, y0: float, x1: float, y1: float, frame: str = "") -> Any:
    message = graph.types.message("geometry_msgs/PolygonStamped")()
    corner = graph.types.message("geometry_msgs/Point32")
    message.header.frame_id = frame
    corners = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)]
    message.polygon.points = [corner(x=float(x), y=float(y)) for x, y in corners]
    return message


def nowhere(graph: Graph) -> Any:
    return graph.types.message("geometry_msgs/PolygonStamped")()


def places(points: Iterable[Any]) -> list[tuple[float, float]]:
    return sorted((round(p.x, 4), round(p.y, 4)) for p in points)


def string_at(graph: Graph, layer: str, x: float, y: float, frame: str = "") -> str:
    answer = graph.call(
        f"{NODE}/get_string_at_point", layer=layer, location=point(graph, x, y, frame)
    )
    return str(answer.name)


def test_topics_are_those_of_ros_1_and_latched(graph: Graph, serve: Any) -> None:
    serve(publish_global_topics=True)
    assert (
        graph.topics().items()
        >= {
            f"{NODE}/hypermap_metadata": "hypermap_msgs/msg/HypermapMetaData",
            f"{NODE}/occupancy_map": "nav_msgs/msg/OccupancyGrid",
            f"{NODE}/occupancy_map_metadata": "nav_msgs/msg/MapMetaData",
            f"{NODE}/semantic_semmap": "hypermap_msgs/msg/SemanticMap",
            f"{NODE}/semantic_markers": "visualization_msgs/msg/MarkerArray",
            "/map": "nav_msgs/msg/OccupancyGrid",
            "/map_metadata": "nav_msgs/msg/MapMetaData",
            "/semantic_map": "hypermap_msgs/msg/SemanticMap",
            "/tf_static": "tf2_msgs/msg/TFMessage",
        }.items()
    )
    for topic in graph.topics().keys() - {"/diagnostics", "/bond"}:
        (publisher,) = graph.publishers(topic)
        assert publisher.qos.durability == DurabilityPolicy.TRANSIENT_LOCAL, topic
        assert publisher.qos.reliability == ReliabilityPolicy.RELIABLE, topic


def test_late_listeners_get_the_layers(graph: Graph, serve: Any) -> None:
    serve()
    grid = graph.latest(f"{NODE}/occupancy_map")
    assert (grid.info.width, grid.info.height, grid.info.resolution) == (3, 2, 1.0)
    assert grid.data == array.array("b", [0, 0, 100, 100, 100, -1])
    assert (grid.header.frame_id, grid.info.map_load_time.sec > 0) == ("map", True)
    semantic = graph.latest(f"{NODE}/semantic_semmap")
    found = {item.name: item for item in semantic.objects}
    assert found.keys() == {"table", "cup", "chair", "sofa"}
    assert (found["table"].id, semantic.header.frame_id) == (7, "lab")
    assert found["chair"].confidence == array.array("d", [0.75, 0.25])
    assert list(found["chair"].tags) == ["chair", "stool"]
    layers = graph.latest(f"{NODE}/hypermap_metadata")
    assert (layers.layer_cnt, layers.node_name) == (2, NODE)
    assert [layer.class_name for layer in layers.layers] == ["OccupancyGridLayer", "SemanticLayer"]
    markers = graph.latest(f"{NODE}/semantic_markers").markers
    assert {marker.ns for marker in markers} == {"", "table", "cup", "chair", "sofa"}
    (lab,) = graph.latest("/tf_static").transforms
    assert (lab.header.frame_id, lab.child_frame_id) == ("map", "lab")
    assert lab.transform.translation.x == 10.0


def test_old_services_answer(graph: Graph, serve: Any) -> None:
    serve()
    assert string_at(graph, "occupancy", 0.5, 0.5) == "Free"
    assert string_at(graph, "semantic", 0.5, 0.5, "lab") == "cup"
    assert string_at(graph, "semantic", 1.5, 0.5, "lab") == "table"
    ask = graph.call
    at = point(graph, 2.5, 0.5)
    assert ask(f"{NODE}/get_int_at_point", layer="occupancy", location=at).value == 100
    area = box(graph, 0, 0, 3, 2)
    ints = ask(f"{NODE}/get_ints_by_area", layer="occupancy", area=area)
    assert sorted(ints.values) == [-1, 0, 0, 100, 100, 100]
    assert len(ints.locations) == 6
    strings = ask(
        f"{NODE}/get_strings_by_area", layer="semantic", area=box(graph, 0, 0, 1, 1, "lab")
    )
    assert sorted(strings.names) == ["cup", "table"]
    for service, what in (
        ("get_locations_by_string", {"name": "Occupied"}),
        ("get_locations_by_int", {"value": 100}),
    ):
        found = ask(f"{NODE}/{service}", layer="occupancy", area=nowhere(graph), **what)
        assert places(found.locations) == [(0.5, 1.5), (1.5, 1.5), (2.5, 0.5)]
    by_area = ask(f"{NODE}/get_semantic_by_area", area=box(graph, 4, 4, 6, 6, "lab"))
    assert [item.name for item in by_area.objects] == ["chair"]
    assert places(item.position for item in by_area.objects) == [(5.0, 5.0)]
    by_name = ask(f"{NODE}/get_semantic_by_string", name="sofa")
    assert len(by_name.objects) == 1
    assert ask(f"{NODE}/occupancy_static_map").map.info.width == 3


def test_new_services_answer(graph: Graph, serve: Any) -> None:
    serve()
    layers = graph.call(f"{NODE}/get_layers_at_point", location=point(graph, 0.5, 0.5, "lab"))
    assert (layers.success, layers.frame_id) == (True, "map")
    values = {layer.layer: layer for layer in layers.layers}
    assert values["semantic"].label == "cup"
    assert [state.object.name for state in values["semantic"].objects] == ["cup", "table"]
    hits = graph.call(
        f"{NODE}/get_hits_in_areas",
        layer="occupancy",
        areas=[box(graph, 0, 0, 1, 1), box(graph, 0, 0, 3, 2)],
    )
    assert [len(area.values) for area in hits.hits] == [1, 6]
    assert list(hits.hits[0].labels) == ["Free"]
    found = graph.call(
        f"{NODE}/find_objects",
        tags=["stool"],
        origin=point(graph, 5, 5, "lab"),
        within=9.0,
        limit=3,
    )
    (chair,) = found.objects
    assert (chair.object.name, chair.existence, len(chair.parts)) == ("chair", 3.5, 1)
    assert np.isnan(chair.first_seen)
    assert list(found.distances) == [0.0]


def test_errors_reach_the_caller_as_well_as_the_type_can(graph: Graph, serve: Any) -> None:
    serve()
    assert string_at(graph, "oops", 0.5, 0.5) == ""
    assert "there is no layer 'oops'" in graph.logged[-1][1]
    at = point(graph, 0, 0, "moon")
    assert graph.call(f"{NODE}/get_int_at_point", layer="occupancy", location=at).value == -1
    assert "moon" in graph.logged[-1][1]
    lists = graph.call(f"{NODE}/get_strings_by_area", layer="occupancy", area=nowhere(graph))
    assert (lists.names, lists.locations) == ([], [])
    found = graph.call(f"{NODE}/find_objects", layer="oops")
    assert (found.success, "oops" in found.message) == (False, True)
    stored = graph.call(f"{NODE}/store_map", filename="x.hmap")
    assert not stored.success
    assert all("Traceback" not in text for _, text in graph.logged)


def test_queries_come_in_a_frame_of_tf(graph: Graph, serve: Any) -> None:
    port = serve()
    robot = graph.types.message("geometry_msgs/TransformStamped")(child_frame_id="robot")
    robot.header.frame_id = "map"
    robot.transform.translation.x = 2.0
    kind = port.message("tf2_msgs/TFMessage")
    with other_node(graph) as node:
        node.create_publisher(kind, "/tf", QoSProfile(depth=1)).publish(kind(transforms=[robot]))
    assert string_at(graph, "occupancy", 0.5, 0.5, "robot") == "Occupied"


def test_maps_are_swapped_while_services_stay(graph: Graph, serve: Any, tmp_path: Path) -> None:
    serve(f"map_directory:={tmp_path}")
    ours = graph.services()[f"{NODE}/get_string_at_point"]
    assert graph.call(f"{NODE}/store_map", filename="copy.hmap").success
    assert len(open_map(tmp_path / "copy.hmap").layers) == 2
    cleared = graph.call(f"{NODE}/clear")
    assert (cleared.success, cleared.message) == (True, "the map is empty now")
    assert graph.latest(f"{NODE}/hypermap_metadata").layer_cnt == 0
    assert graph.call(f"{NODE}/load_map", filename="copy.hmap").success
    assert string_at(graph, "occupancy", 0.5, 0.5) == "Free"
    assert graph.services()[f"{NODE}/get_string_at_point"] is ours
    assert not graph.call(f"{NODE}/load_map", filename="../building.hmap").success
    assert string_at(graph, "occupancy", 0.5, 0.5) == "Free"


def test_other_nodes_fill_layers(graph: Graph, serve: Any) -> None:
    folder = Path(__file__).parents[2] / "ros" / "hypermap" / "maps"
    types = graph.types
    serve(file=folder / "subscribe.yaml")
    assert graph.node(NODE).change_state("deactivate")
    with other_node(graph, "slam") as slam:
        grid = types.message("nav_msgs/OccupancyGrid")(data=array.array("b", [0, 100, -1, 7]))
        grid.header.frame_id = "map"
        grid.info.width, grid.info.height, grid.info.resolution = 2, 2, 0.05
        slam.create_publisher(type(grid), "/map", LATE).publish(grid)
        assert graph.node(NODE).change_state("activate")
        wait_for(lambda: f"{NODE}/occupancy_map" in graph.kept, "the grid")
        assert graph.latest(f"{NODE}/occupancy_map").data == grid.data
        item = types.message("hypermap_msgs/SemanticObject")(name="desk", confidence=[0.5])
        corner = types.message("geometry_msgs/Point32")
        corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)]
        item.shape.points = [corner(x=x, y=y) for x, y in corners]
        semantic = types.message("hypermap_msgs/SemanticMap")(objects=[item])
        semantic.header.frame_id = "map"
        publisher = slam.create_publisher(type(semantic), "/semantic_map", LATE)
        publisher.publish(semantic)
        assert string_at(graph, "semantic", 0.8, 0.2) == "desk"
        with pytest.raises(AssertionError):
            publisher.publish(grid)


def test_updates_change_layers(graph: Graph, serve: Any) -> None:
    serve()
    types = graph.types
    with other_node(graph) as node:
        window = types.message("map_msgs/OccupancyGridUpdate")(
            x=0, y=0, width=1, height=1, data=array.array("b", [50])
        )
        window.header.frame_id = "map"
        grids = node.create_publisher(type(window), f"{NODE}/occupancy_map_updates", LATE)
        grids.publish(window)
        at = point(graph, 0.5, 0.5)
        assert graph.call(f"{NODE}/get_int_at_point", layer="occupancy", location=at).value == 50
        update = types.message("hypermap_msgs/SemanticMapUpdate")(to_delete=[7])
        node.create_publisher(type(update), f"{NODE}/semantic_semmap_updates", LATE).publish(update)
        assert string_at(graph, "semantic", 1.5, 0.5, "lab") == "Empty"
    wait_for(lambda: graph.latest(f"{NODE}/occupancy_map").data[0] == 50, "the grid as changed")


def test_the_lifecycle_takes_topics_and_services_away_and_brings_them_back(
    graph: Graph, serve: Any
) -> None:
    serve()
    ours = graph.node(NODE)
    before = set(graph.services())
    assert ours.change_state("deactivate")
    assert not [name for name in graph.services() if name.startswith(NODE)]
    assert graph.topics().keys() <= {"/tf_static"}
    assert ours.change_state("activate")
    assert set(graph.services()) == before
    assert string_at(graph, "occupancy", 0.5, 0.5) == "Free"
    assert ours.change_state("deactivate")
    assert ours.change_state("cleanup")
    assert ours.change_state("configure")
    assert ours.change_state("activate")
    assert string_at(graph, "occupancy", 0.5, 0.5) == "Free"


def test_parameters_change_what_is_shown(graph: Graph, serve: Any) -> None:
    serve()
    assert graph.node(NODE).set_parameter("show_labels", False) == ""
    kinds = {marker.type for marker in graph.latest(f"{NODE}/semantic_markers").markers}
    assert 9 not in kinds  # text
    assert graph.node(NODE).set_parameter("hidden_classes", ["sofa"]) == ""
    names = {marker.ns for marker in graph.latest(f"{NODE}/semantic_markers").markers}
    assert "sofa" not in names
    assert "read-only" in graph.node(NODE).set_parameter("file", "other.hmap")


def test_a_map_that_is_missing_ends_the_start(graph: Graph, serve: Any, tmp_path: Path) -> None:
    with pytest.raises(HypermapError, match=r"missing\.hmap"):
        serve(file=tmp_path / "missing.hmap")
    assert graph.nodes == []


def test_the_program_serves_until_it_is_reported_to_end(graph: Graph, tmp_path: Path) -> None:
    file = saved(building(), tmp_path / "a map.hmap")
    answers: list[str] = []

    def ask() -> None:
        wait_for(lambda: "/robot/maps/get_string_at_point" in graph.services(), "the node")
        wait_for(lambda: graph.node("/robot/maps").state == "active", "its activation")
        at = point(graph, 0.5, 0.5)
        service = "/robot/maps/get_string_at_point"
        answers.append(graph.call(service, layer="occupancy", location=at).name)
        heights = graph.node("/robot/maps").get_parameter("label_height").value
        answers.append(str(heights))
        graph.ok = False

    client = threading.Thread(target=ask)
    client.start()
    ros = ["--ros-args", "-r", "__ns:=/robot", "-r", "__node:=maps"]
    values = {"label_height": 0.4, "console": False, "hidden_classes": ["potted plant"]}
    run_map_server([str(file), *ros], middleware="ros2", values=values)
    client.join()
    assert answers == ["Free", "0.4"]
    assert graph.nodes == []
