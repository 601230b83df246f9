"""The services about rooms over ROS 1, asked through a real roscore, and over ROS 2's classes."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest
import shapely

from hypermap.core.hypermap import Hypermap
from hypermap.formats import open_map
from hypermap.rooms import Rooms, find_rooms, rooms_of_map, with_rooms
from hypermap.ros.server.map_server import MapServer

from .conftest import Process
from .map_server_tools import Client, saved
from .rooms_to_serve import flat
from .ros2_fixtures import graph, make_port

__all__ = ["graph", "make_port"]

ros = pytest.mark.xdist_group("ros")


def bare() -> Hypermap:
    """Return the flat before anybody has looked for rooms."""
    hypermap = flat()
    hypermap.remove("rooms")
    return hypermap


@pytest.fixture(scope="module")
def servers(rospy: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    folder = tmp_path_factory.mktemp("rooms")
    running = []
    for name, hypermap in (("with_rooms", flat()), ("without_rooms", bare())):
        file = saved(hypermap, folder / f"{name}.hmap")
        command = [sys.executable, "-m", "hypermap", "serve", str(file), "--ros1"]
        command += ["--param", f"map_directory={folder}", f"__name:={name}"]
        running.append(Process(command, folder / f"{name}.log"))
    yield
    for process in running:
        process.stop()


@pytest.fixture(scope="module")
def client(rospy: Any, servers: None) -> Client:
    return Client(rospy, "with_rooms")


@pytest.fixture(scope="module")
def finder(rospy: Any, servers: None) -> Client:
    return Client(rospy, "without_rooms")


@ros
@pytest.mark.parametrize(
    ("object_", "room"), [("0", "Emma's place"), ("1", "office"), ("cup 1", "office")]
)
def test_the_room_of_an_object_is_reported(client: Client, object_: str, room: str) -> None:
    answer = client.call("get_room_of", "GetRoomOf", object=object_)
    assert (answer.success, answer.message, answer.frame_id) == (True, "", "map")
    assert [found.name for found in answer.rooms] == [room]


@ros
def test_a_room_is_reported_with_all_that_is_known_of_it(client: Client) -> None:
    (room,) = client.call("get_rooms_with", "GetRoomsWith", name="cup").rooms[:1]
    assert (room.id, room.kind, room.sure, room.area) == (0, "kitchen", 1.0, pytest.approx(16.4))
    (part,) = room.outline
    corners = shapely.Polygon([(corner.x, corner.y) for corner in part.exterior.points])
    assert corners.symmetric_difference(shapely.box(0.4, 0.5, 4.5, 4.5)).area < 1e-4
    assert part.holes == []


@ros
def test_the_rooms_with_something_are_reported(client: Client) -> None:
    answer = client.call("get_rooms_with", "GetRoomsWith", name="cup")
    assert [room.name for room in answer.rooms] == ["Emma's place", "office"]
    none = client.call("get_rooms_with", "GetRoomsWith", name="printer")
    assert (none.success, none.rooms) == (True, [])


@ros
def test_a_question_in_english_is_answered_in_words_and_objects(client: Client) -> None:
    answer = client.call("ask", "Ask", question="which cups are in the office?")
    assert (answer.success, answer.frame_id, answer.count) == (True, "map", 1)
    assert [state.object.id for state in answer.objects] == [1]
    assert answer.answer == "cup 1 at (7.50, 4.00), in office"
    assert json.loads(answer.query)["names"] == ["cup"]
    as_query = client.call("ask", "Ask", question=answer.query)
    assert as_query.answer == answer.answer


@ros
@pytest.mark.parametrize(("x", "number"), [(3.0, 0), (8.0, 1)])
def test_what_is_nearest_depends_on_where_the_asker_is(
    client: Client, x: float, number: int
) -> None:
    pose = client.message("geometry_msgs/PoseStamped")
    pose.header.frame_id, pose.pose.position.x, pose.pose.position.y = "map", x, 2.0
    answer = client.call("ask", "Ask", question="where is the nearest cup?", pose=pose)
    assert [state.object.id for state in answer.objects] == [number]
    assert answer.distances == pytest.approx([{0: 1.0, 1: 1.96}[number]], abs=0.5)


@ros
@pytest.mark.parametrize(("radius", "reachable"), [(0.0, True), (0.45, True), (0.46, False)])
def test_a_room_is_reachable_through_wide_doors(
    client: Client, radius: float, reachable: bool
) -> None:
    asked = {"start": "room 1", "goal": "kitchen", "robot_radius": radius}
    answer = client.call("is_room_reachable", "IsRoomReachable", **asked)
    assert (answer.success, answer.reachable) == (True, reachable)


@ros
@pytest.mark.parametrize(
    ("service", "type_name", "fields", "error"),
    [
        ("get_room_of", "GetRoomOf", {"object": "cup"}, "2 objects are called 'cup'; ask for one"),
        ("get_room_of", "GetRoomOf", {"object": "14"}, "there is no object or room 14"),
        ("ask", "Ask", {"question": "sing me a song"}, "sing"),
        ("ask", "Ask", {"question": "where is the nearest cup?"}, "depends on where you are"),
        ("ask", "Ask", {"question": '{"names": 3}'}, "names"),
        (
            "is_room_reachable",
            "IsRoomReachable",
            {"start": "room 1", "goal": "ofice"},
            "there is no room or kind of room 'ofice'; did you mean 'office'?",
        ),
        (
            "is_room_reachable",
            "IsRoomReachable",
            {"start": "room 1", "goal": "room 0", "robot_radius": -1.0},
            "a robot's radius is 0 or more meters, got -1.0",
        ),
        ("find_rooms", "FindRooms", {"widest_door": -1.0}, "widest_door must be a positive number"),
        ("find_rooms", "FindRooms", {"least_area": 1000.0}, "no place is as large as least_area"),
        ("find_rooms", "FindRooms", {"layer": "things"}, "things"),
    ],
)
def test_what_cannot_be_answered_is_an_error_that_the_caller_can_read(
    client: Client, service: str, type_name: str, fields: dict[str, Any], error: str
) -> None:
    assert error in client.refused(service, type_name, **fields)


@ros
def test_rooms_are_found_published_and_keep_ids_and_names(
    finder: Client, tmp_path_factory: pytest.TempPathFactory
) -> None:
    error = finder.refused("get_rooms_with", "GetRoomsWith", name="cup")
    assert "the map has no rooms" in error
    answer = finder.call("find_rooms", "FindRooms")
    expected = rooms_of_map(bare())
    assert (answer.success, answer.frame_id) == (True, "map")
    assert [(room.id, room.name) for room in answer.rooms] == [
        (room.id, room.name) for room in expected
    ]
    (door,) = answer.doors
    assert (door.room, door.other, door.width) == (0, 1, expected.doors[0].width)
    line = [(door.begin.x, door.begin.y), (door.end.x, door.end.y)]
    assert line == list(expected.doors[0].line.coords)
    semmap = finder.heard("rooms_semmap", "hypermap_msgs/SemanticMap")
    assert [item.name for item in semmap.objects] == [room.name for room in expected]
    assert finder.call(
        "is_room_reachable", "IsRoomReachable", start="room 0", goal="room 1"
    ).reachable

    again = finder.call("find_rooms", "FindRooms", widest_door=1.5)
    assert [room.id for room in again.rooms] == [room.id for room in answer.rooms]


def test_ros_2_answers_the_same(graph: Any, make_port: Any, tmp_path: Any) -> None:
    rooms = find_rooms(flat().occupancy())
    named = Rooms(
        "map", tuple(replace(room, name=f"hall {room.id}") for room in rooms), rooms.doors
    )
    file = saved(with_rooms(bare(), named), tmp_path / "flat.hmap")
    words = ["-p", f"file:={file}", "-p", "load_map:=true", "-p", "console:=false"]
    words += ["-p", f"map_directory:={tmp_path}"]
    port = make_port("hypermap_server", "--ros-args", *words)
    port.manage(MapServer(port))
    node = "/hypermap_server"
    (room,) = graph.call(f"{node}/get_room_of", object="cup 1").rooms
    assert (room.name, room.named_by_hand, len(room.outline)) == ("hall 1", False, 1)
    assert len(graph.call(f"{node}/get_rooms_with", name="cup").rooms) == 2
    asked = {"start": "hall 0", "goal": "room 1"}
    for radius, reachable in ((0.4, True), (0.5, False)):
        answer = graph.call(f"{node}/is_room_reachable", **asked, robot_radius=radius)
        assert (answer.success, answer.reachable) == (True, reachable)
    answer = graph.call(f"{node}/is_room_reachable", start="hall 0", goal="cellar")
    assert (answer.success, answer.reachable) == (False, False)
    assert "there is no room or kind of room 'cellar'" in answer.message
    said = graph.call(f"{node}/ask", question="how many cups are there?")
    assert (said.success, said.count, said.answer) == (True, 2, "2")
    unread = graph.call(f"{node}/ask", question="sing me a song")
    assert (unread.success, unread.objects) == (False, [])
    assert "sing" in unread.message
    found = graph.call(f"{node}/find_rooms")
    assert (found.success, len(found.rooms), len(found.doors)) == (True, 2, 1)
    assert graph.call(f"{node}/store_map", filename="found.hmap").success
    kept = Rooms.of_layer(open_map(tmp_path / "found.hmap").semantic("rooms"))
    assert [item.id for item in kept] == [0, 1]
