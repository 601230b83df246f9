"""How well the network that comes with the package sees, in worlds that it was not trained on.

Prints the average precision of each class at an IoU of 0.5, and its mean over IoUs from 0.5 to
0.95, as COCO does it: at 101 steps of recall, with at most 100 detections in an image. Objects of
which fewer than 40 pixels are visible count neither for nor against it. With `--maps` it then maps
each world with the network and with the detector that knows the truth and errs.

    python benchmarks/detector.py [--worlds demo lab ...] [--rate 1] [--maps] [--seeds 3]
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from hypermap.evaluation.metrics import evaluate
from hypermap.mapping.config import profile
from hypermap.mapping.recording_to_map import map_recording
from hypermap.perception.detections import Detections, Detector
from hypermap.perception.detectors.sources import detections_from_recording
from hypermap.simulation import (
    SimulatedRecording,
    World,
    built_in_world,
    built_in_worlds,
    ground_truth,
)
from hypermap.simulation.detector import visible_boxes
from hypermap.simulation.network import class_of, network_detector
from hypermap.simulation.render import Renderer
from hypermap.simulation.scene import Scene
from hypermap.simulation.trajectory import camera_poses, planar_poses

IOUS = np.linspace(0.5, 0.95, 10)
RECALLS = np.linspace(0, 1, 101)
MIN_PIXELS = 40
MIN_SCORE = 0.01  # AP wants the uncertain ones, too
MAX_DETECTIONS = 100


@dataclass
class Tally:
    """Every detection of one class, at each of `IOUS`.

    Attributes:
        true: how many objects there were.
        scores: of the detections that count at some IoU, one by one.
        hits: 1 right, 0 wrong, -1 does not count; shape (10,) each.
    """

    true: int = 0
    scores: list[float] = field(default_factory=list)
    hits: list[NDArray[np.int8]] = field(default_factory=list)

    def precisions(self) -> NDArray[np.float64] | None:
        """Return the average precision at each of `IOUS`; None if there was no such object."""
        if not self.true:
            return None
        if not self.scores:
            return np.zeros(len(IOUS))
        hits = np.array(self.hits)[np.argsort(-np.array(self.scores), kind="stable")]
        return np.array([_average_precision(column, self.true) for column in hits.T])


def _average_precision(hits: NDArray[np.int8], true: int) -> float:
    hits = hits[hits >= 0]
    found = np.cumsum(hits)
    recall, precision = found / true, found / np.arange(1, len(hits) + 1)
    best_from_here = np.maximum.accumulate(precision[::-1])[::-1]
    at = np.searchsorted(recall, RECALLS, side="left")
    return float(np.append(best_from_here, 0.0)[at].mean())


def count(tally: Tally, boxes: NDArray, scores: NDArray, true: NDArray, small: NDArray) -> None:
    """Add one image's detections of a class, best first: each takes the free object it fits best.

    Args:
        tally: of the class.
        boxes: of the detections, shape (N, 4).
        scores: shape (N,), falling.
        true: boxes of the objects, shape (M, 4).
        small: whether an object is too small to count, shape (M,).
    """
    tally.true += int((~small).sum())
    hits = np.zeros((len(boxes), len(IOUS)), np.int8)
    overlap = _ious(boxes, true)
    for k, limit in enumerate(IOUS):
        is_free = np.ones(len(true), bool)
        for i in range(len(boxes)):
            fits = is_free & (overlap[i] >= limit)
            if (fits & ~small).any():
                best = int(np.argmax(np.where(fits & ~small, overlap[i], -1)))
                is_free[best] = False
                hits[i, k] = 1
            elif fits.any():
                hits[i, k] = -1
    tally.scores += scores.tolist()
    tally.hits += list(hits)


def _ious(a: NDArray, b: NDArray) -> NDArray:
    low, high = (
        np.maximum(a[:, None, :2], b[None, :, :2]),
        np.minimum(a[:, None, 2:], b[None, :, 2:]),
    )
    shared = np.clip(high - low, 0, None).prod(-1)
    areas = [(box[:, 2:] - box[:, :2]).prod(-1) for box in (a, b)]
    return shared / np.maximum(areas[0][:, None] + areas[1][None] - shared, 1e-9)


def views(world: World, rate: float) -> Iterator[tuple[NDArray, NDArray]]:
    """Yield the color and the instances of the images along a world's drive."""
    assert world.drive is not None
    renderer = Renderer(Scene.of(world))
    for pose in camera_poses(planar_poses(world.drive, rate)[1], world.drive):
        view = renderer.render(pose)
        yield view.color, view.instances


def tallies_of(
    world: World, detector: Detector, rate: float
) -> tuple[dict[str, Tally], int, float]:
    """Return the tally of each class, how many images there were, and the seconds for each."""
    tallies: dict[str, Tally] = defaultdict(Tally)
    names = np.array([class_of(thing) for thing in world.objects])
    seconds, images = 0.0, 0
    for color, instances in views(world, rate):
        start = time.perf_counter()
        found: Detections = detector.detect(color)
        seconds, images = seconds + time.perf_counter() - start, images + 1
        pixels = np.bincount(instances[instances >= 0], minlength=len(names))
        boxes = visible_boxes(instances, len(names))
        found_names = np.array(found.names[:MAX_DETECTIONS], dtype=object)
        for name in {*names, *found_names}:
            mine, true = found_names == name, (names == name) & (pixels > 0)
            mine = np.flatnonzero(mine)
            small = pixels[true] < MIN_PIXELS
            count(tallies[name], found.xyxy[mine], found.scores[mine], boxes[true], small)
    return tallies, images, seconds / images


def merge(parts: list[dict[str, Tally]]) -> dict[str, Tally]:
    """Return the tallies of several worlds as one."""
    merged: dict[str, Tally] = defaultdict(Tally)
    for tallies in parts:
        for name, tally in tallies.items():
            merged[name].true += tally.true
            merged[name].scores += tally.scores
            merged[name].hits += tally.hits
    return merged


def mean_precisions(tallies: dict[str, Tally]) -> tuple[float, float]:
    """Return the means over the classes: of AP at an IoU of 0.5, and of AP over all IoUs."""
    known = [p for tally in tallies.values() if (p := tally.precisions()) is not None]
    return float(np.mean([p[0] for p in known])), float(np.mean([p.mean() for p in known]))


def show_maps(worlds: list[World], seeds: int) -> None:
    """Print how near maps come to the truth, made with the network and with the other detector."""
    print("\nmaps of            objects  in the map   IoU  F1 at 0.25  F1 at 0.5")
    for world in worlds:
        things = tuple(replace(thing, name=class_of(thing)) for thing in world.objects)
        named = replace(world, objects=things)
        truth = ground_truth(named)["semantic"].objects()
        for kind, detector in (("network", network_detector()), ("noisy", None)):
            figures = []
            for seed in range(seeds):
                recording = SimulatedRecording(
                    named, detector=detector, seed=seed, has_occupancy=False
                )
                made = map_recording(recording, detections_from_recording(), profile("default"))
                score = evaluate(made["semantic"].objects(), truth).overall
                f1 = [detection.f1 or 0.0 for detection in score.detection]
                figures.append([score.estimated, score.iou or 0.0, *f1])
            found, iou, low, high = np.mean(figures, axis=0)
            print(
                f"{world.name:8} {kind:8} {len(truth):8} {found:11.1f} {iou:5.2f} {low:11.2f} "
                f"{high:10.2f}",
                flush=True,
            )


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--worlds", nargs="+", default=built_in_worlds(), help="by default all")
    parser.add_argument("--rate", type=float, default=1.0, help="images per second of the drives")
    parser.add_argument("--maps", action="store_true")
    parser.add_argument("--seeds", type=int, default=3, help="drives to map in each world")
    arguments = parser.parse_args()
    detector = network_detector(score_threshold=MIN_SCORE)
    worlds = [built_in_world(name) for name in arguments.worlds]
    parts = []
    print("world        images  AP at 0.5  AP 0.5..0.95  ms for an image")
    for world in worlds:
        tallies, images, seconds = tallies_of(world, detector, arguments.rate)
        parts.append(tallies)
        at_half, over_all = mean_precisions(tallies)
        print(f"{world.name:12}{images:7}{at_half:11.3f}{over_all:14.3f}{1000 * seconds:17.1f}")
    merged = merge(parts)
    print("\nclass      objects  AP at 0.5  AP 0.5..0.95")
    for name, tally in sorted(merged.items()):
        if (precisions := tally.precisions()) is not None:
            print(f"{name:10}{tally.true:8}{precisions[0]:11.3f}{precisions.mean():14.3f}")
    at_half, over_all = mean_precisions(merged)
    print(f"{'mean':10}{sum(t.true for t in merged.values()):8}{at_half:11.3f}{over_all:14.3f}")
    if arguments.maps:
        show_maps(worlds, arguments.seeds)


if __name__ == "__main__":
    main()
