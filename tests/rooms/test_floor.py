"""Floor that nobody saw is no wall, if it is in a room."""

from __future__ import annotations

import pytest
import shapely

from hypermap.core.semantic import SemanticObject
from hypermap.rooms import find_rooms
from hypermap.rooms.openings import openings

from .conftest import Plan, two_rooms

UNKNOWN = -1


def one_room() -> Plan:
    return Plan(9, 5).clear(0.5, 0.5, 8.5, 4.5)


@pytest.mark.parametrize("width", [0.1, 0.4, 0.7])
def test_the_shadow_of_a_door_post_divides_no_room(width):
    plan = one_room().fill(5, 0.5, 5 + width, 4.5, UNKNOWN)
    (room,) = find_rooms(plan.layer())
    assert room.area == pytest.approx(32, abs=0.3)


@pytest.mark.parametrize("width", [0.1, 0.4, 0.7])
def test_a_wall_of_any_thickness_divides_rooms(width):
    plan = one_room().fill(4, 0.5, 4 + width, 4.5)
    assert len(find_rooms(plan.layer())) == 2


def test_what_nobody_saw_behind_a_cupboard_belongs_to_the_room():
    plan = one_room().fill(3.5, 0.5, 5.2, 1.4, UNKNOWN).fill(3.5, 1.4, 4.2, 1.6)
    (room,) = find_rooms(plan.layer())
    assert room.outline.covers(shapely.Point(4.5, 1.0))


def test_a_shaft_that_nobody_saw_is_no_part_of_a_room():
    plan = one_room().fill(3, 0.5, 5, 2.0).fill(3.2, 0.7, 4.8, 1.8, UNKNOWN)
    for room in find_rooms(plan.layer()):
        assert not room.outline.intersects(shapely.box(3.3, 0.8, 4.7, 1.7))


def test_what_nobody_has_explored_is_no_part_of_a_room():
    plan = one_room().fill(5, 0.5, 8.5, 4.5, UNKNOWN)
    (room,) = find_rooms(plan.layer())
    assert room.area == pytest.approx(18, abs=0.3)


def test_where_nothing_is_occupied_unknown_cells_are_the_walls():
    plan = two_rooms(0.9)
    plan.cells[plan.cells == 100] = UNKNOWN
    assert [round(room.area) for room in find_rooms(plan.layer())] == [16, 16]


def test_a_niche_behind_furniture_that_nobody_fits_through_is_no_room():
    plan = one_room().fill(0.5, 1.6, 1.7, 1.8).fill(1.7, 0.5, 1.9, 1.4)
    (room,) = find_rooms(plan.layer())
    assert room.outline.covers(shapely.Point(1, 1))


@pytest.mark.parametrize(("length", "count"), [(0.6, 0), (1.2, 1)])
def test_a_wall_continues_for_five_times_its_length_at_most(length, count):
    room = shapely.box(0, 0, 8, 5) - shapely.box(4, 0, 5, length) - shapely.box(4, 4.9, 5, 5)
    lines = openings(room, tolerance=0.05, longest=4.5, wall=0.5)
    assert len([line for line in lines if shapely.LineString(line).length > 3]) == 2 * count


def test_specks_of_floor_behind_a_cupboard_do_not_make_it_a_wall():
    plan = one_room().fill(4.2, 0.5, 4.8, 3.6).clear(4.4, 0.5, 4.6, 0.7).clear(4.3, 2.0, 4.4, 2.1)
    cupboard = SemanticObject("cupboard", shapely.box(4.2, 0.7, 4.8, 3.6))
    (room,) = find_rooms(plan.layer(), objects=[cupboard])
    assert room.area == pytest.approx(32, abs=0.3)


def test_cells_that_stick_out_of_two_objects_do_not_join_them_to_a_wall():
    plan = one_room().fill(3.4, 0.5, 4.4, 3.5).fill(4.6, 1.0, 5.6, 3.0).fill(4.4, 2.0, 4.6, 2.1)
    things = [
        SemanticObject("sofa", shapely.box(3.4, 0.5, 4.4, 3.5)),
        SemanticObject("table", shapely.box(4.6, 1.0, 5.6, 3.0)),
    ]
    (room,) = find_rooms(plan.layer(), objects=things)
    assert room.area == pytest.approx(32, abs=0.3)
