"""The random worlds on which the network that comes with the package is trained."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import shapely

from hypermap.simulation.models import MODELS
from hypermap.simulation.network import CLASSES

TRAINING = Path(__file__).parents[2] / "training"


def loaded(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, TRAINING / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # for those that import it
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def worlds() -> ModuleType:
    loaded("furniture")
    return loaded("random_worlds")


def test_they_are_of_all_kinds_and_have_things_of_all_models(worlds: ModuleType) -> None:
    made = [worlds.RandomWorld(np.random.default_rng(seed)) for seed in range(40)]
    assert {one.kind for one in made} == set(worlds.KINDS)
    assert {thing.model for one in made for thing in one.world().objects} == set(MODELS)
    assert any(wall.glass for one in made for wall in one.world().walls)


def test_every_camera_is_in_the_room_and_looks_from_the_height_of_a_robot(
    worlds: ModuleType,
) -> None:
    for seed in range(12):
        random = worlds.RandomWorld(np.random.default_rng(seed))
        room = shapely.box(*random.world().floor.rectangle)
        for _ in range(8):
            x, y, z = random.camera_pose()[:3, 3]
            assert room.covers(shapely.Point(x, y))
            assert 0.2 < z < 2.8


def test_an_image_has_a_box_of_a_class_around_all_that_is_seen_well(worlds: ModuleType) -> None:
    assert worlds is sys.modules["random_worlds"]
    rendered = loaded("render_images").render_world(1, images=4)
    boxes, classes = rendered["boxes"], rendered["classes"]
    assert rendered["images"].shape == (4, 240, 320, 3)
    assert len(boxes) == len(classes) == len(rendered["image_ids"]) > 4
    assert ((boxes >= 0) & (boxes <= [320, 240, 320, 240])).all()
    assert ((boxes[:, 2:] - boxes[:, :2]).prod(axis=1) >= 40).all()
    assert classes.max() < len(CLASSES)
