"""The services about notes, over ROS 2's classes and over ROS 1's."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import Any

import pytest
import shapely

from hypermap import Hypermap, Note, NotesLayer, open_map
from hypermap.notes import attachment_of_bytes, notes_layer
from hypermap.ros.server.map_server import MapServer
from hypermap.testing import occupancy_from_text

from .conftest import Process
from .map_server_tools import Client, saved
from .ros2_fixtures import graph, make_port

__all__ = ["graph", "make_port"]

NODE = "/hypermap_server"


def noted(*, is_open: bool = True) -> Hypermap:
    log = attachment_of_bytes(b"battery low", "robot.log")
    notes = [
        Note(shapely.Point(1, 1), "# Loose tile", "Ada", attachments=(log,)),
        Note(shapely.box(3, 0, 5, 2), "wet floor", "Bo"),
    ]
    layer = NotesLayer("notes", "map", notes, {"enable_update": is_open})
    return Hypermap([occupancy_from_text("......\n......", resolution=1.0), layer])


def serve(make_port: Any, hypermap: Hypermap, folder: Any) -> None:
    file = saved(hypermap, folder / "noted.hmap")
    words = ["-p", f"file:={file}", "-p", "load_map:=true", "-p", "console:=false"]
    words += ["-p", f"map_directory:={folder}"]
    port = make_port("hypermap_server", "--ros-args", *words)
    port.manage(MapServer(port))


def place(graph: Any, x: float, y: float) -> Any:
    message = graph.types.message("geometry_msgs/PointStamped")
    point = graph.types.message("geometry_msgs/Point")(x=x, y=y, z=0.0)
    header = graph.types.message("std_msgs/Header")(frame_id="map")
    return message(header=header, point=point)


def test_notes_are_found_with_their_files(graph: Any, make_port: Any, tmp_path: Any) -> None:
    serve(make_port, noted(), tmp_path)
    found = graph.call(f"{NODE}/find_notes")
    assert (found.success, found.frame_id) == (True, "map")
    assert [(note.id, note.title, note.author) for note in found.notes] == [
        (1, "Loose tile", "Ada"),
        (2, "wet floor", "Bo"),
    ]
    assert [len(note.area) for note in found.notes] == [0, 1]
    (file,) = found.notes[0].files
    assert (file.name, file.size, bytes(file.content)) == ("robot.log", 11, b"")
    (whole,) = graph.call(f"{NODE}/find_notes", words="tile", with_content=True).notes
    assert bytes(whole.files[0].content) == b"battery low"
    near = graph.call(f"{NODE}/find_notes", origin=place(graph, 4.0, 1.0))
    assert [note.id for note in near.notes] == [2, 1]
    assert graph.call(f"{NODE}/find_notes", author="bo").notes[0].id == 2
    assert graph.call(f"{NODE}/find_notes", since="2100-01-01T00:00:00Z").notes == []


def test_a_robot_leaves_a_note_with_a_file(graph: Any, make_port: Any, tmp_path: Any) -> None:
    serve(make_port, noted(), tmp_path)
    file = graph.types.message("hypermap_msgs/NoteFile")
    content = graph.types.message("hypermap_msgs/NoteFile")().content
    content = type(content)("B", b"\x1b[31m log") if hasattr(content, "typecode") else b"\x1b log"
    added = graph.call(
        f"{NODE}/add_note",
        location=place(graph, 2.0, 1.0),
        text="I am stuck",
        author="robot 7",
        time="2026-03-02T12:00:00+01:00",
        files=[file(name="log.txt", content=content)],
    )
    assert (added.success, added.message, added.id, added.layer) == (True, "", 3, "notes")
    assert graph.call(f"{NODE}/store_map", filename="after.hmap").success
    note = notes_layer(open_map(tmp_path / "after.hmap"))[3]
    assert (note.text, note.author, note.place.wkt) == ("I am stuck", "robot 7", "POINT (2 1)")
    assert note.time.isoformat() == "2026-03-02T12:00:00+01:00"
    assert note.attachments[0].name == "log.txt"


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"text": ""}, "needs a text"),
        ({"text": "x", "links": ["javascript:1"]}, "begins with http"),
        ({"text": "x", "time": "2026-03-02T12:00"}, "no time zone"),
        ({"text": "x", "time": "soon"}, "is not a time"),
        ({"text": "x", "layer": "occupancy"}, "is of the kind OccupancyLayer"),
    ],
)
def test_a_note_that_cannot_be_is_refused(
    graph: Any, make_port: Any, tmp_path: Any, fields: Any, said: str
) -> None:
    serve(make_port, noted(), tmp_path)
    answer = graph.call(f"{NODE}/add_note", location=place(graph, 1.0, 1.0), **fields)
    assert (answer.success, said in answer.message) == (False, True), answer.message
    assert len(graph.call(f"{NODE}/find_notes").notes) == 2


def test_a_layer_that_takes_no_updates_takes_no_notes(
    graph: Any, make_port: Any, tmp_path: Any
) -> None:
    serve(make_port, noted(is_open=False), tmp_path)
    answer = graph.call(f"{NODE}/add_note", location=place(graph, 1.0, 1.0), text="x")
    assert (answer.success, "enable_update is false" in answer.message) == (False, True)


@pytest.fixture(scope="module")
def client(rospy: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    folder = tmp_path_factory.mktemp("notes")
    file = saved(noted(), folder / "noted.hmap")
    command = [sys.executable, "-m", "hypermap", "serve", str(file), "--ros1", "__name:=noted"]
    process = Process(command, folder / "noted.log")
    yield Client(rospy, "noted")
    process.stop()


@pytest.mark.xdist_group("ros")
def test_ros_1_answers_the_same(client: Client) -> None:
    (note,) = client.call("find_notes", "FindNotes", words="tile", with_content=True).notes
    assert (note.title, note.files[0].content) == ("Loose tile", b"battery low")
    where = client.message("geometry_msgs/PointStamped")
    where.header.frame_id, where.point.x, where.point.y = "map", 2.0, 1.0
    file = client.message("hypermap_msgs/NoteFile")
    file.name, file.content = "log.txt", b"stuck"
    added = client.call("add_note", "AddNote", location=where, text="help", files=[file])
    assert (added.success, added.id) == (True, 3)
