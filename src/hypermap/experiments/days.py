"""Drives a day apart through worlds that change, each mapped onto the map of the day before.

What the map's history says of each day is compared with what has really changed.
"""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Iterator, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field
from functools import partial

import numpy as np
import scipy
import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.core.history import ADDED, GONE, MOVED, Change
from hypermap.core.occupancy import OccupancyLayer
from hypermap.evaluation.matching import match_objects
from hypermap.experiments.day_causes import cause_of_missed, cause_of_wrong
from hypermap.experiments.look_alikes import as_told
from hypermap.experiments.mapped_day import LOOKED, MappedDay
from hypermap.experiments.parallel import in_processes
from hypermap.experiments.shown import Shown
from hypermap.history import grown
from hypermap.mapping.config import MappingConfig
from hypermap.mapping.mapper import Mapper
from hypermap.perception.detections import Detections
from hypermap.perception.frame import RgbdFrame
from hypermap.simulation import Errors, SimulatedRecording, World
from hypermap.simulation.days import Day, WorldChange, next_day, seed_of_day

FIRST_DAY = 1_763_971_200.0
"""When the first drive begins, in seconds since 1970: 2025-11-24, 8:00 UTC."""

DAY = 86_400.0  # seconds

_TELLABLE = 0.25  # share by which sizes must differ for the maps of two days to tell which is which
_NEAR = 0.5  # [m] between the place that is reported and the true one
_REPORTED = {"moved": MOVED, "removed": GONE, "added": ADDED}
KINDS = tuple(_REPORTED)


@dataclass(frozen=True)
class Series:
    """Drives a day apart through a world that changes.

    Attributes:
        world: on the first day.
        seed: of the random number generator.
        errors: of camera, localization and detector.
        rate: frames per second.
        days: how many drives.
    """

    world: World
    seed: int
    errors: Errors
    rate: float
    days: int


@dataclass
class Counts:
    """Counts of changes, by kind.

    Attributes:
        true: those that there were.
        reported: those that the map reports.
        right: of these, those that there were.
    """

    true: Counter[str] = field(default_factory=Counter)
    reported: Counter[str] = field(default_factory=Counter)
    right: Counter[str] = field(default_factory=Counter)

    def add(self, kind: str, right: int, missed: int, wrong: int) -> None:
        """Add changes of one kind."""
        self.true[kind] += right + missed
        self.reported[kind] += right + wrong
        self.right[kind] += right


@dataclass
class Tally:
    """Counts of one series.

    Attributes:
        world: name of the world.
        seed: of the series.
        looked: changes at places where the robot looked on both days.
        in_sight: of these, changes whose places it had in sight on both days; a move of which it
            had one place in sight is a removal from there, or an addition.
        alike: as `looked`, but things of one class may stand for each other unless their sizes
            differ by more than maps tell.
        swapped: things that were swapped with one of the same class and size.
        swapped_found: of these, those of which the map says that they were moved.
        kept: true objects that the map had on both days.
        switched: of these, those whose id changed.
        first: objects of the first map, of the truth, and matches at an IoU of 0.25.
        last: the same of the last map.
        causes: of what was missed and what was wrong, such as "wrong added: ghost".
        notes: each of these, with its cause.
    """

    world: str
    seed: int
    looked: Counts = field(default_factory=Counts)
    in_sight: Counts = field(default_factory=Counts)
    alike: Counts = field(default_factory=Counts)
    swapped: int = 0
    swapped_found: int = 0
    kept: int = 0
    switched: int = 0
    first: tuple[int, int, int] = (0, 0, 0)
    last: tuple[int, int, int] = (0, 0, 0)
    causes: Counter[str] = field(default_factory=Counter)
    notes: list[str] = field(default_factory=list)


def map_series(series: Sequence[Series], config: MappingConfig, jobs: int) -> Iterator[Tally]:
    """Yield the tally of each series, in the order in which they are done."""
    return in_processes(partial(map_one, config=config), series, jobs)


def map_one(series: Series, config: MappingConfig) -> Tally:
    """Map all drives of a series, each onto the map before, and return what came of it."""
    tally = Tally(series.world.name, series.seed)
    day = Day.first(series.world)
    before: MappedDay | None = None
    for number in range(series.days):
        if number:
            day = next_day(day, seed_of_day(series.seed, number + 1))
        mapped = map_day(series, day, number, before, config)
        if before is None:
            tally.first = _static(mapped)
        else:
            count_day(tally, before, mapped)
        before = mapped
    assert before is not None  # there is at least one day
    tally.last = _static(before)
    return tally


def map_day(
    series: Series, day: Day, number: int, before: MappedDay | None, config: MappingConfig
) -> MappedDay:
    """Map the drive of a day, the first one with `number` 0, onto the map of the day before."""
    seed = seed_of_day(series.seed, number + 1)
    recording = SimulatedRecording.with_errors(
        day.world, series.errors, rate=series.rate, seed=seed
    )
    name = f"day {number + 1}"
    if before is None:
        mapper = Mapper(config, _detections, _laser_map(recording), drive=name)
    else:
        mapper = Mapper.onto(before.hypermap, _detections, config, name)
    visible, shown = [], Shown(day, config.evidence.max_range)
    for frame in recording.frames():
        shown.add(recording)
        stamp = FIRST_DAY + number * DAY + frame.stamp
        later = dataclasses.replace(frame, stamp=stamp, color_stamp=stamp)
        observation = mapper.add(later)
        if observation is not None:
            visible.append(observation.visible_area)
    hypermap = grown(mapper.hypermap(), FIRST_DAY + number * DAY)
    return MappedDay(day, hypermap, visible, shown)


def _detections(frame: RgbdFrame) -> Detections:
    return frame.detections or Detections.of([], [])


def _laser_map(recording: SimulatedRecording) -> OccupancyLayer:
    layer = recording.occupancy()
    assert layer is not None  # it has one by default
    return layer


def count_day(tally: Tally, before: MappedDay, after: MappedDay) -> None:
    """Count the changes that the map of a day reports, true ones and others."""
    history = after.hypermap.history
    assert history is not None
    revision = history.revisions()[-1]
    said = list(revision.changes)
    days = before, after
    true, mistaken = as_told(after.day.changes, said, _NEAR)
    compared = {kind: _Compared.of(kind, true, said, days) for kind in KINDS}
    for found in compared.values():
        _count_kind(tally, found, days, f"{revision.drive}")
    told = {one.thing for one in compared["moved"].right}
    seen = [one if one.thing in told else _as_seen(one, days) for one in true]
    for kind in KINDS:
        found = _Compared.of(kind, seen, said, days)
        groups = (found.right, found.missed, found.wrong)
        tally.in_sight.add(kind, *(sum(_was_in_sight(c, days) for c in group) for group in groups))
    _count_ids(tally, before, after, mistaken)
    as_sized, _ = as_told(after.day.changes, said, _NEAR, _TELLABLE)
    for kind in KINDS:
        found = _Compared.of(kind, as_sized, said, days)
        tally.alike.add(kind, len(found.right), len(found.missed), len(found.wrong))


@dataclass(frozen=True, eq=False)
class _Compared:
    """The changes of one kind, true ones and those that the map reports.

    Attributes:
        kind: which.
        right: true changes that the map reports.
        missed: those that it does not report.
        wrong: what it reports, but is not true.
        swapped: how many things were swapped with one of the same class and size; 0 but for moves.
        swapped_found: of these, how many the map reports as moved.
    """

    kind: str
    right: list[WorldChange]
    missed: list[WorldChange]
    wrong: list[Change]
    swapped: int
    swapped_found: int

    @classmethod
    def of(
        cls,
        kind: str,
        true: Sequence[WorldChange],
        said: Sequence[Change],
        days: tuple[MappedDay, MappedDay],
    ) -> _Compared:
        """Compare those whose places the robot looked at on both days.

        What the map reports of others that are true, or of swaps, is neither right nor wrong.
        """
        real = [one for one in true if one.kind == kind]
        of_kind = [one for one in real if _is_seen(_places(one), days)]
        kept = [one for one in said if one.kind == _REPORTED[kind] and not one.is_doubtful]
        reported = [one for one in kept if _is_seen(_centers(one), days)]
        pairs = _pairs(of_kind, reported)
        found, right = {i for i, _ in pairs}, {j for _, j in pairs}
        others = [one for j, one in enumerate(reported) if j not in right]
        swaps = [change for change in days[1].day.changes if change.kind == "swapped"]
        swaps = swaps if kind == "moved" else []
        swapped_found = {j for _, j in _pairs(swaps, others)}
        uncounted = [one for one in real if one not in of_kind]
        excused = swapped_found | {j for _, j in _pairs(uncounted, others)}
        return cls(
            kind,
            [of_kind[i] for i, _ in pairs],
            [one for i, one in enumerate(of_kind) if i not in found],
            [one for j, one in enumerate(others) if j not in excused],
            sum(_is_seen(_places(change), days) for change in swaps),
            len(swapped_found),
        )


def _count_kind(
    tally: Tally, found: _Compared, days: tuple[MappedDay, MappedDay], drive: str
) -> None:
    """Count the changes of one kind, with the causes of what was missed or wrong."""
    kind = found.kind
    tally.swapped += found.swapped
    tally.swapped_found += found.swapped_found
    tally.looked.add(kind, len(found.right), len(found.missed), len(found.wrong))
    causes = [
        (f"missed {_told(one)}", f"missed {kind}: {cause_of_missed(one, *days)}")
        for one in found.missed
    ]
    causes += [
        (f"wrong {_said(one)}", f"wrong {kind}: {cause_of_wrong(one, *days)}")
        for one in found.wrong
    ]
    tally.causes.update(cause for _, cause in causes)
    tally.notes += [f"{drive}: {told} ({cause})" for told, cause in causes]


def _told(change: WorldChange) -> str:
    thing = change.after or change.before
    assert thing is not None
    ends = [one.place for one in (change.before, change.after) if one is not None]
    return f"{change.kind} {thing.label} {[tuple(round(v, 1) for v in end) for end in ends]}"


def _said(change: Change) -> str:
    ends = [one.footprint.centroid for one in (change.before, change.after) if one is not None]
    return f"{change.kind} {change.object.name} {[(round(e.x, 1), round(e.y, 1)) for e in ends]}"


def _places(change: WorldChange) -> list[BaseGeometry]:
    ends = (change.before, change.after)
    return [shapely.Point(one.place) for one in ends if one is not None]


def _centers(change: Change) -> list[BaseGeometry]:
    ends = (change.before, change.after)
    return [one.footprint.centroid for one in ends if one is not None]


def _is_seen(places: Sequence[BaseGeometry], days: tuple[MappedDay, MappedDay]) -> bool:
    """Return whether the robot looked at all places of a change, on both days."""
    return all(day.looked_at(place) for place in places for day in days)


def _as_seen(change: WorldChange, days: tuple[MappedDay, MappedDay]) -> WorldChange:
    """Return what two drives can know of a change.

    A thing that was moved from or to a place that they do not show has come or gone for them.
    """
    if change.kind != "moved":
        return change
    gone = dataclasses.replace(change, kind="removed", after=None)
    came = dataclasses.replace(change, kind="added", before=None)
    shown = [one for one in (gone, came) if _was_in_sight(one, days)]
    return shown[0] if len(shown) == 1 else change


def _was_in_sight(change: WorldChange | Change, days: tuple[MappedDay, MappedDay]) -> bool:
    """Return whether both drives show what has changed at its places, or would, were it there."""
    ends = [one for one in (change.before, change.after) if one is not None]
    return all(day.shown.frames_that_show(one) >= LOOKED for one in ends for day in days)


def _pairs(true: Sequence[WorldChange], said: Sequence[Change]) -> list[tuple[int, int]]:
    """Return which true changes are which reported ones, one to one."""
    if not true or not said:
        return []
    cost = np.array([[_cost(one, other) for other in said] for one in true])
    rows, cols = scipy.optimize.linear_sum_assignment(cost)
    pairs = zip(rows.tolist(), cols.tolist(), strict=True)
    return [(i, j) for i, j in pairs if cost[i, j] <= _NEAR]


def _cost(true: WorldChange, said: Change) -> float:
    """Return how far apart the places of two changes are [m]; large for other classes."""
    ends = ((true.before, said.before), (true.after, said.after))
    worst = 0.0
    for thing, item in ends:
        if (thing is None) != (item is None):
            return 1e6
        if thing is not None and item is not None:
            if thing.label != item.name:
                return 1e6
            away = item.footprint.distance(shapely.Point(thing.place))
            worst = max(worst, float(away))
    return worst


def _count_ids(
    tally: Tally, before: MappedDay, after: MappedDay, mistaken: AbstractSet[int]
) -> None:
    """Count the true objects that kept their ids from one map to the next.

    Those that were swapped or `mistaken` for others that look alike do not count.
    """
    ids = [day.id_of for day in (before, after)]
    swapped = {change.thing for change in after.day.changes if change.kind == "swapped"}
    both = (ids[0].keys() & ids[1].keys()) - swapped - mistaken
    switched = {thing for thing in both if ids[0][thing] != ids[1][thing]}
    tally.kept += len(both)
    tally.switched += len(switched)


def _static(day: MappedDay) -> tuple[int, int, int]:
    """Return how many objects a map and the truth have, and how many match at an IoU of 0.25."""
    found, truth = day.objects, day.truth
    matches = [match for match in match_objects(found, truth) if match.iou >= 0.25]
    return len(found), len(truth), len(matches)
