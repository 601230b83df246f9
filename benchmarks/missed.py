"""Where true things are lost on their way into the map of the profile `default`.

For each true thing without an object (IoU of at least 0.25) in the maps of simulated drives, prints
the first stage that lost it, by class, and the share of the true things that the detector finds by
their class in at least 1, 2, 3 and 5 mapped frames, which bounds recall.

    python benchmarks/missed.py [--worlds lab] [--seeds 10] [--first-seed 1000]
                                [--errors rough] [--rate 2]
"""

from __future__ import annotations

import argparse
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from shapely import affinity
from shapely.geometry.base import BaseGeometry
from stage_budget import CONFIG, Drive, driven, observed, origins

from hypermap.core.semantic import SemanticObject
from hypermap.evaluation.matching import iou_matrix
from hypermap.evaluation.metrics import evaluate
from hypermap.mapping.completion import free_share
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.published import PublishedTracks
from hypermap.mapping.tracks import Track
from hypermap.perception.detections import Detections

STAGES = (
    "never detected",
    "detected once",
    "cut out at most once",
    "in the track of another thing",
    "forgotten",
    "other class in its place",
    "unpublished: existence",
    "unpublished: probability",
    "unpublished: one of two",
    "unpublished: off",
    "unpublished: shape",
    "published: off",
    "published: shape",
)
LEAST_IOU = 0.25
ENOUGH = (1, 2, 3, 5)


class Passage:
    """A map of a drive, which knows what became of each thing."""

    def __init__(self, drive: Drive) -> None:
        self.truth = drive.truth
        self.map = EvidenceMap(CONFIG.evidence, partial(free_share, drive.occupancy))
        self.detected: Counter[int] = Counter()  # frames, by the thing
        self.cut_out: Counter[int] = Counter()
        self._origin: dict[tuple[float, float], int] = {}
        for shown in drive.shown:
            found = shown.frame.detections or Detections.of([], [], [])
            boxes = found.xyxy.astype(np.float64)
            came_from = origins(boxes, shown.instances, len(self.truth))
            own = [self._own(*of) for of in zip(came_from, found.names, strict=True)]
            self.detected.update({thing for thing in own if thing >= 0})
            seen = observed(shown.frame, found, shown.recorded)
            self.map.update(seen)
            kept = {one.detection: one for one, _ in self.map.shown if one.detection is not None}
            self.cut_out.update({own[number] for number in kept} - {-1})
            for number, one in kept.items():
                self._origin[seen.stamp, one.score] = came_from[number]
        self.objects = self.map.objects()
        self.matches = evaluate(self.objects, self.truth).finds[0].matches
        self._tracks = self.map.tracks()
        self._shapes = {item.id: item.footprint for item in self._published(True)}
        self._shapes.update({item.id: item.footprint for item in self.objects})

    def missed(self) -> list[tuple[SemanticObject, str]]:
        """Return the true things that have no object, each with the stage that lost it."""
        found = {match.ground_truth for match in self.matches}
        lost = (thing for thing in range(len(self.truth)) if thing not in found)
        return [(self.truth[thing], self._stage(thing)) for thing in lost]

    def _own(self, thing: int, name: str) -> int:
        return thing if thing >= 0 and self.truth[thing].name == name else -1

    def _published(self, every: bool) -> list[SemanticObject]:
        """Return the objects, or every track as an object, without what drops one of two."""
        config = replace(CONFIG.evidence, slip=1, min_overlap=1)
        if every:
            config = replace(config, publish_above=config.forget_below, min_probability=0)
        return PublishedTracks(self._tracks, config, self.map.is_free, False).objects()

    def _stage(self, thing: int) -> str:
        if self.detected[thing] < 2:
            return STAGES[self.detected[thing]]
        if self.cut_out[thing] < 2:
            return "cut out at most once"
        track, is_own = self._track_of(thing)
        if track is None:
            return "forgotten"
        if not is_own:
            return "in the track of another thing"
        shape, true = self._shapes[track.id], self.truth[thing].footprint
        is_published = track.id in {item.id for item in self.objects}
        if iou(shape, true) < LEAST_IOU:
            if self._has_other_class(thing):
                return "other class in its place"
            why = "off" if iou(at_place_of(shape, true), true) >= LEAST_IOU else "shape"
            return f"{'published' if is_published else 'unpublished'}: {why}"
        if is_published:  # but the find of another thing
            return "in the track of another thing"
        return self._why_unpublished(track)

    def _track_of(self, thing: int) -> tuple[Track | None, bool]:
        """Return the track with most observations of a thing, and whether it is mostly of it."""
        best: tuple[bool, int, Track | None] = False, 0, None
        for track in self._tracks.objects:
            if track.name == self.truth[thing].name:
                of = Counter(self._origin.get((i.stamp, i.score), -1) for i in track.buffer.items)
                is_own = of[thing] == max(of.values())
                if (is_own and of[thing] > 0, of[thing]) > best[:2]:
                    best = is_own and of[thing] > 0, of[thing], track
        return best[2], best[0]

    def _has_other_class(self, thing: int) -> bool:
        true, name = self.truth[thing].footprint, self.truth[thing].name
        return any(o.name != name and iou(o.footprint, true) >= LEAST_IOU for o in self.objects)

    def _why_unpublished(self, track: Track) -> str:
        if track.id in {item.id for item in self._published(False)}:
            return "unpublished: one of two"
        (row,) = self._tracks.rows_of([track.id])
        is_enough = self._tracks.existence[row] > CONFIG.evidence.publish_above
        return f"unpublished: {'probability' if is_enough else 'existence'}"


def iou(shape: BaseGeometry, other: BaseGeometry) -> float:
    """Return the intersection over union of two shapes."""
    return float(iou_matrix([shape], [other])[0, 0])


def at_place_of(shape: BaseGeometry, true: BaseGeometry) -> BaseGeometry:
    """Return a shape moved to where the centroid of another one is."""
    by = true.centroid.x - shape.centroid.x, true.centroid.y - shape.centroid.y
    return affinity.translate(shape, *by)


def show(passages: Iterable[Passage]) -> None:
    """Print what was lost where, as rows of a table."""
    lost: dict[str, Counter[str]] = defaultdict(Counter)
    frames: list[int] = []
    found = 0
    for each in passages:
        for thing, stage in each.missed():
            lost[thing.name][stage] += 1
        frames += [each.detected[thing] for thing in range(len(each.truth))]
        found += len(each.matches)
    names = sorted(lost, key=lambda name: (-lost[name].total(), name))
    print(f"{len(frames)} true things, {found} found")
    print("detected: " + ", ".join(f"{share(frames, n):.2f} ({n} times)" for n in ENOUGH))
    print("| lost | all | " + " | ".join(names) + " |")
    print("| --- |" + " --- |" * (1 + len(names)))
    for stage in (*STAGES, "in all"):
        counts = [lost[n].total() if stage == "in all" else lost[n][stage] for n in names]
        print(f"| {stage} | " + " | ".join(str(n or "") for n in (sum(counts), *counts)) + " |")


def share(frames: Sequence[int], least: int) -> float:
    """Return the share of the things that were detected in so many frames."""
    return float(np.mean([n >= least for n in frames]))


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
        show(Passage(driven(name, seed, arguments.errors, arguments.rate)) for seed in seeds)


if __name__ == "__main__":
    main()
