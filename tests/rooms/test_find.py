"""What is a room, in drawn plans."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from hypermap.core.errors import HypermapError
from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticObject
from hypermap.rooms import RoomSettings, find_rooms

from .conftest import (
    SIDE,
    Plan,
    along_a_corridor,
    cubicles_along_a_narrow_corridor,
    layer_of,
    two_rooms,
)


def areas(rooms):
    return sorted(round(room.area, 1) for room in rooms)


def test_a_room_is_what_walls_enclose():
    (room,) = find_rooms(Plan(5, 4).clear(1, 1, 4, 3).layer())
    assert room.outline.equals(shapely.box(1, 1, 4, 3))
    assert (room.id, room.name, room.kind) == (0, "room", "")


def test_a_door_divides_two_rooms():
    rooms = find_rooms(two_rooms(door=0.9).layer())
    assert areas(rooms) == pytest.approx([16, 16], abs=0.2)
    (door,) = rooms.doors
    assert door.rooms == (0, 1)
    assert door.place_xy == pytest.approx([4.5, 2.5], abs=0.15)
    assert door.width == pytest.approx(0.9, abs=0.051)


def test_a_door_may_take_most_of_the_width_of_the_narrower_room():
    plan = Plan(6, 9).clear(1, 1, 5, 6).clear(2, 6, 3.3, 6.1).clear(1.8, 6.1, 3.4, 8.6)
    assert areas(find_rooms(plan.layer())) == pytest.approx([4, 20], abs=0.2)


def coarse(plan: Plan, step: int) -> OccupancyLayer:
    """Return a plan with cells that are larger by a factor."""
    cells = plan.cells[::step, ::step].copy()
    grid = GridGeometry(cells.shape[1], cells.shape[0], step * SIDE)
    return OccupancyLayer("occupancy", "map", grid, cells)


@pytest.mark.parametrize("step", [1, 2, 4])
def test_two_doors_in_one_wall_are_not_one_wide_passage(step):
    plan = Plan(9, 9).clear(0.6, 0.6, 8.4, 4.4).clear(0.6, 4.6, 3.9, 8.4).clear(4.1, 4.6, 8.4, 8.4)
    plan.clear(1.5, 4.4, 2.5, 4.6).clear(4.5, 4.4, 5.5, 4.6)
    assert areas(find_rooms(coarse(plan, step))) == pytest.approx([12.6, 16.4, 29.9], abs=0.5)


@pytest.mark.parametrize("step", [1, 2])
def test_a_line_from_one_door_to_the_next_does_not_widen_the_first(step):
    plan = Plan(8, 12).clear(1.1, 4.1, 3.5, 6.9).clear(3.7, 3.3, 5.9, 6.9).clear(3.7, 7.1, 6.9, 11)
    plan.clear(3.5, 5, 3.7, 6).clear(4, 6.9, 5, 7.1)
    assert areas(find_rooms(coarse(plan, step))) == pytest.approx([6.8, 8.0, 12.6], abs=0.4)


def test_a_wide_passage_between_large_rooms_makes_them_one():
    layer = two_rooms(door=3).layer()
    assert len(find_rooms(layer)) == 1
    layer = two_rooms(door=1.5).layer()
    assert len(find_rooms(layer)) == 2
    assert len(find_rooms(layer, RoomSettings(widest_door=1.0))) == 1


def test_a_corridor_is_not_cut_at_its_doors():
    rooms = find_rooms(along_a_corridor().layer())
    assert len(rooms) == 7
    assert len(rooms.doors) == 6
    (corridor,) = [room for room in rooms if room.kind == "corridor"]
    assert corridor.outline.bounds == pytest.approx((0.5, 5, 13.5, 7), abs=0.25)
    assert {door.rooms for door in rooms.doors} == {
        tuple(sorted((corridor.id, room.id))) for room in rooms if room is not corridor
    }


def test_a_corridor_that_turns_is_one():
    plan = Plan(12, 12).clear(1, 1, 3, 11).clear(1, 9, 11, 11).clear(9, 1, 11, 11)
    assert areas(find_rooms(plan.layer())) == [52]


def test_a_corridor_that_widens_in_places_is_a_corridor():
    plan = Plan(32, 12).clear(1, 5, 31, 7).clear(8, 7, 12, 9).clear(20, 7, 23, 9)
    objects = [SemanticObject("dining table", shapely.box(9, 8, 10, 8.5))]
    (corridor,) = find_rooms(plan.layer(), objects=objects)
    assert corridor.kind == "corridor"
    hall = find_rooms(Plan(12, 8).clear(1, 1, 11, 7).layer(), objects=objects[:0])
    assert [room.kind for room in hall] == [""]


def test_a_cubicle_that_stands_open_to_a_corridor_is_a_room():
    plan = Plan(16, 7).clear(0.5, 0.5, 15.5, 3).clear(4, 3.2, 7, 5.6).clear(4.5, 3, 6.5, 3.2)
    assert areas(find_rooms(plan.layer())) == pytest.approx([7.4, 37.6], abs=0.4)


@pytest.mark.parametrize("turns", range(4))
@pytest.mark.parametrize("step", [1, -1])
def test_cubicles_on_both_sides_of_a_narrow_corridor_are_rooms_however_the_map_lies(turns, step):
    plan = cubicles_along_a_narrow_corridor()
    cells = np.ascontiguousarray(np.rot90(plan.cells[:, ::step], turns))
    rooms = find_rooms(layer_of(cells))
    assert len(rooms) == 9
    assert sum(4.5 < room.area < 5.5 for room in rooms) == 8


def test_the_end_of_a_corridor_beyond_its_last_doors_is_part_of_it():
    plan = Plan(14, 12).clear(0.5, 5.2, 13.5, 7)
    for low, door in ((1, 5), (7.2, 7)):
        plan.clear(0.5, low, 5, low + 4).clear(2.7, door, 3.6, door + 0.2)
    assert areas(find_rooms(plan.layer())) == pytest.approx([18.2, 18.2, 23.4], abs=0.4)


def test_a_narrow_room_along_a_corridor_is_no_part_of_it():
    plan = Plan(12, 6).clear(0.5, 0.5, 11.5, 2.5).clear(2, 2.6, 10, 4.05).clear(5.5, 2.5, 6.5, 2.6)
    assert areas(find_rooms(plan.layer())) == pytest.approx([11.6, 22.1], abs=0.3)


def test_furniture_does_not_divide_a_room():
    plan = Plan(8, 6).clear(1, 1, 7, 5)
    for x in np.arange(1.5, 6.9, 0.6):
        for y in np.arange(1.5, 4.9, 0.6):
            plan.fill(x, y, x + 0.1, y + 0.1)
    plan.fill(3, 2, 3.5, 2.5, value=-1)  # nothing is known of what is below the table
    (room,) = find_rooms(plan.layer())
    assert room.outline.equals(shapely.box(1, 1, 7, 5))  # furniture stands in it


@pytest.mark.parametrize(
    ("width", "depth", "rooms"),
    [(1.5, 1.2, [24.0]), (2.4, 1, [24.0]), (0.2, 1.5, [11.8, 11.9])],
)
def test_a_large_table_does_not_divide_a_room_but_a_wall_between_two_doors_does(
    width, depth, rooms
):
    plan = Plan(8, 6).clear(1, 1, 7, 5)
    plan.fill(4 - width / 2, 3 - depth / 2, 4 + width / 2, 3 + depth / 2)
    assert areas(find_rooms(plan.layer())) == pytest.approx(rooms, abs=0.5)


def test_niches_between_piers_are_part_of_a_room():
    plan = Plan(10, 10).clear(1, 1, 9, 9)
    for pier in ((5, 7.9, 5.2, 9), (1.5, 8.2, 1.7, 9), (1, 7.5, 1.9, 7.7), (1, 6.8, 1.7, 7)):
        plan.fill(*pier)
    assert areas(find_rooms(plan.layer())) == pytest.approx([63.2], abs=0.5)


def test_rays_through_a_window_are_no_room():
    plan = Plan(30, 12).clear(1, 1, 6, 6).fill(7, 0, 30, 12, value=-1)
    for step in range(4):
        low = 2 + 0.5 * step
        plan.clear(6, low, 28, low + 0.1)
    (room,) = find_rooms(plan.layer())
    assert room.outline.bounds == pytest.approx((1, 1, 6, 6), abs=0.5)


def test_what_is_small_is_no_room():
    layer = Plan(9, 4).clear(1, 1, 4, 3).clear(5, 1, 6.5, 2).layer()
    assert areas(find_rooms(layer)) == [1.5, 6]
    assert areas(find_rooms(layer, RoomSettings(least_area=2))) == [6]
    assert len(find_rooms(layer, RoomSettings(least_area=100))) == 0


def test_rooms_lie_where_the_grid_lies():
    origin = Pose2D(10, -3, np.pi / 2)
    (room,) = find_rooms(Plan(5, 4).clear(1, 1, 4, 3).layer(origin))
    assert room.outline.equals(shapely.box(7, -2, 9, 1))


def test_the_same_map_gives_the_same_rooms():
    one, other = (find_rooms(along_a_corridor().layer()) for _ in range(2))
    assert one.cells.tobytes() == other.cells.tobytes()
    assert [room.outline.wkb for room in one] == [room.outline.wkb for room in other]
    assert [door.line.wkb for door in one.doors] == [door.line.wkb for door in other.doors]


@pytest.mark.parametrize("turn", range(8))
def test_a_turned_or_mirrored_map_has_the_same_rooms(turn):
    cells = along_a_corridor().cells
    turned = np.ascontiguousarray(np.rot90(cells if turn < 4 else cells[::-1], turn))
    rooms, expected = find_rooms(layer_of(turned)), find_rooms(layer_of(cells))
    # The space in a doorway, here 0.18 m2, may be part of the room on either side.
    assert areas(rooms) == pytest.approx(areas(expected), abs=3 * 0.18)
    assert len(rooms.doors) == len(expected.doors)


@settings(max_examples=25, deadline=None)
@given(st.data())
def test_rooms_share_edges_and_cover_the_free_space_once(data):
    plan = Plan(6, 5)
    corners = st.integers(0, 10)
    for _ in range(data.draw(st.integers(1, 5))):
        x0, y0 = (data.draw(corners) / 2 for _ in range(2))
        plan.clear(x0, y0, x0 + data.draw(corners) / 3 + 0.5, y0 + data.draw(corners) / 3 + 0.5)
    assume((plan.cells == 0).any())
    rooms = find_rooms(plan.layer())
    outlines = [room.outline for room in rooms]
    assert all(shapely.is_valid(outlines))
    assert shapely.coverage_is_valid(np.array(outlines, dtype=object))
    # Outlines follow the cells, up to what makes them straight.
    assert sum(room.area for room in rooms) == pytest.approx(
        (rooms.cells >= 0).sum() * SIDE**2, abs=0.3
    )
    assert (plan.cells[rooms.cells >= 0] == 0).all()
    large = RoomSettings().least_area / SIDE**2
    assert all((rooms.cells == place).sum() >= large for place in range(len(rooms)))


@pytest.mark.parametrize(
    ("cells", "reason"),
    [
        (np.full((20, 20), -1, dtype=np.int8), "has no free cell"),
        (np.full((1, 1), 100, dtype=np.int8), "has no free cell"),
    ],
)
def test_a_map_without_free_space_is_an_error(cells, reason):
    with pytest.raises(HypermapError, match=reason):
        find_rooms(layer_of(cells))


def test_an_empty_layer_is_an_error():
    with pytest.raises(HypermapError, match="'occupancy' is empty"):
        find_rooms(OccupancyLayer("occupancy", "map"))


def test_a_map_of_one_free_cell_has_no_room():
    assert len(find_rooms(layer_of(np.zeros((1, 1), dtype=np.int8)))) == 0


def test_a_door_narrower_than_a_cell_is_none():
    rooms = find_rooms(two_rooms(door=0).layer())
    assert (len(rooms), rooms.doors) == (2, ())


@pytest.mark.parametrize("value", [0, -1, float("nan"), float("inf")])
def test_settings_are_positive(value):
    with pytest.raises(ValueError, match="widest_door must be a positive number"):
        RoomSettings(widest_door=value)
