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
from hypermap.core.hypermap import Hypermap
from hypermap.core.objects import SemanticObject
from hypermap.core.occupancy import OccupancyLayer
from hypermap.evaluation.matching import match_objects
from hypermap.experiments.look_alikes import as_told
from hypermap.experiments.parallel import in_processes
from hypermap.history import grown
from hypermap.mapping.config import MappingConfig
from hypermap.mapping.mapper import Mapper
from hypermap.perception.detections import Detections
from hypermap.perception.frame import RgbdFrame
from hypermap.simulation import Errors, SimulatedRecording, World
from hypermap.simulation.days import Day, WorldChange, next_day
from hypermap.simulation.truth import true_objects

FIRST_DAY = 1_763_971_200.0
"""When the first drive begins, in seconds since 1970: 2025-11-24, 8:00 UTC."""

DAY = 86_400.0  # seconds

_LOOKED = 3  # frames that must show a place for it to count as looked at
_COVERED = 0.5  # share of an object's place that a frame must be able to see
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
class Tally:
    """Counts of one series.

    Attributes:
        world: name of the world.
        seed: of the series.
        true: changes where the robot looked on both days, by kind.
        reported: changes that the map reports where the robot looked on both days, by kind.
        right: of these, those that there were.
        swapped: things that were swapped with one of the same class and size.
        swapped_found: of these, those of which the map says that they were moved.
        kept: true objects that the map had on both days.
        switched: of these, those whose id changed.
        first: objects of the first map, of the truth, and matches at an IoU of 0.25.
        last: the same of the last map.
        notes: what was missed, and what was wrong.
    """

    world: str
    seed: int
    true: Counter[str] = field(default_factory=Counter)
    reported: Counter[str] = field(default_factory=Counter)
    right: Counter[str] = field(default_factory=Counter)
    swapped: int = 0
    swapped_found: int = 0
    kept: int = 0
    switched: int = 0
    first: tuple[int, int, int] = (0, 0, 0)
    last: tuple[int, int, int] = (0, 0, 0)
    notes: list[str] = field(default_factory=list)


def map_series(series: Sequence[Series], config: MappingConfig, jobs: int) -> Iterator[Tally]:
    """Yield the tally of each series, in the order in which they are done."""
    return in_processes(partial(map_one, config=config), series, jobs)


def map_one(series: Series, config: MappingConfig) -> Tally:
    """Map all drives of a series, each onto the map before, and return what came of it."""
    tally = Tally(series.world.name, series.seed)
    day = Day.first(series.world)
    before: _MappedDay | None = None
    for number in range(series.days):
        if number:
            day = next_day(day, 1000 * series.seed + number)
        mapped = _map_day(series, day, number, before, config)
        if before is None:
            tally.first = _static(mapped)
        else:
            _count_day(tally, before, mapped)
        before = mapped
    assert before is not None  # there is at least one day
    tally.last = _static(before)
    return tally


@dataclass(frozen=True, eq=False)
class _MappedDay:
    """A day, the map after its drive, and what the drive could see.

    Attributes:
        day: the truth.
        hypermap: the map.
        visible: what each mapped frame could see of the floor.
    """

    day: Day
    hypermap: Hypermap
    visible: list[BaseGeometry]

    @property
    def truth(self) -> list[SemanticObject]:
        """The true objects; their ids are the numbers of the things."""
        objects = true_objects(self.day.world).objects()
        pairs = zip(objects, self.day.things, strict=True)
        return [dataclasses.replace(item, id=thing) for item, thing in pairs]

    def looked_at(self, shape: BaseGeometry) -> bool:
        """Return whether some frames could see a place."""
        areas = np.array(self.visible, dtype=object)
        areas = areas[shapely.intersects(areas, shape)]
        shares = shapely.area(shapely.intersection(areas, shape)) / shape.area
        return int(np.count_nonzero(shares >= _COVERED)) >= _LOOKED


def _map_day(
    series: Series, day: Day, number: int, before: _MappedDay | None, config: MappingConfig
) -> _MappedDay:
    seed = 1000 * series.seed + number
    recording = SimulatedRecording.with_errors(
        day.world, series.errors, rate=series.rate, seed=seed
    )
    name = f"day {number + 1}"
    if before is None:
        mapper = Mapper(config, _detections, _laser_map(recording), drive=name)
    else:
        mapper = Mapper.onto(before.hypermap, _detections, config, name)
    visible = []
    for frame in recording.frames():
        stamp = FIRST_DAY + number * DAY + frame.stamp
        later = dataclasses.replace(frame, stamp=stamp, color_stamp=stamp)
        observation = mapper.add(later)
        if observation is not None:
            visible.append(observation.visible_area)
    return _MappedDay(day, grown(mapper.hypermap(), FIRST_DAY + number * DAY), visible)


def _detections(frame: RgbdFrame) -> Detections:
    return frame.detections or Detections.of([], [])


def _laser_map(recording: SimulatedRecording) -> OccupancyLayer:
    layer = recording.occupancy()
    assert layer is not None  # it has one by default
    return layer


def _count_day(tally: Tally, before: _MappedDay, after: _MappedDay) -> None:
    history = after.hypermap.history
    assert history is not None
    revision = history.revisions()[-1]
    said, drive = list(revision.changes), f"{after.day.world.name}, {revision.drive}"
    changes, mistaken = as_told(after.day.changes, said, _NEAR)
    true = [change for change in changes if _is_seen(change, before, after)]
    for kind, reported_as in _REPORTED.items():
        of_kind = [change for change in true if change.kind == kind]
        reported = [one for one in said if one.kind == reported_as]
        reported = [one for one in reported if _is_known(one, before, after)]
        pairs = _pairs(of_kind, reported)
        swaps = [change for change in after.day.changes if change.kind == "swapped"]
        others = [one for i, one in enumerate(reported) if i not in {j for _, j in pairs}]
        excused = {j for _, j in _pairs(swaps, others)} if kind == "moved" else set()
        tally.true[kind] += len(of_kind)
        tally.reported[kind] += len(reported) - len(excused)
        tally.right[kind] += len(pairs)
        if kind == "moved":
            tally.swapped += sum(_is_seen(change, before, after) for change in swaps)
            tally.swapped_found += len(excused)
        missed = [of_kind[i] for i in range(len(of_kind)) if i not in {a for a, _ in pairs}]
        wrong = [one for j, one in enumerate(others) if j not in excused]
        tally.notes += [f"{drive}: missed {_told(change)}" for change in missed]
        tally.notes += [f"{drive}: wrong {_said(change)}" for change in wrong]
    _count_ids(tally, before, after, mistaken)


def _told(change: WorldChange) -> str:
    thing = change.after or change.before
    assert thing is not None
    ends = [one.place for one in (change.before, change.after) if one is not None]
    return f"{change.kind} {thing.label} {[tuple(round(v, 1) for v in end) for end in ends]}"


def _said(change: Change) -> str:
    ends = [one.footprint.centroid for one in (change.before, change.after) if one is not None]
    return f"{change.kind} {change.object.name} {[(round(e.x, 1), round(e.y, 1)) for e in ends]}"


def _places(change: WorldChange) -> list[tuple[float, float]]:
    return [one.place for one in (change.before, change.after) if one is not None]


def _is_seen(change: WorldChange, before: _MappedDay, after: _MappedDay) -> bool:
    """Return whether the robot looked at all places of a change, on both days."""
    spots = [shapely.Point(place).buffer(0.15) for place in _places(change)]
    return all(day.looked_at(spot) for spot in spots for day in (before, after))


def _is_known(change: Change, before: _MappedDay, after: _MappedDay) -> bool:
    items = [one for one in (change.before, change.after) if one is not None]
    spots = [item.footprint.centroid.buffer(0.15) for item in items]
    return all(day.looked_at(spot) for spot in spots for day in (before, after))


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
    tally: Tally, before: _MappedDay, after: _MappedDay, mistaken: AbstractSet[int]
) -> None:
    """Count the true objects that kept their ids from one map to the next.

    Those that were swapped or `mistaken` for others that look alike do not count.
    """
    ids = [_ids_of_things(day) for day in (before, after)]
    swapped = {change.thing for change in after.day.changes if change.kind == "swapped"}
    both = (ids[0].keys() & ids[1].keys()) - swapped - mistaken
    switched = {thing for thing in both if ids[0][thing] != ids[1][thing]}
    tally.kept += len(both)
    tally.switched += len(switched)


def _ids_of_things(day: _MappedDay) -> dict[int, int]:
    """Return the id in the map of each true object that it has."""
    truth, found = day.truth, day.hypermap.semantic().objects()
    matches = match_objects(found, truth)
    pairs = ((truth[m.ground_truth].id, found[m.estimate].id) for m in matches)
    return {thing: number for thing, number in pairs if thing is not None and number is not None}


def _static(day: _MappedDay) -> tuple[int, int, int]:
    """Return how many objects a map and the truth have, and how many match at an IoU of 0.25."""
    found, truth = day.hypermap.semantic().objects(), day.truth
    matches = [match for match in match_objects(found, truth) if match.iou >= 0.25]
    return len(found), len(truth), len(matches)
