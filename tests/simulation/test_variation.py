"""Worlds that differ from seed to seed."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from hypermap.simulation.scene import footprint, placed
from hypermap.simulation.standing import bases, bodies_of, in_walls, overlaps
from hypermap.simulation.trajectory import DrivePlan
from hypermap.simulation.variation import varied
from hypermap.simulation.world import (
    FloorPlan,
    Variation,
    Wall,
    World,
    WorldObject,
    built_in_world,
)

WORLD = World(
    "w",
    FloorPlan((0, 0, 6, 5)),
    objects=(
        WorldObject("table", (2, 3.5)),
        WorldObject("cup", (2, 3.1), z=0.74),
        WorldObject("chair", (4, 3.5)),
        WorldObject("panel", (3, 4.92), yaw_deg=-90, z=1.2),
        WorldObject("sofa", outline=((4.2, 0.1), (5.9, 0.1), (5.9, 1.0), (4.2, 1.0)), yaw_deg=90),
    ),
    walls=(Wall(rectangle=(-0.05, -0.05, 6.05, 5.05)),),
    drive=DrivePlan(((0.5, 2), (3.5, 2))),
    variation=Variation(move=0.4, turn_deg=20, size=0.2),
)


def test_a_world_without_variation_stays_as_it_is() -> None:
    assert varied(built_in_world("lab"), 3) == built_in_world("lab")


def test_a_seed_gives_the_same_world_and_another_seed_another() -> None:
    assert varied(WORLD, 1) == varied(WORLD, 1) != varied(WORLD, 2)


@pytest.mark.parametrize("seed", range(8))
def test_things_move_as_far_as_asked_and_what_they_carry_goes_with_them(seed: int) -> None:
    world = varied(WORLD, seed)
    assert [thing.label for thing in world.objects] == [thing.label for thing in WORLD.objects]
    assert bases(world) == bases(WORLD) == [0, 0, 2, 3, 4]
    assert overlaps(world) == in_walls(world) == []
    for before, after in zip(WORLD.objects, world.objects, strict=True):
        turned = math.remainder(after.yaw_deg - before.yaw_deg, 360)
        assert abs(turned) <= 20
        is_carried = before.z > 0
        farthest = np.abs(np.subtract(before.place, after.place)).max()
        assert is_carried or farthest <= 0.4001
    table, cup = world.objects[:2]
    assert math.dist(table.place, cup.place) == pytest.approx(0.4)
    assert world.objects[3] == WORLD.objects[3]  # it hangs at the wall
    way = shapely.LineString([(0.5, 2), (3.5, 2)])
    assert all(body.outline.distance(way) >= 0.299 for body in bodies_of(world))
    floor = shapely.box(0, 0, 6, 5).buffer(1e-9)
    assert all(floor.covers(footprint(placed(thing))) for thing in world.objects[:3])


def test_sizes_differ_by_as_much_as_asked() -> None:
    widths = [varied(WORLD, seed).objects[2].size.get("width", 0.45) for seed in range(12)]
    assert all(0.45 * 0.8 <= width <= 0.45 * 1.2 for width in widths)
    assert max(widths) - min(widths) > 0.08
    # A table that carries a cup only grows.
    tables = [varied(WORLD, seed).objects[0].size.get("width", 1.4) for seed in range(12)]
    assert min(tables) >= 1.4


@pytest.mark.parametrize("name", ["kitchen", "apartment"])
def test_the_worlds_of_the_package_stay_sound(name: str) -> None:
    world = varied(built_in_world(name), 7)
    assert overlaps(world) == in_walls(world) == []
    assert None not in bases(world)
    moved = [a != b for a, b in zip(world.objects, built_in_world(name).objects, strict=True)]
    assert sum(moved) > 0.7 * len(moved)
