"""The topics and frames of the map server, and layers that others fill, through a real roscore."""

from __future__ import annotations

import json
import math
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from hypermap.core.frames import FrameTree
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.core.value_layer import ValueLayer
from hypermap.testing import occupancy_from_text, square

from .conftest import Process, wait_for
from .map_server_tools import LAB, Client, Robot, building, places, saved

Serve = Callable[[Hypermap], tuple[Client, "Log"]]

pytestmark = pytest.mark.xdist_group("ros")


@pytest.fixture(scope="module")
def directory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("maps")


@pytest.fixture(scope="module")
def server(rospy: Any, directory: Path) -> Iterator[Process]:
    words = ["--ros1", "--map-directory", str(directory), "__name:=topics_server"]
    process = Process([sys.executable, "-m", "hypermap", "serve", *words], directory / "log")
    process.expect("starting without a map")
    yield process
    process.stop()


class Log:
    """What a server writes from now on."""

    def __init__(self, process: Process) -> None:
        self._process = process
        self._begin = len(process.output)

    @property
    def output(self) -> str:
        return self._process.output[self._begin :]

    def expect(self, text: str) -> None:
        wait_for(lambda: text in self.output, f"{text!r} in {self.output!r}")


@pytest.fixture
def serve(rospy: Any, server: Process, directory: Path) -> Serve:
    """Let the server of this module load a map; return a client of it, and its log from then on."""

    def run(hypermap: Hypermap) -> tuple[Client, Log]:
        client, log = Client(rospy, "topics_server"), Log(server)
        saved(hypermap, directory / "map.hmap")
        assert client.call("load_map", "LoadMap", filename="map.hmap").success
        return client, log

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


def test_measured_values_are_a_grid_whose_scale_is_reported(serve):
    hypermap = building()
    values = ValueLayer("warmth", "lab", GridGeometry(3, 1, 1.0), [[20, math.nan, 30]], "°C")
    values.settings["publish_global_topics"] = True
    hypermap.add(values)
    client, log = serve(hypermap)
    message = client.heard("warmth_values", "nav_msgs/OccupancyGrid")
    assert list(message.data) == [0, -1, 100]
    assert message.header.frame_id == "lab"
    scale = json.loads(client.heard("warmth_values_scale", "std_msgs/String").data)
    assert scale == {"quantity": "warmth", "unit": "°C", "at_0": 20, "at_100": 30}
    log.expect("there is no global topic for layers of class ValueLayer")


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
    client, log = serve(hypermap)
    assert list(client.heard("layer_2nd_floor_map", "nav_msgs/OccupancyGrid").data) == [0]
    assert client.heard("b_ro_semmap", "hypermap_msgs/SemanticMap").objects[0].name == "desk"
    assert client.string("2nd floor", 0.5, 0.5) == "Free"
    assert client.string("büro", 0, 0) == "desk"
    assert "ERROR" not in log.output


def test_of_two_layers_that_want_a_global_topic_the_first_has_it(serve):
    flag = {"publish_global_topics": True}
    layers = [occupancy_from_text(text, name=name) for text, name in ((".", "a"), ("#", "b"))]
    for layer in layers:
        layer.settings.update(flag)
    client, log = serve(Hypermap(layers))
    assert list(client.heard("/map", "nav_msgs/OccupancyGrid").data) == [0]
    assert list(client.heard("b_map", "nav_msgs/OccupancyGrid").data) == [100]
    log.expect("layer 'b' is not published on /map, since layer 'a' is")


# A new map in place of the old one


def test_a_reload_leaves_no_gap_and_no_mix(serve, directory):
    """In one map both layers say A, in the other B; a client that asks on and on hears either."""
    maps = {
        letter: Hypermap([SemanticLayer(name, "map", [square(letter, 0, 0)]) for name in "xy"])
        for letter in "AB"
    }
    saved(maps["B"], directory / "B.hmap")
    client, _ = serve(maps["A"])
    saved(maps["A"], directory / "A.hmap")
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


def test_topics_and_frames_come_and_go_with_their_layers(serve, directory):
    saved(
        Hypermap(
            [
                occupancy_from_text("#", name="occupancy", frame_id="hall"),
                SemanticLayer("rooms", "hall", [square("room", 0, 0)]),
            ]
        ),
        directory / "other.hmap",
    )
    client, _ = serve(building())
    kept: list[Any] = []
    kind = client.messages.message_class("nav_msgs/OccupancyGrid")
    subscriber = client.rospy.Subscriber(f"/{client.node}/occupancy_map", kind, kept.append)
    wait_for(lambda: kept, "the first map")
    client.heard("semantic_semmap", "hypermap_msgs/SemanticMap")
    client.call("load_map", "LoadMap", filename="other.hmap")
    assert [layer.name for layer in meta(client, 2).layers] == ["occupancy", "rooms"]
    wait_for(lambda: kept[-1].header.frame_id == "hall", "the second map, on the same topic")
    assert client.heard("rooms_semmap", "hypermap_msgs/SemanticMap").objects[0].name == "room"
    assert not client.published() & {"semantic_semmap", "semantic_markers"}
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
    client, log = serve(empty())
    assert "is still empty" in client.refused("occupancy_static_map", "nav_msgs/GetMap")
    maps = client.publisher("/map", "nav_msgs/OccupancyGrid")
    for values in ([0, 100], [100, 0, -1, 50]):
        maps.publish(grid(client, values, 2))
        client.heard(
            "occupancy_map", "nav_msgs/OccupancyGrid", lambda m, v=values: list(m.data) == v
        )
    assert client.string("occupancy", 1.5, 0.5) == "Free"
    robot.wait_until_known_to(client)
    maps.publish(grid(client, [100], 1, "robot", x=5.0))  # the robot stands at (2, 0)
    client.heard("occupancy_map", "nav_msgs/OccupancyGrid", lambda m: m.info.width == 1)
    assert client.string("occupancy", 7.5, 0.5) == "Occupied"
    maps.unregister()
    assert "WARN" not in log.output


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
    client, log = serve(empty())
    maps = client.publisher("/map", "nav_msgs/OccupancyGrid")
    objects = client.publisher("/semantic_map", "hypermap_msgs/SemanticMap")
    maps.publish(grid(client, [0, 100], 2))
    client.heard("occupancy_map", "nav_msgs/OccupancyGrid")
    foreign = client.message("hypermap_msgs/SemanticMap", objects=[thing(client, "rock", 0, 0)])
    foreign.header.frame_id = "mars"
    broken = grid(client, [0, 0], 2)
    broken.info.width = 7
    maps.publish(grid(client, [1, 2, 3, 4], 2, "mars"))
    objects.publish(foreign)
    log.expect("/map: layer 'occupancy': frame 'mars' is unknown to the map")
    log.expect("/semantic_map: layer 'semantic': frame 'mars' is unknown to the map")
    maps.publish(broken)  # for another reason
    log.expect("/map: layer 'occupancy': the map of 7 x 1 cells has 2 numbers")
    objects.publish(foreign)
    broken.info.width = 8  # for the same one
    maps.publish(broken)
    maps.publish(grid(client, [0, 0, 0], 3))
    client.heard("occupancy_map", "nav_msgs/OccupancyGrid", lambda m: m.info.width == 3)
    assert log.output.count("/map: layer 'occupancy'") == 2
    assert log.output.count("/semantic_map: layer 'semantic'") == 1
    maps.publish(broken)
    log.expect("the map of 8 x 1 cells has 2 numbers")
    assert client.string("occupancy", 2.5, 0.5) == "Free"
    maps.unregister()
    objects.unregister()


def test_a_layer_in_subscribe_mode_is_not_published_where_it_listens(serve):
    client, log = serve(empty(publish_global_topics=True))
    log.expect("layer 'occupancy' listens to /map, so it is not published there")
    assert not client.published() & {"/map", "/semantic_map"}


def test_reloads_amid_a_flood_of_messages_end(serve, directory):
    client, _ = serve(empty())
    maps = client.publisher("/map", "nav_msgs/OccupancyGrid")
    ends = threading.Event()

    def flood() -> None:
        while not ends.wait(0.005):
            maps.publish(grid(client, [0, 100], 2))

    thread = threading.Thread(target=flood)
    thread.start()
    try:
        for _ in range(10):
            assert client.call("load_map", "LoadMap", filename="map.hmap").success
        client.heard("occupancy_map", "nav_msgs/OccupancyGrid", lambda m: list(m.data) == [0, 100])
    finally:
        ends.set()
        thread.join()
        maps.unregister()


# Updates


def grid_update(client: Client, x: int, y: int, values: list[int], width: int) -> Any:
    message = client.message("map_msgs/OccupancyGridUpdate", x=x, y=y, data=values)
    message.header.frame_id = "map"
    message.width, message.height = width, len(values) // width
    return message


def test_an_update_changes_a_part_of_a_grid(serve):
    client, log = serve(building())
    updates = client.publisher("occupancy_map_updates", "map_msgs/OccupancyGridUpdate")
    updates.publish(grid_update(client, 1, 0, [100, 0, 0, 0], 2))
    client.heard(
        "occupancy_map",
        "nav_msgs/OccupancyGrid",
        lambda m: list(m.data) == [0, 100, 0, 100, 0, 0],
    )
    assert client.string("occupancy", 1.5, 0.5) == "Occupied"
    updates.publish(grid_update(client, 2, 0, [0, 0], 2))
    log.expect("reach out of the map of 3 x 2 cells; the message is ignored")
    updates.unregister()


def test_an_update_adds_changes_and_removes_objects(serve):
    client, log = serve(building())
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
    log.expect("has no object with id 77; the message is ignored")
    assert client.string("semantic", 5, 5, "lab") == "armchair"
    updates.unregister()


def test_updates_are_ignored_with_a_line_in_the_log_where_they_are_off(serve):
    client, log = serve(building(enable_update=False))
    grids = client.publisher("occupancy_map_updates", "map_msgs/OccupancyGridUpdate")
    objects = client.publisher("semantic_semmap_updates", "hypermap_msgs/SemanticMapUpdate")
    for _ in range(3):
        grids.publish(grid_update(client, 0, 0, [100], 1))
        objects.publish(client.message("hypermap_msgs/SemanticMapUpdate", to_delete=[7]))
    for topic in ("occupancy_map", "semantic_semmap"):
        log.expect(f"{topic}_updates: layer '{topic.partition('_')[0]}': it accepts no updates")
    assert client.string("occupancy", 0.5, 0.5) == "Free"
    assert client.string("semantic", 1, 0.5, "lab") == "table"
    assert log.output.count("it accepts no updates") == 2
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
