"""Rooms that are split along a line."""

from __future__ import annotations

import math

import pytest
import shapely
from hypothesis import given, reject
from hypothesis import strategies as st

from hypermap.core.errors import HypermapError
from hypermap.rooms import Door, Room, Rooms, find_rooms, split_room

from .conftest import along_a_corridor, two_rooms

LEFT, RIGHT = shapely.box(0, 0, 4, 4), shapely.box(4, 0, 9, 4)
DOOR = Door((0, 1), shapely.LineString([(4, 0.5), (4, 1.5)]), 1.0)


def line(*points: tuple[float, float]) -> shapely.LineString:
    return shapely.LineString(points)


def two(left: str = "office", right: str = "Emma's place", hand: bool = True) -> Rooms:
    rooms = Room(0, left, LEFT, "office", 0.8), Room(1, right, RIGHT, is_named=hand)
    return Rooms("map", rooms, (DOOR,))


def test_the_larger_part_stays_and_the_other_is_numbered() -> None:
    split = split_room(two(), 0, line((0, 2.5), (4, 2.5)), 7)
    assert [(r.id, r.name, r.kind, r.sure, r.is_named) for r in split] == [
        (0, "office", "office", 0.8, False),
        (1, "Emma's place", "", 0.0, True),
        (7, "office 2", "office", 0.8, False),
    ]
    assert [room.area for room in split] == [10, 20, 6]
    old, new = split.doors
    assert (old.rooms, old.width) == ((0, 1), 1.0)
    assert new.rooms == (0, 7)
    assert new.width == 3  # the widest disc in the middle of the line reaches the wall at y = 4
    assert new.line.equals(line((0, 2.5), (4, 2.5)))
    again = Rooms.of_layer(split.layer())
    assert [(room.id, room.name, room.is_named) for room in again] == [
        (room.id, room.name, room.is_named) for room in split
    ]


def test_a_door_goes_with_the_part_that_it_is_at_and_a_name_by_hand_stays_one() -> None:
    split = split_room(two(), 1, line((5, 0), (5, 4)), 2)
    assert [(room.name, room.is_named) for room in split][1:] == [
        ("Emma's place", True),
        ("Emma's place 2", True),
    ]
    assert [(door.rooms, door.width) for door in split.doors] == [((0, 2), 1.0), ((1, 2), 2.0)]


@pytest.mark.parametrize(
    ("name", "other", "new"),
    [("office", "office 2", "office 3"), ("office 2", "office", "office 3"), ("7", "x", "7 2")],
)
def test_a_number_that_is_taken_is_left_out(name: str, other: str, new: str) -> None:
    assert split_room(two(name, other), 0, line((0, 2.5), (4, 2.5)), 7)[7].name == new


def test_a_line_that_ends_before_the_wall_is_extended() -> None:
    split = split_room(two(), 0, line((0.3, 2.5), (3.8, 2.5)), 7)
    assert [split[0].area, split[7].area] == [10, 6]


def test_an_opening_on_each_side_of_a_column_is_a_door_and_a_slit_is_none() -> None:
    holes = [[(1, 1.5), (1, 2.5), (2, 2.5), (2, 1.5)], [(2.2, 1.5), (2.2, 2.5), (3, 2.5), (3, 1.5)]]
    room = Room(0, "hall", shapely.Polygon(LEFT.exterior.coords, holes))
    split = split_room(Rooms("map", (room,), ()), 0, line((-1, 2), (5, 2)), 1)
    assert [door.width for door in split.doors] == pytest.approx([1.0, 1.0], abs=0.03)
    assert sum(room.area for room in split) == pytest.approx(room.area)


def test_parts_of_a_room_that_the_line_does_not_meet_stay_with_the_larger_one() -> None:
    far = shapely.box(20, 0, 21, 1)
    room = Room(0, "hall", shapely.MultiPolygon([LEFT, far]))
    split = split_room(Rooms("map", (room,), ()), 0, line((1, -1), (1, 5)), 1)
    assert split[0].outline.covers(far)
    assert (split[0].area, split[1].area) == (13, 4)


@pytest.mark.parametrize(
    ("drawn", "reason"),
    [
        (line((5, 5), (6, 6)), "the line does not divide 'office'; draw it from one wall to"),
        (line((1, 1), (2, 2)), "does not divide 'office'"),
        (line((1, 1), (1, 1)), "does not divide 'office'"),
        (line((1, -1), (1, 5), (3, 5), (3, -1)), "cuts 'office' into more than two parts"),
    ],
)
def test_a_line_that_does_not_make_two_rooms_is_refused(
    drawn: shapely.LineString, reason: str
) -> None:
    with pytest.raises(HypermapError, match=reason):
        split_room(two(), 0, drawn, 7)


def test_only_a_room_can_be_split() -> None:
    with pytest.raises(HypermapError, match="there is no room with the id 5"):
        split_room(two(), 5, line((0, 2), (4, 2)), 7)


@given(st.floats(0, math.pi), st.floats(-1.5, 1.5), st.sampled_from(["corridor", "rooms"]))
def test_the_parts_make_up_the_room_and_edges_stay_shared(
    angle: float, off: float, plan: str
) -> None:
    found = FOUND[plan]
    room = max(found, key=lambda room: room.area)
    x, y = room.outline.centroid.coords[0]
    dx, dy = math.cos(angle), math.sin(angle)
    x, y = x - off * dy, y + off * dx
    drawn = line((x - 20 * dx, y - 20 * dy), (x + 20 * dx, y + 20 * dy))
    try:
        split = split_room(found, room.id, drawn, 99)
    except HypermapError:  # across a branch, or more than once
        reject()
    assert shapely.coverage_is_valid([each.outline for each in split])
    parts = [split[room.id].outline, split[99].outline]
    assert shapely.union_all(parts).symmetric_difference(room.outline).area < 1e-9
    assert parts[0].area >= parts[1].area
    assert len(split.doors) >= len(found.doors)
    for door in split.doors:
        if door.rooms == (room.id, 99):
            assert 0.3 <= door.width <= door.line.length + 0.03
            assert all(door.line.distance(part) < 1e-6 for part in parts)


FOUND = {
    "corridor": find_rooms(along_a_corridor().layer()),
    "rooms": find_rooms(two_rooms().layer()),
}
