"""Paths over floors that lifts and stairs connect."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hypermap import GridGeometry, Hypermap, HypermapError, OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.paths import Building, Connector, PathSettings, with_connector
from hypermap.paths.floors import connectors_on
from hypermap.rooms import rooms_of_map, with_rooms

from .conftest import square

A, B, C = "/maps/a.hmap", "/maps/b.hmap", "/maps/sub/c.hmap"


def hall(floor: str = "") -> Hypermap:
    """Return an empty hall of 10 x 4 m with walls around."""
    cells = np.full((80, 200), 0, dtype=np.int8)
    cells[:2] = cells[-2:] = cells[:, :2] = cells[:, -2:] = 100
    layers = [
        OccupancyLayer("occupancy", "map", GridGeometry(200, 80, 0.05), cells),
        SemanticLayer("semantic", "map", [square("desk", 5.0, 2.0, 3)]),
    ]
    return Hypermap(layers, metadata={"floor": floor} if floor else {})


def two_floors(*connectors: Connector, **settings: float) -> Building:
    ground = hall("ground floor")
    for connector in connectors:
        ground = with_connector(ground, connector)
    return Building({A: ground, B: hall("first floor")}, PathSettings(**settings))


LIFT = Connector("lift", (1.0, 1.0), "b.hmap", (1.0, 3.0), "lift A", 5.0)
STAIRS = Connector("stairs", (9.0, 1.0), "b.hmap", (9.0, 3.0), length=8.0)


def test_a_path_over_two_floors_has_a_part_on_each():
    way = two_floors(LIFT).path((A, [4.0, 1.0]), (B, [4.0, 3.0]))
    assert [(part.map, part.floor) for part in way.parts] == [
        (A, "ground floor"),
        (B, "first floor"),
    ]
    assert [part.path.points_xy.tolist() for part in way.parts] == [
        [[4.0, 1.0], [1.0, 1.0]],
        [[1.0, 3.0], [4.0, 3.0]],
    ]
    assert way.connectors == (LIFT,)
    assert way.length == pytest.approx(3 + 5 + 3)


@pytest.mark.parametrize(
    ("x", "chosen", "length"), [(4.0, LIFT, 3 + 5 + 3), (7.5, STAIRS, 1.5 + 8 + 1.5)]
)
def test_of_several_the_one_is_taken_by_which_the_whole_is_shortest(x, chosen, length):
    way = two_floors(LIFT, STAIRS).path((A, [x, 1.0]), (B, [x, 3.0]))
    assert way.connectors == (chosen,)
    assert way.length == pytest.approx(length)


def test_they_lead_back_and_over_a_third_floor():
    first = with_connector(hall(), LIFT)
    third = with_connector(hall(), Connector("lift", (9.0, 1.0), "../b.hmap", (9.0, 2.0)))
    building = Building({A: first, B: hall(), C: third})
    way = building.path((C, [8.0, 1.0]), (A, [2.0, 1.0]))
    assert [part.map for part in way.parts] == [C, B, A]
    assert way.length == pytest.approx(1 + math.hypot(8, 1) + 5 + 1)


def test_two_places_of_one_floor_may_be_nearest_by_another():
    split = hall()
    cells = split.occupancy().cells.copy()
    cells[:, 100:104] = 100  # a wall through all of the hall
    layers = [OccupancyLayer("occupancy", "map", split.occupancy().grid, cells)]
    ground = with_connector(with_connector(Hypermap(layers), LIFT), STAIRS)
    way = Building({A: ground, B: hall()}).path((A, [2.0, 1.0]), (A, [8.0, 1.0]))
    assert [part.map for part in way.parts] == [A, B, A]
    assert way.connectors == (LIFT, STAIRS)


def test_a_goal_may_be_a_room_or_an_object_in_front_of_which_it_ends():
    building = two_floors(LIFT)
    way = building.path((A, [4.0, 1.0]), (B, "desk"), distance=0.5)
    assert way.approach is not None
    assert way.approach.distance == pytest.approx(0.5, abs=0.05)
    assert way.parts[-1].path is way.approach.path
    upper = with_rooms(hall(), rooms_of_map(hall()))
    to_room = Building({A: with_connector(hall(), LIFT), B: upper})
    assert to_room.path((A, 3), (B, "room 0")).parts[1].path.rooms[0].id == 0


def test_the_same_again_replaces_it_and_maps_keep_it(tmp_path):
    hypermap = hall()
    for connector in (LIFT, STAIRS, Connector("lift", (2.0, 1.0), "b.hmap", (2, 3), "lift A")):
        hypermap = with_connector(hypermap, connector)
    assert [each.at_xy for each in connectors_on(hypermap)] == [(9.0, 1.0), (2.0, 1.0)]


@pytest.mark.parametrize(
    ("connectors", "goal", "error"),
    [
        (
            (),
            (B, [4.0, 3.0]),
            r"no path leads from \(4.00, 1.00\) on /maps/a.hmap to \(4.00, 3.00\)",
        ),
        ((LIFT,), (C, [4.0, 3.0]), "no lift or stairs leads to /maps/sub/c.hmap; known: /maps/a"),
        ((LIFT,), (B, [0.0, 0.0]), "no path leads"),
        (
            (Connector("lift", (1.0, 1.0), "b.hmap", (0.05, 3.0), "lift A"),),
            (B, [4.0, 3.0]),
            "; lift A on /maps/b.hmap .* is in a wall",
        ),
    ],
)
def test_what_leads_nowhere_is_one_error_with_the_reason(connectors, goal, error):
    with pytest.raises(HypermapError, match=error):
        two_floors(*connectors).path((A, [4.0, 1.0]), goal)


@pytest.mark.parametrize(
    ("entries", "error"),
    [
        ("lift", "metadata: connectors must be a list, got str"),
        ([{"at": [1, 1], "there": [1, 1]}], r"connectors\[0\] is not a lift or stairs.*'to'"),
        ([{"at": [1], "there": [1, 1], "to": "b"}], r"connectors\[0\] is not a lift or stairs"),
        ([{"at": [1, math.nan], "there": [1, 1], "to": "b"}], "places must be finite"),
        ([{"at": [1, 1], "there": [1, 1], "to": "b", "length": -1}], "a length must be 0 or more"),
        (["b.hmap"], r"connectors\[0\] is not a lift or stairs"),
    ],
)
def test_wrong_metadata_is_one_error(entries, error):
    with pytest.raises(HypermapError, match=error):
        Building({A: Hypermap(metadata={"connectors": entries})})
