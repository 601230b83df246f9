"""The detector that comes with the package: a small network, trained on images of random worlds."""

from __future__ import annotations

from dataclasses import replace
from importlib import resources

from hypermap.perception.detections import Detector
from hypermap.perception.detectors import load_detector
from hypermap.simulation.models import MODELS
from hypermap.simulation.world import World, WorldObject

# What looks alike has one name: a network cannot know what a world's author calls it.
_ALIKE = {"screen": "monitor", "sitter": "person"}
CLASSES = tuple(model for model in MODELS if model not in _ALIKE)


def class_of(thing: WorldObject) -> str:
    """Return what the network calls a thing: its model, whatever its name in the world is."""
    return _ALIKE.get(thing.model, thing.model)


def named_for_network(world: World) -> World:
    """Return a world whose objects have the names that the network gives them."""
    objects = tuple(replace(thing, name=class_of(thing)) for thing in world.objects)
    return replace(world, objects=objects)


def network_detector(score_threshold: float = 0.3, threads: int | None = None) -> Detector:
    """Return the network that finds the models of `MODELS` in rendered images of 320 x 240.

    Args:
        score_threshold: detections with a lower score are left out; the default has the best F1 on
            images of random worlds that were kept from training.
        threads: how many the network may use; by default all cores.
    """
    with resources.as_file(resources.files(__package__) / "detector.onnx") as path:
        return load_detector(path, score_threshold=score_threshold, threads=threads)
