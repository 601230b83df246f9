"""The topics and frames of the map server, and layers that others fill, through a real roscore."""

from __future__ import annotations

import math
import os
import signal
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from hypermap.core.frames import FrameTree
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.testing import occupancy_from_text, square

from .conftest import Process, wait_for
from .map_server_tools import LAB, Client, Robot, building, places, saved

pytestmark = pytest.mark.xdist_group("ros")

Serve = Callable[..., tuple[Client, Process]]


@pytest.fixture
def serve(rospy: Any, start: Callable[..., Process], request: Any, tmp_path: Path) -> Serve:
    """Start a server and return a client of it, and its process."""
    number = iter(range(10))

    def run(hypermap: Hypermap | None, *arguments: str | Path) -> tuple[Client, Process]:
        name = f"server_{os.getpid()}_{abs(hash(request.node.name)) % 10**6}_{next(number)}"
        file = [] if hypermap is None else [saved(hypermap, tmp_path / f"{name}.hmap")]
        words = [*file, "--ros1", *arguments, f"__name:={name}"]
        process = start("hypermap", "serve", *words)
        process.expect("loaded" if file else "without a map")
        return Client(rospy, name), process

    return run


def meta(client: Client, layers: int) -> Any:
    return client.heard(
        "hypermap_metadata", "hypermap_msgs/HypermapMetaData", lambda m: m.layer_cnt == layers
    )


def grid(client: Client, values: list[int], width: int, frame: str = "map", x: float = 0.0) -> Any:
    message = client.message("nav_msgs/OccupancyGrid", data=values)
    message.header.frame_id = frame
    message.info.resolution = 1.0
    message.info.width, message.info.height = width, len(values) // width
    message.info.origin.position.x = x
    message.info.origin.orientation.w = 1.0
    return message


def thing(client: Client, name: str, x: float, y: float, number: int = 0) -> Any:
    message = client.message("hypermap_msgs/SemanticObject", id=number, name=name)
    message.shape = client.box(x - 0.5, y - 0.5, x + 0.5, y + 0.5).polygon
    return message


# What is latched


def test_late_subscribers_hear_of_every_layer_and_of_the_map(serve):
    client, _ = serve(building(publish_global_topics=True))
    described = meta(client, 2)
    assert described.node_name == f"/{client.node}"
    assert [(m.class_name, m.name, m.frame_id) for m in described.layers] == [
        ("OccupancyGridLayer", "occupancy", "map"),
        ("SemanticLayer", "semantic", "lab"),
    ]
    assert all(m.enable_update and m.publish_global_topics for m in described.layers)
    for topic in ("occupancy_map", "/map"):
        message = client.heard(topic, "nav_msgs/OccupancyGrid")
        assert list(message.data) == [0, 0, 100, 100, 100, -1]
        assert (message.header.frame_id, message.info.resolution) == ("map", 1.0)
    for topic in ("occupancy_map_metadata", "/map_metadata"):
        assert client.heard(topic, "nav_msgs/MapMetaData").width == 3
    for topic in ("semantic_semmap", "/semantic_map"):
        message = client.heard(topic, "hypermap_msgs/SemanticMap")
        assert message.header.frame_id == "lab"
        assert [(m.id, m.name) for m in message.objects] == [
            (7, "table"),
            (8, "cup"),
            (9, "chair"),
            (10, "sofa"),
        ]
        assert places([message.objects[0].position]) == [(1.0, 0.5)]
    assert client.heard("semantic_markers", "visualization_msgs/MarkerArray").markers
    for service in ("occupancy_static_map", "/static_map"):
        assert client.call(service, "nav_msgs/GetMap").map.info.height == 2


def test_late_listeners_of_tf_know_where_the_layers_frames_lie(serve):
    client, _ = serve(building())
    ours = client.heard(
        "/tf_static",
        "tf2_msgs/TFMessage",
        lambda m: any(t.child_frame_id == "lab" for t in m.transforms),
    )
    (transform,) = ours.transforms
    assert transform.header.frame_id == "map"
    assert places([transform.transform.translation]) == [(10.0, 0.0)]
    assert transform.transform.rotation.z == pytest.approx(math.sqrt(0.5))


def test_layers_with_names_that_ros_does_not_allow_are_served(serve):
    hypermap = Hypermap(
        [
            occupancy_from_text(".", name="2nd floor"),
            SemanticLayer("büro", "map", [square("desk", 0, 0)]),
        ]
    )
    client, process = serve(hypermap)
    assert list(client.heard("_2nd_floor_map", "nav_msgs/OccupancyGrid").data) == [0]
    assert client.heard("b_ro_semmap", "hypermap_msgs/SemanticMap").objects[0].name == "desk"
    assert client.string("2nd floor", 0.5, 0.5) == "Free"
    assert client.string("büro", 0, 0) == "desk"
    assert "ERROR" not in process.output


def test_of_two_layers_that_want_a_global_topic_the_first_has_it(serve):
    flag = {"publish_global_topics": True}
    layers = [occupancy_from_text(text, name=name) for text, name in ((".", "a"), ("#", "b"))]
    for layer in layers:
        layer.settings.update(flag)
    client, process = serve(Hypermap(layers))
    assert list(client.heard("/map", "nav_msgs/OccupancyGrid").data) == [0]
    assert list(client.heard("b_map", "nav_msgs/OccupancyGrid").data) == [100]
    process.expect("layer 'b' is not published on /map, since layer 'a' is")


# Start and end


def test_a_server_without_a_map_says_so_and_loads_one_later(serve, tmp_path):
    saved(building(), tmp_path / "later.hmap")
    client, process = serve(None, "--map-directory", tmp_path)
    assert meta(client, 0).layers == []
    assert client.call("load_map", "LoadMap", filename="later.hmap").success
    assert len(meta(client, 2).layers) == 2
    assert client.string("semantic", 1, 0.5, "lab") == "table"
    process.expect("loaded later.hmap; base frame map")


def test_without_a_directory_no_file_is_touched(serve, tmp_path):
    client, _ = serve(building())
    for service, kind in (("load_map", "LoadMap"), ("store_map", "StoreMap")):
        error = client.refused(service, kind, filename="x.hmap")
        assert "start the node with the parameter map_directory" in error


@pytest.mark.parametrize(
    ("parameters", "error"),
    [
        (["_load_map:=true", "_load_map_config:=true", "_file:=x"], "cannot both be true"),
        (["_load_map:=true"], "load_map is true, but the parameter file names no file"),
        (["_load_map:=true", "_file:=/nowhere.hmap"], "/nowhere.hmap"),
        (["_tf_timeout:=soon"], "parameter 'tf_timeout' must be a number, got 'soon'"),
    ],
)
def test_a_wrong_start_is_one_line_and_an_exit_code(start, roscore, parameters, error):
    process = start("hypermap", "serve", "--ros1", *parameters, "__name:=wrong_start")
    assert process.popen.wait(30) == 2
    assert error in process.output
    assert "Traceback" not in process.output


@pytest.mark.parametrize("kind", ["load_map", "load_map_config"])
def test_parameters_name_the_map(start, rospy, tmp_path, kind):
    name = f"by_{kind}"
    path = tmp_path / ("x.hmap" if kind == "load_map" else "config.yaml")
    saved(building(), path)
    words = [f"_{kind}:=true", f"_file:={path}", f"__name:={name}"]
    start("hypermap", "serve", "--ros1", *words).expect("loaded")
    assert Client(rospy, name).string("occupancy", 0.5, 0.5) == "Free"


def test_a_file_that_nobody_wants_loaded_is_not(start, roscore, tmp_path):
    words = [f"_file:={tmp_path / 'x.hmap'}", "__name:=file_alone"]
    process = start("hypermap", "serve", "--ros1", *words)
    process.expect("neither load_map nor load_map_config is true: starting without a map")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_ends_on_a_signal_without_a_traceback(serve, number):
    client, process = serve(building())
    assert client.string("occupancy", 0.5, 0.5) == "Free"
    assert process.stop(number) == 0
    assert "Traceback" not in process.output
    assert "ERROR" not in process.output


def test_a_restarted_node_is_heard_and_asked_as_before(serve, start, tmp_path):
    client, process = serve(building())
    heard: list[Any] = []
    kind = client.messages.message_class("nav_msgs/OccupancyGrid")
    subscriber = client.rospy.Subscriber(f"/{client.node}/occupancy_map", kind, heard.append)
    wait_for(lambda: len(heard) == 1, "the map")
    assert process.stop() == 0
    path = saved(Hypermap([occupancy_from_text("#")]), tmp_path / "other.hmap")
    start("hypermap", "serve", path, "--ros1", f"__name:={client.node}").expect("loaded")
    wait_for(lambda: len(heard) == 2, "the map of the restarted node")
    assert list(heard[1].data) == [100]
    assert client.string("occupancy", 0.5, 0.5) == "Occupied"
    subscriber.unregister()


# A new map in place of the old one


def test_a_reload_leaves_no_gap_and_no_mix(serve, tmp_path):
    """In one map both layers say A, in the other B; a client that asks on and on hears either."""
    maps = {
        letter: Hypermap([SemanticLayer(name, "map", [square(letter, 0, 0)]) for name in "xy"])
        for letter in "AB"
    }
    saved(maps["B"], tmp_path / "B.hmap")
    client, _ = serve(maps["A"], "--map-directory", tmp_path)
    saved(maps["A"], tmp_path / "A.hmap")
    answers: list[tuple[str, ...]] = []
    ends = threading.Event()
    failures: list[Exception] = []

    def ask() -> None:
        everything = client.proxy("get_layers_at_point", "hypermap_msgs/GetLayersAtPoint")
        while not ends.is_set():
            try:
                found = everything(location=client.point(0, 0, "map"))
            except client.rospy.ServiceException as error:
                failures.append(error)
                return
            answers.append(tuple(layer.label for layer in found.layers))

    threads = [threading.Thread(target=ask) for _ in range(2)]
    for thread in threads:
        thread.start()
    try:
        for letter in "BABABABA":
            assert client.call("load_map", "LoadMap", filename=f"{letter}.hmap").success
            before = len(answers)
            wait_for(lambda before=before: len(answers) > before or failures, "an answer")
    finally:
        ends.set()
        for thread in threads:
            thread.join()
    assert failures == []
    assert set(answers) == {("A", "A"), ("B", "B")}


def test_topics_and_frames_come_and_go_with_their_layers(serve, tmp_path):
    saved(
        Hypermap(
            [
                occupancy_from_text("#", name="occupancy", frame_id="hall"),
                SemanticLayer("rooms", "hall", [square("room", 0, 0)]),
            ]
        ),
        tmp_path / "other.hmap",
    )
    client, _ = serve(building(), "--map-directory", tmp_path)
    kept: list[Any] = []
    kind = client.messages.message_class("nav_msgs/OccupancyGrid")
    subscriber = client.rospy.Subscriber(f"/{client.node}/occupancy_map", kind, kept.append)
    wait_for(lambda: kept, "the first map")
    client.heard("semantic_semmap", "hypermap_msgs/SemanticMap")
    client.call("load_map", "LoadMap", filename="other.hmap")
    assert [layer.name for layer in meta(client, 2).layers] == ["occupancy", "rooms"]
    wait_for(lambda: len(kept) == 2, "the second map, on the same topic")
    assert kept[1].header.frame_id == "hall"
    assert client.heard("rooms_semmap", "hypermap_msgs/SemanticMap").objects[0].name == "room"
    published = {topic for topic, _ in client.rospy.get_published_topics(f"/{client.node}")}
    assert f"/{client.node}/semantic_semmap" not in published
    assert f"/{client.node}/semantic_markers" not in published
    subscriber.unregister()


# Layers that others fill


@pytest.fixture
def robot(rospy: Any) -> Iterator[Robot]:
    made = Robot(Client(rospy, "robot"))
    yield made
    made.close()


def empty(**settings: Any) -> Hypermap:
    layers = [OccupancyLayer("occupancy", "map"), SemanticLayer("semantic", "lab")]
    for layer in layers:
        layer.settings.update(subscribe_mode=True, **settings)
    return Hypermap(layers, FrameTree([LAB]))


def test_a_layer_in_subscribe_mode_holds_what_came_last(serve, robot):
    client, process = serve(empty())
    assert "is still empty" in client.refused("occupancy_static_map", "nav_msgs/GetMap")
    maps = client.publisher("/map", "nav_msgs/OccupancyGrid")
    for values in ([0, 100], [100, 0, -1, 50]):
        maps.publish(grid(client, values, 2))
        client.heard(
            "occupancy_map", "nav_msgs/OccupancyGrid", lambda m, v=values: list(m.data) == v
        )
    assert client.string("occupancy", 1.5, 0.5) == "Free"
    maps.publish(grid(client, [100], 1, "robot", x=5.0))  # the robot stands at (2, 0)
    client.heard("occupancy_map", "nav_msgs/OccupancyGrid", lambda m: m.info.width == 1)
    assert client.string("occupancy", 7.5, 0.5) == "Occupied"
    maps.unregister()
    assert "WARN" not in process.output


def test_a_map_of_objects_replaces_the_layer_and_keeps_its_ids(serve):
    client, _ = serve(empty())
    objects = client.publisher("/semantic_map", "hypermap_msgs/SemanticMap")

    def publish(frame: str, *things: Any) -> None:
        message = client.message("hypermap_msgs/SemanticMap", objects=list(things))
        message.header.frame_id = frame
        objects.publish(message)

    publish("lab", thing(client, "chair", 1, 1, 41), thing(client, "table", 5, 5, 3))
    client.heard("semantic_semmap", "hypermap_msgs/SemanticMap", lambda m: len(m.objects) == 2)
    location = client.point(1, 1, "lab")
    asked = {"layer": "semantic", "location": location}
    assert client.call("get_int_at_point", "GetIntAtPoint", **asked).value == 41
    publish("map", thing(client, "plant", 9, 1, 5))
    message = client.heard(
        "semantic_semmap", "hypermap_msgs/SemanticMap", lambda m: len(m.objects) == 1
    )
    assert message.header.frame_id == "lab"
    assert places([message.objects[0].position]) == [(1.0, 1.0)]
    assert client.call("get_int_at_point", "GetIntAtPoint", **asked).value == 5
    publish("lab")
    client.heard("semantic_semmap", "hypermap_msgs/SemanticMap", lambda m: not m.objects)
    assert client.string("semantic", 1, 1, "lab") == "Empty"
    objects.unregister()


def test_messages_that_are_wrong_are_ignored_with_one_line_in_the_log(serve):
    client, process = serve(empty())
    maps = client.publisher("/map", "nav_msgs/OccupancyGrid")
    objects = client.publisher("/semantic_map", "hypermap_msgs/SemanticMap")
    maps.publish(grid(client, [0, 100], 2))
    client.heard("occupancy_map", "nav_msgs/OccupancyGrid")
    foreign = client.message("hypermap_msgs/SemanticMap", objects=[thing(client, "rock", 0, 0)])
    foreign.header.frame_id = "mars"
    broken = grid(client, [0, 0], 2)
    broken.info.width = 7
    for _ in range(3):
        maps.publish(grid(client, [1, 2, 3, 4], 2, "mars"))
        maps.publish(broken)
        objects.publish(foreign)
    process.expect("/map: layer 'occupancy': frame 'mars' is unknown to the map")
    process.expect("/semantic_map: layer 'semantic': frame 'mars' is unknown to the map")
    maps.publish(grid(client, [0, 0, 0], 3))
    client.heard("occupancy_map", "nav_msgs/OccupancyGrid", lambda m: m.info.width == 3)
    assert process.output.count("/map: layer 'occupancy'") == 1
    assert process.output.count("/semantic_map: layer 'semantic'") == 1
    maps.publish(broken)
    process.expect("the map of 7 x 1 cells holds 2 numbers")
    assert client.string("occupancy", 2.5, 0.5) == "Free"
    maps.unregister()
    objects.unregister()


def test_a_layer_in_subscribe_mode_is_not_published_where_it_listens(serve):
    client, process = serve(empty(publish_global_topics=True))
    process.expect("layer 'occupancy' listens to /map, so it is not published there")
    published = {topic for topic, _ in client.rospy.get_published_topics()}
    assert not published & {"/map", "/semantic_map"}


# Updates


def grid_update(client: Client, x: int, y: int, values: list[int], width: int) -> Any:
    message = client.message("map_msgs/OccupancyGridUpdate", x=x, y=y, data=values)
    message.header.frame_id = "map"
    message.width, message.height = width, len(values) // width
    return message


def test_an_update_changes_a_part_of_a_grid(serve):
    client, process = serve(building())
    updates = client.publisher("occupancy_map_updates", "map_msgs/OccupancyGridUpdate")
    updates.publish(grid_update(client, 1, 0, [100, 0, 0, 0], 2))
    client.heard(
        "occupancy_map",
        "nav_msgs/OccupancyGrid",
        lambda m: list(m.data) == [0, 100, 0, 100, 0, 0],
    )
    assert client.string("occupancy", 1.5, 0.5) == "Occupied"
    updates.publish(grid_update(client, 2, 0, [0, 0], 2))
    process.expect("reach out of the map of 3 x 2 cells; the message is ignored")
    updates.unregister()


def test_an_update_adds_changes_and_removes_objects(serve):
    client, process = serve(building())
    updates = client.publisher("semantic_semmap_updates", "hypermap_msgs/SemanticMapUpdate")
    updates.publish(
        client.message(
            "hypermap_msgs/SemanticMapUpdate",
            to_add=[thing(client, "plant", 20, 20)],
            to_modify=[9],
            updates=[thing(client, "armchair", 5, 5)],
            to_delete=[7, 8],
        )
    )
    message = client.heard(
        "semantic_semmap", "hypermap_msgs/SemanticMap", lambda m: len(m.objects) == 3
    )
    assert sorted((m.id, m.name) for m in message.objects) == [
        (9, "armchair"),
        (10, "sofa"),
        (11, "plant"),
    ]
    assert client.string("semantic", 1, 0.5, "lab") == "Empty"
    updates.publish(client.message("hypermap_msgs/SemanticMapUpdate", to_delete=[9, 77]))
    process.expect("has no object with id 77; the message is ignored")
    assert client.string("semantic", 5, 5, "lab") == "armchair"
    updates.unregister()


def test_updates_are_ignored_with_a_line_in_the_log_where_they_are_off(serve):
    client, process = serve(building(enable_update=False))
    grids = client.publisher("occupancy_map_updates", "map_msgs/OccupancyGridUpdate")
    objects = client.publisher("semantic_semmap_updates", "hypermap_msgs/SemanticMapUpdate")
    for _ in range(3):
        grids.publish(grid_update(client, 0, 0, [100], 1))
        objects.publish(client.message("hypermap_msgs/SemanticMapUpdate", to_delete=[7]))
    for topic in ("occupancy_map", "semantic_semmap"):
        process.expect(f"{topic}_updates: layer '{topic.partition('_')[0]}': it takes no updates")
    assert client.string("occupancy", 0.5, 0.5) == "Free"
    assert client.string("semantic", 1, 0.5, "lab") == "table"
    assert process.output.count("it takes no updates") == 2
    grids.unregister()
    objects.unregister()


def test_updates_on_the_global_topics_reach_the_layer_in_subscribe_mode(serve):
    client, _ = serve(empty())
    maps = client.publisher("/map", "nav_msgs/OccupancyGrid")
    maps.publish(grid(client, [0, 0], 2))
    client.heard("occupancy_map", "nav_msgs/OccupancyGrid")
    updates = client.publisher("/map_updates", "map_msgs/OccupancyGridUpdate")
    updates.publish(grid_update(client, 1, 0, [100], 1))
    client.heard("occupancy_map", "nav_msgs/OccupancyGrid", lambda m: list(m.data) == [0, 100])
    objects = client.publisher("/semantic_map_updates", "hypermap_msgs/SemanticMapUpdate")
    plant = thing(client, "plant", 1, 1)
    objects.publish(client.message("hypermap_msgs/SemanticMapUpdate", to_add=[plant]))
    client.heard("semantic_semmap", "hypermap_msgs/SemanticMap", lambda m: len(m.objects) == 1)
    for publisher in (maps, updates, objects):
        publisher.unregister()
