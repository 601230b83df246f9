"""Which stage limits the profile `default`: an error budget by oracles.

Maps the same simulated drives, and each stage in turn does what it does without any error:

- detection: a box around the visible part of each thing with at least 60 pixels, by its class;
- cut-out: each detection has the true pixels of what it shows as a mask;
- depth: the measured depth of each pixel without errors;
- poses: the true ones;
- fusion: each object has its true shape, at the place where it was mapped;
- existence: a track is in the map if its observations are mostly of a thing of its class, and it
  has the most of them.

Prints means over the drives: the Jaccard index and the distance of centroids as in the 2019 thesis;
precision, recall and F1 at an IoU of 0.25; and F1 at 0.5.

    python benchmarks/stage_budget.py [--worlds lab] [--seeds 10] [--first-seed 1000]
                                      [--errors rough] [--rate 2]
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from shapely import affinity

from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticObject
from hypermap.evaluation.metrics import Evaluation, evaluate
from hypermap.mapping.alignment import Aligner
from hypermap.mapping.completion import free_share
from hypermap.mapping.config import profile
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.keyframes import KeyframeSelector
from hypermap.mapping.perceived import Perceived
from hypermap.mapping.published import PublishedTracks
from hypermap.mapping.tracks import Track
from hypermap.perception.detections import Detections
from hypermap.perception.frame import RgbdFrame
from hypermap.perception.observation import Observation
from hypermap.perception.observe import observe
from hypermap.simulation import SimulatedRecording, built_in_world, errors_of_level, varied
from hypermap.simulation.detector import visible_boxes
from hypermap.simulation.truth import true_objects
from hypermap.simulation.views import Views

STAGES = ("detection", "cut-out", "depth", "poses", "fusion", "existence")
ROWS = [
    frozenset(),
    *(frozenset({stage}) for stage in STAGES),
    *(frozenset(both) for both in combinations(("cut-out", "poses", "existence"), 2)),
    frozenset({"cut-out", "poses", "existence"}),
    frozenset({"poses", "fusion", "existence"}),
]
OF_MAP = frozenset({"fusion", "existence"})  # what is known of the finished map alone
CONFIG = profile("default")
LEAST_PIXELS = 60  # of a thing that can be detected


@dataclass(frozen=True, eq=False)
class Shown:
    """A keyframe with its truth.

    Attributes:
        frame: with the corrected pose.
        recorded: `map_T_camera` before it was corrected.
        pose: the true `map_T_camera`.
        instances: which thing each pixel shows, -1 for none.
        depth: of each pixel, without errors [m].
    """

    frame: RgbdFrame
    recorded: NDArray[np.float64]
    pose: NDArray[np.float64]
    instances: NDArray[np.int32]
    depth: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Drive:
    """A drive with its truth."""

    truth: Sequence[SemanticObject]
    occupancy: OccupancyLayer
    shown: Sequence[Shown]


def driven(name: str, seed: int, level: str, rate: float) -> Drive:
    """Return a drive through a world."""
    world = varied(built_in_world(name), seed)
    errors = replace(errors_of_level(level), people=0)
    recording = SimulatedRecording.with_errors(world, errors, rate=rate, seed=seed)
    occupancy = recording.occupancy()
    assert occupancy is not None
    aligner, keyframes = Aligner(occupancy, CONFIG.alignment), KeyframeSelector(CONFIG.keyframes)
    views = Views(world, recording.camera)
    shown = []
    for frame, pose in zip(recording.frames(), recording.true_poses, strict=True):
        if keyframes.accept(frame.map_T_camera, frame.stamp):
            view = views.seen(pose, None)
            recorded = frame.map_T_camera
            shown.append(Shown(aligner.align(frame), recorded, pose, view.instances, view.depth))
    return Drive(tuple(true_objects(world).objects()), occupancy, shown)


def observed(frame: RgbdFrame, found: Detections, recorded: NDArray[np.float64]) -> Observation:
    """Return what a frame shows, and how its pose was corrected from the recorded one."""
    seen = Perceived(found, 0, observe(frame, found, CONFIG.perception), None)
    return seen.corrected_from(recorded).observation


def origins(boxes: NDArray[np.float64], instances: NDArray[np.int32], count: int) -> list[int]:
    """Return the thing that each detection shows, by an IoU of their boxes of 0.5; -1 for none."""
    things = visible_boxes(np.where(instances < count, instances, -1), count)
    found = []
    for box in boxes:
        sides = np.minimum(box[2:], things[:, 2:]) - np.maximum(box[:2], things[:, :2])
        shared = np.prod(np.maximum(sides, 0), axis=1)
        whole = np.prod(things[:, 2:] - things[:, :2], axis=1) + np.prod(box[2:] - box[:2])
        ious = shared / np.maximum(whole - shared, 1e-9)
        found.append(int(ious.argmax()) if ious.max(initial=0) >= 0.5 else -1)
    return found


def exact_detections(instances: NDArray[np.int32], names: Sequence[str]) -> Detections:
    """Return a box around each visible thing; scores differ, to tell observations apart."""
    count = len(names)
    pixels = np.bincount(instances[(instances >= 0) & (instances < count)], minlength=count)
    shown = np.flatnonzero(pixels >= LEAST_PIXELS)
    boxes = visible_boxes(np.where(instances < count, instances, -1), count)[shown]
    return Detections.of(boxes, [names[i] for i in shown], 0.72 + 1e-4 * shown)


class Oracle:
    """A map of a drive, of which some stages are perfect, but for those of `OF_MAP`."""

    def __init__(self, drive: Drive, perfect: frozenset[str]) -> None:
        self.drive, self.perfect = drive, perfect
        self.map = EvidenceMap(CONFIG.evidence, partial(free_share, drive.occupancy))
        self.origin: dict[tuple[float, float], int] = {}
        for shown in drive.shown:
            self._add(shown)

    def evaluated(self, perfect: frozenset[str]) -> Evaluation:
        """Return how good the map is if these stages of `OF_MAP` are perfect, too."""
        return evaluate(self._objects(perfect), self.drive.truth)

    def _add(self, shown: Shown) -> None:
        names = [thing.name for thing in self.drive.truth]
        found = shown.frame.detections or Detections.of([], [], [])
        if "detection" in self.perfect:
            found = exact_detections(shown.instances, names)
        came_from = origins(found.xyxy.astype(np.float64), shown.instances, len(names))
        frame, recorded = shown.frame, shown.recorded
        if "poses" in self.perfect:
            frame, recorded = replace(frame, map_T_camera=shown.pose), shown.pose
        if "depth" in self.perfect:
            frame = replace(frame, depth=shown.depth)
        if "cut-out" in self.perfect:
            found = _with_masks(found, came_from, shown.instances)
        seen = observed(frame, found, recorded)
        for one in seen.objects:
            self.origin[seen.stamp, one.score] = came_from[one.detection]
        self.map.update(seen)

    def _objects(self, perfect: frozenset[str]) -> list[SemanticObject]:
        tracks, config = self.map.tracks(), CONFIG.evidence
        of_track = {track.id: self._came_from(track) for track in tracks.objects}
        objects = self.map.objects()
        if "existence" in perfect:
            every = replace(config, publish_above=config.forget_below, min_probability=0, slip=1)
            everything = PublishedTracks(tracks, every, self.map.is_free, False).objects()
            best: dict[int, tuple[int, SemanticObject]] = {}
            for item in everything:
                thing, count = of_track[item.id]
                if thing >= 0 and count > best.get(thing, (0, None))[0]:
                    best[thing] = count, item
            objects = [item for _, item in best.values()]
        if "fusion" in perfect:
            objects = [self._in_true_shape(item, of_track[item.id][0]) for item in objects]
        return objects

    def _came_from(self, track: Track) -> tuple[int, int]:
        """Return the thing of its class that most observations of a track show, and how many."""
        counts = Counter(
            self.origin.get((item.stamp, item.score), -1) for item in track.buffer.items
        )
        thing, count = counts.most_common(1)[0] if counts else (-1, 0)
        is_own = thing >= 0 and self.drive.truth[thing].name == track.name
        return (thing, count) if is_own else (-1, 0)

    def _in_true_shape(self, item: SemanticObject, thing: int) -> SemanticObject:
        if thing < 0:
            return item
        shape, place = self.drive.truth[thing].footprint, item.footprint.centroid
        by = place.x - shape.centroid.x, place.y - shape.centroid.y
        return replace(item, footprint=affinity.translate(shape, *by))


def _with_masks(
    found: Detections, came_from: Sequence[int], instances: NDArray[np.int32]
) -> Detections:
    """Return detections with the true pixels of what they show as masks, where that is a thing."""
    masks = np.zeros((len(found), *instances.shape), dtype=bool)
    for mask, box, thing in zip(masks, found.xyxy, came_from, strict=True):
        left, top, right, bottom = np.clip(np.round(box), 0, 10_000).astype(int)
        if thing >= 0:
            mask[:] = instances == thing
        else:
            mask[top:bottom, left:right] = True
    return Detections.of(found.xyxy, list(found.names), found.scores, masks)


def show(title: str, results: Sequence[Evaluation]) -> None:
    """Print one row: means over the drives."""
    closest = [one for each in results for one in each.closest]
    scores = [each.overall.detection for each in results]
    figures = [np.mean([one.iou for one in closest]), np.mean([one.distance for one in closest])]
    figures += [
        np.mean([s[0].precision or 0 for s in scores]),
        np.mean([s[0].recall for s in scores]),
    ]
    figures += [np.mean([each[k].f1 or 0 for each in scores]) for k in (0, 1)]
    print(f"{title:50}" + " ".join(f"{figure:5.2f}" for figure in figures), flush=True)


def budget(drives: Iterator[Drive]) -> None:
    """Print the budget of some drives, each of which is in memory once."""
    results: dict[frozenset[str], list[Evaluation]] = {perfect: [] for perfect in ROWS}
    for drive in drives:
        maps = {kind: Oracle(drive, kind) for kind in {perfect - OF_MAP for perfect in ROWS}}
        for perfect, found in results.items():
            found.append(maps[perfect - OF_MAP].evaluated(perfect & OF_MAP))
    print(f"{'perfect':50}  IoU   off     P     R    F1  F1 at 0.5")
    for perfect, found in results.items():
        show(", ".join(stage for stage in STAGES if stage in perfect) or "nothing", found)


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--worlds", default="lab")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first-seed", type=int, default=1000)
    parser.add_argument("--errors", default="rough")
    parser.add_argument("--rate", type=float, default=2.0, help="frames per second")
    arguments = parser.parse_args()
    seeds = range(arguments.first_seed, arguments.first_seed + arguments.seeds)
    for name in arguments.worlds.split(","):
        print(f"{name}, {arguments.errors}, {len(seeds)} drives")
        budget(driven(name, seed, arguments.errors, arguments.rate) for seed in seeds)


if __name__ == "__main__":
    main()
