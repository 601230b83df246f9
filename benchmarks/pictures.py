"""Which pictures of objects a map keeps, and what they cost.

For drives with the errors of a robot, prints how many of the kept pictures show the object that
they are kept for, and in how many half of it or more is visible. Then prints how much longer
mapping of a recorded drive takes with pictures than without, each in turn, as the ratio of the
medians.

    python benchmarks/pictures.py [--worlds lab floor] [--seeds 2] [--rate 2] [--runs 5]
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hypermap.core.pictures import ObjectPicture
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.mapping.config import profile
from hypermap.mapping.mapper import MappedFrame, Mapper
from hypermap.mapping.recording_to_map import map_recording
from hypermap.mapping.stages import PictureConfig
from hypermap.perception.detectors.sources import detections_from_recording
from hypermap.recordings.open import open_recording
from hypermap.simulation import SimulatedRecording, built_in_world, write_tum
from hypermap.simulation.levels import errors_of_level
from hypermap.simulation.scene import Scene
from hypermap.simulation.truth import true_objects
from hypermap.simulation.views import Views
from hypermap.simulation.visibility import nearest_triangles
from hypermap.simulation.world import World

SOURCE = detections_from_recording()


@dataclass
class Score:
    """How many pictures there are, show the right object, and show half of it or more."""

    pictures: int = 0
    right: int = 0
    visible: int = 0
    objects: int = 0
    with_picture: int = 0


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--worlds", nargs="+", default=["lab", "floor"])
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--rate", type=float, default=2.0)
    parser.add_argument("--runs", type=int, default=5)
    arguments = parser.parse_args()
    print("world   objects  with pictures  pictures  right object  half or more visible")
    for name in arguments.worlds:
        score = Score()
        for seed in range(arguments.seeds):
            add_drive(built_in_world(name), seed, arguments.rate, score)
        print(
            f"{name:8}{score.objects:7d}{score.with_picture:15d}{score.pictures:10d}"
            f"{score.right / score.pictures:14.1%}{score.visible / score.pictures:22.1%}"
        )
    print_cost(built_in_world(arguments.worlds[0]), arguments.rate, arguments.runs)


def add_drive(world: World, seed: int, rate: float, score: Score) -> None:
    """Map a drive, and count what its pictures show."""
    exact = SimulatedRecording(world, rate=rate, has_occupancy=False)
    poses = {frame.stamp: frame.map_T_camera for frame in exact.frames()}
    recording = SimulatedRecording.with_errors(
        world, errors_of_level("robot"), rate=rate, seed=seed
    )
    boxes: dict[ObjectPicture, NDArray[np.float32]] = {}

    def watch(mapped: MappedFrame, mapper: Mapper) -> None:
        for observed, track in mapper.evidence.shown:
            for picture in mapper.evidence.pictures(track):
                if picture.stamp == mapped.frame.stamp and observed.detection is not None:
                    boxes.setdefault(picture, mapped.detections.xyxy[observed.detection])

    layer = map_recording(recording, SOURCE, profile("default"), watch=watch).semantic()
    views = Views(world, exact.camera)
    for item in layer:
        truth = true_object_of(item, true_objects(world))
        if truth is None:  # a false object, or a person
            continue
        score.objects += 1
        score.with_picture += bool(layer.pictures(item.id or 0))
        alone = Scene.of_things([(truth, world.objects[truth])]).triangles
        for picture in layer.pictures(item.id or 0):
            pose = poses[picture.stamp]
            instances = views.seen(pose).instances
            labels = [thing.label for thing in world.objects]
            shown = most_seen(instances, boxes[picture], labels, item.name)
            projection = exact.camera.K @ np.linalg.inv(pose)[:3]
            _, found = nearest_triangles(alone, projection, *instances.shape)
            whole = np.count_nonzero(found >= 0)
            score.pictures += 1
            score.right += shown == truth
            score.visible += np.count_nonzero(instances == truth) >= whole / 2


def true_object_of(item: SemanticObject, truth: SemanticLayer) -> int | None:
    """Return the number of the true object of its class that an object overlaps most."""
    shares = {
        one.id: one.footprint.intersection(item.footprint).area
        for one in truth
        if one.name == item.name
    }
    best = max(shares, key=lambda number: shares[number], default=None)
    return best if best is not None and shares[best] > 0 else None


def most_seen(
    instances: NDArray[np.int32], box: NDArray[np.float32], labels: list[str], name: str
) -> int | None:
    """Return the object of a class that fills most pixels of a box; None for none."""
    x_min, y_min, x_max, y_max = np.clip(np.round(box), 0, None).astype(int).tolist()
    inside = instances[y_min:y_max, x_min:x_max]
    counts = np.bincount(inside[inside >= 0], minlength=len(labels))
    counts[[label != name for label in labels]] = 0
    return int(counts.argmax()) if counts.any() else None


def print_cost(world: World, rate: float, runs: int) -> None:
    """Map a recording on disk with and without pictures, in turn."""
    seconds: dict[bool, list[float]] = {True: [], False: []}
    with tempfile.TemporaryDirectory() as folder:
        write_tum(SimulatedRecording(world, rate=rate), Path(folder))
        for _ in range(runs):
            for enabled in seconds:
                config = replace(profile("default"), pictures=PictureConfig(enabled))
                recording = open_recording(Path(folder))
                began = time.process_time()
                map_recording(recording, SOURCE, config)
                seconds[enabled].append(time.process_time() - began)
    with_, without = (statistics.median(seconds[each]) for each in (True, False))
    ratio = f"x{with_ / without:.3f}"
    print(f"{world.name}: {with_:.2f} s with pictures, {without:.2f} s without: {ratio}")


if __name__ == "__main__":
    main()
