"""What the frames of a drive show of places, whether something stands there or not."""

from __future__ import annotations

import dataclasses

import pytest
import shapely

from hypermap.core.objects import SemanticObject
from hypermap.experiments.shown import Shown
from hypermap.simulation import SimulatedRecording, World
from hypermap.simulation.days import Day
from hypermap.simulation.truth import true_objects
from hypermap.simulation.world import WorldObject, built_in_world

FAR = 4.0


def shown_by_drive(world: World) -> Shown:
    """Return what a sparse drive through a world shows."""
    recording = SimulatedRecording(world, rate=0.1)
    shown = Shown(Day.first(world), FAR)
    for _ in recording.frames():
        shown.add(recording)
    return shown


@pytest.fixture(scope="module")
def demo() -> tuple[World, Shown]:
    world = built_in_world("demo")
    return world, shown_by_drive(world)


def test_things_that_are_there_are_shown_as_often_as_they_are_seen(
    demo: tuple[World, Shown],
) -> None:
    world, shown = demo
    counts = [shown.frames_that_show(thing) for thing in world.objects]
    assert max(counts) >= 2
    for thing, count, seen in zip(world.objects, counts, shown.visible.tolist(), strict=True):
        assert abs(count - seen) <= 1, thing  # its own place is not hidden by it


def test_objects_of_a_map_are_shown_about_as_often_as_the_things(demo: tuple[World, Shown]) -> None:
    world, shown = demo
    pairs = zip(world.objects, true_objects(world).objects(), strict=True)
    off = [abs(shown.frames_that_show(a) - shown.frames_that_show(b)) for a, b in pairs]
    assert sum(one <= 1 for one in off) >= 0.9 * len(off)


def test_a_removed_thing_would_be_shown_where_nothing_hides_it(demo: tuple[World, Shown]) -> None:
    world, before = demo
    thing = max(world.objects, key=before.frames_that_show)
    rest = tuple(one for one in world.objects if one is not thing)
    after = shown_by_drive(dataclasses.replace(world, objects=rest))
    assert after.frames_that_show(thing) >= before.frames_that_show(thing) > 0


def test_what_furniture_hides_is_not_shown(demo: tuple[World, Shown]) -> None:
    world, before = demo
    thing = max(world.objects, key=before.frames_that_show)
    around = WorldObject("cupboard", thing.place, size={"width": 1.2, "length": 1.2, "height": 2})
    rest = tuple(one for one in world.objects if one is not thing)
    after = shown_by_drive(dataclasses.replace(world, objects=(*rest, around)))
    assert after.frames_that_show(thing) == 0


def test_what_is_far_or_too_small_is_not_shown(demo: tuple[World, Shown]) -> None:
    _, shown = demo
    assert shown.frames_that_show(WorldObject("chair", (100.0, 0.0))) == 0
    speck = SemanticObject("cup", shapely.Point(1, 1).buffer(1e-3), attributes={"z_max": 1e-3})
    assert shown.frames_that_show(speck) == 0
