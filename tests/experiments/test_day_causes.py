"""At which stage a change was lost, or a wrong one came up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pytest
import shapely

from hypermap.core.history import ADDED, GONE, MOVED, Change
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.experiments.day_causes import cause_of_missed, cause_of_wrong
from hypermap.experiments.mapped_day import MappedDay
from hypermap.experiments.shown import Shown
from hypermap.simulation.days import Day, WorldChange
from hypermap.simulation.world import FloorPlan, World, WorldObject

Place = tuple[float, float]
A, B, C = (1.0, 1.0), (3.0, 1.0), (5.0, 1.0)
OFTEN = (9, 8)  # frames that show a thing, and that detect it


def thing(place: Place, name: str = "chair") -> WorldObject:
    return WorldObject("chair", place, name=name, size={"width": 0.5})


def on_map(number: int, place: Place, name: str = "chair") -> SemanticObject:
    return SemanticObject(name, shapely.Point(place).buffer(0.25), id=number)


def mapped(
    things: Mapping[int, Place],
    objects: Sequence[SemanticObject],
    frames: Mapping[int, tuple[int, int]] | None = None,
) -> MappedDay:
    """Return a day with chairs, and a map with some objects."""
    world = World("day", FloorPlan((0, 0, 6, 2)), objects=tuple(map(thing, things.values())))
    day = Day(world, tuple(things), (), 100)
    shown = Shown(day, 4.0)
    counts = [(frames or {}).get(number, OFTEN) for number in things]
    shown.visible, shown.detected = np.array(counts, np.int64).reshape(-1, 2).T
    return MappedDay(day, Hypermap([SemanticLayer("semantic", "map", objects)]), [], shown)


HAD_IT = mapped({1: A}, [on_map(7, A)])
ADDITION = WorldChange("added", 1, None, thing(A))
MOVE = WorldChange("moved", 1, thing(A), thing(B))


@pytest.mark.parametrize(
    ("frames", "cause"),
    [((2, 2), "out of sight"), ((3, 1), "not detected"), ((3, 2), "not in the map")],
)
def test_a_thing_that_one_map_lacks(frames: tuple[int, int], cause: str) -> None:
    lacks_it = mapped({1: A}, [], {1: frames})
    assert cause_of_wrong(Change(ADDED, "semantic", None, on_map(7, A)), lacks_it, HAD_IT) == cause
    assert cause_of_wrong(Change(GONE, "semantic", on_map(7, A), None), HAD_IT, lacks_it) == cause
    assert cause_of_missed(ADDITION, mapped({}, []), lacks_it) == cause


@pytest.mark.parametrize(
    ("objects", "cause"),
    [
        ([on_map(7, B)], "same place"),
        ([on_map(8, B)], "not matched"),
        ([on_map(7, A), on_map(8, B)], "still in the map"),
        ([on_map(7, C), on_map(8, B)], "another thing"),
    ],
)
def test_a_move_that_is_not_told(objects: Sequence[SemanticObject], cause: str) -> None:
    assert cause_of_missed(MOVE, HAD_IT, mapped({1: B, 2: C}, objects)) == cause


def test_half_a_move_is_told() -> None:
    after = mapped({1: B}, [on_map(8, B)])
    came = Change(ADDED, "semantic", None, on_map(8, B))
    assert cause_of_wrong(came, HAD_IT, after) == "not matched"
    after = mapped({1: B}, [on_map(7, A), on_map(8, B)])
    assert cause_of_wrong(came, HAD_IT, after) == "still in the map"


def test_a_move_of_another_thing() -> None:
    said = Change(MOVED, "semantic", on_map(7, A), on_map(7, B))
    after = mapped({1: A, 2: B}, [on_map(7, B)])
    assert cause_of_wrong(said, HAD_IT, after) == "another thing"


def test_objects_without_a_thing() -> None:
    double, ghost = on_map(8, (1.2, 1.0)), on_map(9, C)
    other = on_map(10, A, "table")
    after = mapped({1: A}, [on_map(7, A), double, ghost, other])
    causes = [
        cause_of_wrong(Change(ADDED, "semantic", None, item), HAD_IT, after)
        for item in (double, ghost, other)
    ]
    assert causes == ["double", "ghost", "another class"]


def test_a_thing_that_really_came() -> None:
    said = Change(ADDED, "semantic", None, on_map(7, A))
    assert cause_of_wrong(said, mapped({}, []), HAD_IT) == "real"
