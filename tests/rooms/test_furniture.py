"""Known objects are furniture, not walls."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from hypermap.core.semantic import SemanticObject
from hypermap.rooms import find_rooms
from hypermap.simulation.truth import true_objects, true_occupancy, true_rooms
from hypermap.simulation.world import built_in_world

from .conftest import Plan, two_rooms


def test_a_cupboard_that_leaves_a_narrow_way_divides_no_room_if_it_is_known():
    plan = Plan(9, 5).clear(0.5, 0.5, 8.5, 4.5).fill(4.2, 0.5, 4.8, 3.6)
    cupboard = SemanticObject("cupboard", shapely.box(4.2, 0.5, 4.8, 3.6))
    assert len(find_rooms(plan.layer())) == 2
    (room,) = find_rooms(plan.layer(), objects=[cupboard])
    assert room.area == pytest.approx(32, abs=0.3)


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 0, 2)])
def test_a_table_between_chairs_is_inside_of_its_room(order):
    boxes = [(4, 2, 5.2, 3.2), (3.6, 2.3, 4, 2.7), (5.2, 2.3, 5.6, 2.7)]  # a table, two chairs
    plan = Plan(9, 5).clear(0.5, 0.5, 8.5, 4.5)
    for box in boxes:
        plan.fill(*box)
    things = [SemanticObject("thing", shapely.box(*boxes[i])) for i in order]
    (room,) = find_rooms(plan.layer(), objects=things)
    assert room.area == pytest.approx(32, abs=0.3)


def test_objects_in_a_row_do_not_lead_out_of_a_room_into_what_nobody_has_seen():
    row = [SemanticObject("thing", shapely.box(4 + i, 4, 5 + i, 5)) for i in (0, 1, 2)]
    plan = Plan(9, 7).clear(0.5, 0.5, 4.5, 6.5)
    (room,) = find_rooms(plan.layer(), objects=row)
    assert room.area < 25
    assert not room.outline.intersects(shapely.Point(6.5, 4.5))


@pytest.mark.parametrize("reach", [0.1, 0.3, 1.0])
def test_an_object_whose_outline_reaches_through_a_wall_makes_no_door(reach):
    shelf = SemanticObject("shelf", shapely.box(4.4 - reach, 3.5, 4.6 + reach, 4.2))
    rooms = find_rooms(two_rooms(0.9).layer(), objects=[shelf])
    assert [round(room.area) for room in rooms] == [16, 16]
    assert len(rooms.doors) == 1


def test_an_object_outside_of_the_grid_changes_nothing():
    far = SemanticObject("shelf", shapely.box(100, 100, 101, 101))
    layer = two_rooms().layer()
    assert np.array_equal(find_rooms(layer, objects=[far]).cells, find_rooms(layer).cells)


@pytest.mark.parametrize(("name", "count"), [("demo", 1), ("apartment", 4), ("building", 13)])
def test_the_rooms_of_a_furnished_world_are_found(name, count):
    world = built_in_world(name)
    rooms = find_rooms(true_occupancy(world), objects=true_objects(world))
    assert len(rooms) == len(true_rooms(world)) == count
    for true in true_rooms(world):
        best = max(
            room.outline.intersection(true).area / room.outline.union(true).area for room in rooms
        )
        assert best > 0.85
