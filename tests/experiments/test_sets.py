"""Worlds and seeds to look at, and others only to measure on; methods by name."""

from __future__ import annotations

import pytest

from hypermap.core.errors import HypermapError
from hypermap.experiments.drives import Mapped, SimulatedDrive
from hypermap.experiments.methods import OURS, chosen_methods
from hypermap.experiments.results import WorldResult
from hypermap.experiments.sets import DEV, TEST, first_seed_of, worlds_named
from hypermap.simulation import built_in_worlds, errors_of_level, ground_truth, varied
from hypermap.simulation.sightings import Sightings
from hypermap.simulation.world import FloorPlan, Variation, World, WorldObject


def test_every_world_but_the_demo_is_either_for_looking_or_for_measuring() -> None:
    assert not set(DEV) & set(TEST)
    assert {"demo", *DEV, *TEST} == set(built_in_worlds())
    assert worlds_named("dev,mine.yaml") == [*DEV, "mine.yaml"]
    assert first_seed_of(DEV) == 1000
    assert first_seed_of(["lab", "building"]) == 5000


def test_methods_are_chosen_by_the_beginning_of_their_names() -> None:
    assert list(chosen_methods("default")) == ["default"]
    assert list(chosen_methods("convex,default")) == [
        "convex hull, overlap",
        "convex hull, radius",
        "default",
    ]
    assert len(chosen_methods("all")) == 5
    with pytest.raises(HypermapError, match=r"there is no method 'defalt'; did you mean 'default'"):
        chosen_methods("defalt")


def test_each_drive_is_compared_with_its_own_world() -> None:
    world = World(
        "w",
        FloorPlan((0, 0, 9, 9)),
        objects=(WorldObject("table", (2, 2)), WorldObject("cup", (5, 5))),
        variation=Variation(move=1.0, turn_deg=40, size=0.3),
    )
    drives = [
        Mapped(
            SimulatedDrive(variant, seed, errors_of_level("none"), 1.0),
            1,
            {OURS: tuple(ground_truth(variant)["semantic"].objects())},
            Sightings.none(2),
        )
        for seed in (7, 8)
        for variant in [varied(world, seed)]
    ]
    assert drives[0].drive.world != drives[1].drive.world
    result = WorldResult.of(drives)
    assert result.shape(OURS) == pytest.approx((1.0, 0.0))
    assert result.found(OURS)["at"][1]["recall"] == 1.0
