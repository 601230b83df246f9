"""Which room something is in, what is in a room, and which rooms have something."""

from __future__ import annotations

import pytest
import shapely

from hypermap import FrameTree, Hypermap, Pose2D, SemanticLayer, SemanticObject, Transform
from hypermap.console.commands import Console
from hypermap.console.questions import answered
from hypermap.core.errors import HypermapError
from hypermap.rooms import is_reachable, room_of, rooms_asked, rooms_of_map, rooms_with, with_rooms
from hypermap.rooms.questions import rooms_called
from hypermap.rooms.rooms import known_rooms

from .conftest import two_rooms


def at(name: str, x: float, y: float, number: int) -> SemanticObject:
    return SemanticObject(name, shapely.box(x - 0.1, y - 0.1, x + 0.1, y + 0.1), number)


THINGS = [
    at("refrigerator", 1, 1, 11),
    at("cup", 2, 2, 12),
    at("cup", 6, 2, 13),
    at("printer", 8.7, 3, 14),  # its center lies in the wall of the right room
    at("oven", 0.3, 3, 15),  # and this one's in that of the left
    at("car", 20, 20, 16),
]


@pytest.fixture(scope="module")
def flat() -> Hypermap:
    hypermap = Hypermap([two_rooms().layer(), SemanticLayer("semantic", "map", THINGS)])
    rooms = with_rooms(hypermap, rooms_of_map(hypermap))
    rooms.semantic("rooms").rename(1, "Ada's")
    return rooms


def ids(found) -> set[int]:
    return {item.object.id for item in found}


@pytest.mark.parametrize(
    ("where", "expected"),
    [
        ("kitchen", {11, 12, 15}),  # the name and the kind of the left room
        ("Ada's", {13, 14}),
        ("room 1", {13, 14}),  # by its id
        ("attic", set()),
    ],
)
def test_what_is_in_a_room_is_found_by_its_name_kind_or_id(flat, where, expected):
    assert ids(flat.objects(inside=where)) == expected
    assert ids(flat.objects(["cup", "printer"], inside=where)) == expected & {12, 13, 14}


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["room", "room 2"], {"room 0": "room", "room 1": "room 2", "Room 2": "room 2"}),
        (["lab", "room 4"], {"room 0": "lab", "room 1": None, "Room 4": "room 4"}),
        (["Room 1", "room 2"], {"room 0": None, "room 1": "Room 1", "room 2": "room 2"}),
        (["room 1", "Room 1"], {"room 1": "room 1", "Room 1": "Room 1"}),
        (["room 2", "room 2"], {"room 0": "room 2", "room 1": "room 2"}),
        (["hall", "den"], {"room 0": "hall", "room 1": "den", "Den": "den", "room 2": None}),
    ],
)
def test_a_name_comes_before_an_id(flat, names, expected):
    layer = two_rooms().layer()
    hypermap = with_rooms(Hypermap([layer]), rooms_of_map(Hypermap([layer])))
    for number, name in enumerate(names):
        hypermap.semantic("rooms").rename(number, name)
    known = known_rooms(hypermap)
    found = {what: [room.name for room in rooms_called(known, what)] for what in expected}
    assert found == {what: [] if name is None else [name] for what, name in expected.items()}


def test_a_kind_means_all_rooms_of_it():
    things = [at("oven", 1, 1, 1), at("oven", 6, 2, 2)]
    hypermap = Hypermap([two_rooms().layer(), SemanticLayer("semantic", "map", things)])
    hypermap = with_rooms(hypermap, rooms_of_map(hypermap))
    assert [room.name for room in rooms_asked(hypermap, "Kitchen")] == ["kitchen", "kitchen 2"]
    assert ids(hypermap.objects("oven", inside="kitchen")) == {1, 2}
    assert ids(hypermap.objects("oven", inside="kitchen 2")) == {2}


@pytest.mark.parametrize(
    ("number", "expected"),
    [(11, "kitchen"), (13, "Ada's"), (14, "Ada's"), (15, "kitchen"), (16, None)],
)
def test_the_room_of_an_object_is_reported(flat, number, expected):
    (found,) = (item for item in flat.objects(layer="semantic") if item.object.id == number)
    room = room_of(flat, found)
    assert (None if room is None else room.name) == expected
    for where in ("kitchen", "Ada's"):
        assert (number in ids(flat.objects(inside=where))) == (where == expected)


def test_the_rooms_that_have_something_are_reported(flat):
    assert [room.id for room in rooms_with(flat, "printer")] == [1]
    assert [room.id for room in rooms_with(flat, ["cup", "printer"])] == [0, 1]
    assert rooms_with(flat, "car") == []


@pytest.mark.parametrize(("radius", "expected"), [(0.0, True), (0.4, True), (0.5, False)])
def test_a_room_is_reachable_for_a_robot_that_fits_through_the_doors(flat, radius, expected):
    assert is_reachable(flat, "kitchen", "Ada's", radius) is expected
    assert is_reachable(flat, "room 1", "room 0", radius) is expected
    assert is_reachable(flat, "room 1", "room 1", radius)


@pytest.mark.parametrize(
    ("start", "goal", "radius", "reason"),
    [
        ("kitchen", "room 7", 0.0, "there is no room or kind of room 'room 7'"),
        ("kitchn", "room 1", 0.0, "did you mean 'kitchen'"),
        ("kitchen", "room 1", -0.1, "a robot's radius is 0 or more meters, got -0.1"),
        ("kitchen", "room 1", float("nan"), "a robot's radius is 0 or more meters, got nan"),
    ],
)
def test_what_is_no_room_or_robot_reaches_nothing(flat, start, goal, radius, reason):
    with pytest.raises(HypermapError, match=reason):
        is_reachable(flat, start, goal, radius)


def test_rooms_are_asked_in_the_base_frame(flat):
    frames = FrameTree([Transform("odom", "map", Pose2D(100.0, 0.0))])
    things = SemanticLayer("semantic", "odom", [at("cup", 106, 2, 1)])
    moved = Hypermap([things, *(flat[name] for name in ("occupancy", "rooms"))], frames)
    assert ids(moved.objects("cup", inside="Ada's")) == {1}
    assert room_of(moved, [106.0, 2.0]).name == "Ada's"


def test_without_rooms_the_remedy_is_named():
    with pytest.raises(HypermapError, match="has no rooms; `hypermap rooms MAP -o OUT` finds them"):
        rooms_with(Hypermap(), "printer")


def test_the_shell_asks_for_rooms(flat):
    console = Console(flat)
    assert {line.split()[1] for line in console.run("query --in kitchen").splitlines()} == {
        "label",
        "refrigerator",
        "cup",
        "oven",
    }
    head, row = console.run("query --id 14").splitlines()
    assert head.split() == ["layer", "label", "room", "value", "x", "y"]
    assert row.split()[2] == "Ada's"
    assert [line.split()[1] for line in console.run("query --with printer").splitlines()] == [
        "label",
        "Ada's",
    ]
    assert "nothing found" in console.run("query --with car")
    with pytest.raises(
        HypermapError, match=r"no room or kind of room 'kitchn'; did you mean 'kitc"
    ):
        console.run("query --name cup --in kitchn")


def test_programs_read_in_which_room_each_object_is(flat):
    rows = answered(flat, {"--name": ["cup", "car"]}).rows
    reported = {row["value"]: row["room"] for row in rows}
    assert reported == {12: {"id": 0, "name": "kitchen"}, 13: {"id": 1, "name": "Ada's"}, 16: None}


def test_the_nearest_by_path_is_asked_in_the_shell(flat):
    # By air 2.6 and 2.3 m; through the door, whose corner is at (4.4, 2.05), 3 m to the right one.
    given = "query --name cup --nearest --from 4.2,0.6"
    console = Console(flat)
    assert " 13 " in console.run(given)
    assert " 12 " in console.run(f"{given} --by path --robot-radius 0.1")
    with pytest.raises(HypermapError, match="--by 'foot': expected air or path"):
        console.run("query --name cup --nearest --by foot")
    with pytest.raises(HypermapError, match="--by path measures the nearest; give --nearest"):
        console.run("query --name cup --by path")
    with pytest.raises(HypermapError, match="--robot-radius needs --by path"):
        console.run("query --name cup --nearest --robot-radius 0.2")
