"""What `hypermap merge` makes of the maps of two days, beside `map --onto`, and of two robots.

Each world is driven through on two days, between which things are moved, removed and added. The map
of the second day, in a frame of its own where it is made from depth (`align` finds it), is merged
with that of the first, in both orders; the same drive is also mapped onto the first map. All are
compared with the truth of the second day, and the changes that their histories tell with the true
ones. Two robots, which drive through overlapping parts of the first day's world at the same time,
are compared with the truth of that day.

    python benchmarks/merging.py [--worlds lab,floor,office,apartment] [--seeds 921,922] [--rate 2]
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
import logging
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from hypermap.alignment import align
from hypermap.core.frames import Pose2D
from hypermap.core.hypermap import Hypermap
from hypermap.core.objects import SemanticObject
from hypermap.evaluation.matching import match_objects
from hypermap.experiments.days import DAY, FIRST_DAY, KINDS, Counts, Tally, count_day
from hypermap.experiments.mapped_day import MappedDay
from hypermap.experiments.shown import Shown
from hypermap.history import grown
from hypermap.mapping.config import profile
from hypermap.mapping.mapper import Mapper
from hypermap.mapping.merging import merge_maps
from hypermap.perception.detectors.sources import detections_from_recording
from hypermap.simulation import SimulatedRecording, built_in_world, errors_of_level, varied
from hypermap.simulation.days import Day, next_day, seed_of_day

_CONFIG, _SOURCE = profile("default"), detections_from_recording()
_OTHER_FRAME = Pose2D(3.0, -2.0, 0.6)
_PARTS = (0.0, 0.65), (0.35, 1.0)
"""Shares of the drive that two robots make."""
_SOONER = 100.0  # [s] that the second robot starts before the first


@dataclass
class Found:
    """Counts of one way to map: objects found, true ones, matches, the sum of their IoU."""

    objects: NDArray[np.float64] = field(default_factory=lambda: np.zeros(4))
    changes: Counts = field(default_factory=Counts)

    def add(self, objects: Sequence[SemanticObject], truth: Sequence[SemanticObject]) -> None:
        """Compare the objects of a map with the true ones."""
        ious = [match.iou for match in match_objects(objects, truth) if match.iou >= 0.25]
        self.objects += (len(objects), len(truth), len(ious), sum(ious))

    def line(self) -> str:
        """Return precision, recall and mean IoU of objects, and F1 of changes."""
        found, true, matches, ious = self.objects
        line = f"precision {matches / found:.3f} recall {matches / true:.3f} "
        line += f"IoU {ious / matches:.3f}"
        for kind in KINDS if self.changes.true else ():
            true, said, right = (
                getattr(self.changes, name)[kind] for name in ("true", "reported", "right")
            )
            line += (
                f"  {kind} {2 * right / max(true + said, 1):.3f} ({right} of {true}, {said} told)"
            )
        return line


@dataclass(frozen=True, eq=False)
class Driven:
    """What each of several mappers has made of one drive."""

    maps: list[Hypermap]
    visible: list[object]
    shown: Shown


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--worlds", default="lab,floor,office,apartment")
    parser.add_argument("--seeds", default="921,922")
    parser.add_argument("--rate", type=float, default=2.0)
    given = parser.parse_args()
    logging.getLogger("hypermap").setLevel(logging.ERROR)
    results: dict[str, Found] = defaultdict(Found)
    for name, seed in itertools.product(given.worlds.split(","), map(int, given.seeds.split(","))):
        first = Day.first(varied(built_in_world(name), seed))
        merge_days(first, seed, given.rate, results)
        merge_robots(first, seed, given.rate, results)
        print(f"{name} {seed}", flush=True)
    for way, found in results.items():
        print(f"{way:36}{found.line()}")


def merge_days(first: Day, seed: int, rate: float, results: dict[str, Found]) -> None:
    """Map two days, with the occupancy of a laser and from depth, and merge the maps."""
    second = next_day(first, seed_of_day(seed, 2))
    before = drive(first, seed_of_day(seed, 1), rate, FIRST_DAY, (None, None))
    after = drive(second, seed_of_day(seed, 2), rate, FIRST_DAY + DAY, (None, None, *before.maps))
    for kind, a, b, onto in zip(
        ("laser", "depth"), before.maps, after.maps[:2], after.maps[2:], strict=True
    ):
        a_T_b = Pose2D() if kind == "laser" else align(a, b).a_T_b
        merged = grown(merge_maps(a, b, a_T_b).hypermap, FIRST_DAY + DAY)
        old = MappedDay(first, a, before.visible, before.shown)
        for way, hypermap in (("map --onto", onto), ("merge", merged)):
            new = MappedDay(second, hypermap, after.visible, after.shown)
            found, tally = results[f"{kind}: {way}"], Tally("", seed)
            found.add(new.objects, new.truth)
            count_day(tally, old, new)
            for change in KINDS:
                right = tally.looked.right[change]
                missed = tally.looked.true[change] - right
                found.changes.add(change, right, missed, tally.looked.reported[change] - right)
        turned = merge_maps(b, a, a_T_b.inverse()).hypermap.semantic().objects()
        results[f"{kind}: merge, later map first"].add(
            [dataclasses.replace(o, footprint=a_T_b.apply_geometry(o.footprint)) for o in turned],
            new.truth,
        )


def merge_robots(day: Day, seed: int, rate: float, results: dict[str, Found]) -> None:
    """Let two robots drive through parts of a world at the same time, and merge their maps."""
    one = drive(day, seed_of_day(seed, 1), rate, FIRST_DAY, (None,), _PARTS[0])
    maps = (None, *one.maps)
    other = drive(day, seed_of_day(seed + 5000, 1), rate, FIRST_DAY - _SOONER, maps, _PARTS[1])
    (a,), (b, onto) = one.maps, other.maps
    truth = MappedDay(day, a, one.visible, one.shown).truth
    ways = {
        "the first alone": a,
        "the second alone": b,
        "map --onto": onto,
        "merge": merge_maps(a, b, Pose2D()).hypermap,
        "merge, second map first": merge_maps(b, a, Pose2D()).hypermap,
    }
    for way, hypermap in ways.items():
        results[f"two robots: {way}"].add(hypermap.semantic().objects(), truth)


def drive(
    day: Day,
    seed: int,
    rate: float,
    begin: float,
    bases: Sequence[Hypermap | None],
    part: tuple[float, float] = (0.0, 1.0),
) -> Driven:
    """Return the maps of a drive, each alone or onto another map.

    Of two that begin a map, the first one has the occupancy of a laser, and the second one, if it
    is of a later day, is in another frame.
    """
    errors = errors_of_level("robot")
    recording = SimulatedRecording.with_errors(day.world, errors, rate=rate, seed=seed)
    name, laser = f"{begin:.0f}, {seed}", recording.occupancy()
    has_laser = part == (0.0, 1.0)
    mappers = []
    for number, base in enumerate(bases):
        if base is not None:
            mapper = Mapper.onto(base, _SOURCE, _CONFIG, name)
        else:
            mapper = Mapper(
                _CONFIG, _SOURCE, laser if has_laser and not number else None, drive=name
            )
        is_turned = base is None and number == 1 and begin > FIRST_DAY
        mappers.append((mapper, matrix_of(_OTHER_FRAME if is_turned else Pose2D())))
    shown, visible = Shown(day, _CONFIG.evidence.max_range), []
    rows = range(round(part[0] * len(recording)), round(part[1] * len(recording)))
    for row, frame in enumerate(recording.frames()):
        shown.add(recording)
        if row not in rows:
            continue
        stamp = begin + frame.stamp
        for mapper, matrix in mappers:
            pose = matrix @ frame.map_T_camera
            observation = mapper.add(
                dataclasses.replace(frame, stamp=stamp, color_stamp=stamp, map_T_camera=pose)
            )
            if observation is not None and mapper is mappers[0][0]:
                visible.append(observation.visible_area)
    return Driven([grown(mapper.hypermap(), begin) for mapper, _ in mappers], visible, shown)


def matrix_of(pose: Pose2D) -> NDArray[np.float64]:
    """Return a pose on the floor as a matrix in space, shape (4, 4)."""
    matrix = np.eye(4)
    matrix[np.ix_([0, 1, 3], [0, 1, 3])] = pose.matrix()
    return matrix


if __name__ == "__main__":
    main()
