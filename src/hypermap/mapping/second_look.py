"""A second look: whether a drive has detected an object that its map lacks.

Two maps of one place may differ although nothing has changed: an object is lost among others like
it, or had too few detections for one of the maps. The frames of both drives tell this apart from
objects that came or went: where these were not, the detector has found nothing like them, and rays
have passed that the object would have stopped.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import as_objects
from hypermap.core.errors import FormatError
from hypermap.core.history import ADDED, Change
from hypermap.core.objects import SemanticObject
from hypermap.core.semantic import SemanticLayer
from hypermap.core.shapes import valid_copies
from hypermap.history.likeness import MIN_MOVED, MIN_SHIFT, distance_between
from hypermap.mapping.config import MappingConfig
from hypermap.mapping.drives import Drive, rows_of_drives
from hypermap.mapping.evidence_buffer import CONFIRMED
from hypermap.mapping.frame_log import FrameLog, LoggedFrame, LogPart
from hypermap.mapping.moved_frames import moved_frames
from hypermap.mapping.occlusion import sample_points, visible_shares
from hypermap.mapping.prepared_polygon import PreparedPolygon
from hypermap.mapping.track_colors import objects_differ_in_color
from hypermap.mapping.tracks import TrackTable

_VISIBLE = 0.5  # share of an object that a frame must be able to see
_BESIDE = 0.1  # [m] between an object and a detection of it, at most
_NEXT = 0.5  # [m] between two objects, one of which may be a second one of the other
_LARGE = 0.3  # [m]; outlines and poses are off by as much as smaller objects
_DEEP = 0.15  # [m]; thinner objects cannot be told from others beside them, or walls behind
_APART = 0.1  # share of an object that another one beside it may seem to take
_FOUND, _MISSED = 9.0, 3.0  # beta distribution of the share of such frames that detect an object
_FALSE = 0.05  # share of those that detect one which is not there
_DIFFERS = 0.35  # share of the rays stopped by an object from which on more or fewer pass
_EMPTY = 0.4  # share of all rays by which so many more pass that its place is empty
_THIN = 0.85  # share of the rays that pass a thin object, such as a lamp
_HOLLOW = 0.5  # share of those that pass one with much free space below it, such as a table
_MANY = 12  # frames, all of which a detector hardly overlooks the same object in
_IN_PLACE = 0.1  # share of an object's floor on which another thing may be there instead
_LIKELY = 0.5  # least chance that a drive shows two objects, and not one of them twice
_SURE = 0.9  # how likely it is what such rays tell


@dataclass(frozen=True)
class _Looks:
    """How a drive has seen the place of an object.

    Attributes:
        shown: frames that could see it.
        detected: of these, frames that detect it.
        passed: share of the rays towards it that ended behind, 0..1, the median of the frames.
    """

    shown: int
    detected: int
    passed: float

    @property
    def chance(self) -> float:
        """How likely the object is there; before these frames, it may as well be as not.

        Each object is detected at a rate of its own, with a beta distribution.
        """
        missed = self.shown - self.detected
        if_there = _log_beta(_FOUND + self.detected, _MISSED + missed) - _log_beta(_FOUND, _MISSED)
        if_not = self.detected * math.log(_FALSE) + missed * math.log(1 - _FALSE)
        return 0.5 * (1 + math.tanh((if_there - if_not) / 2))


def doubt_about_changes(
    log: Iterable[LogPart],
    drives: Sequence[Drive],
    config: MappingConfig,
    before: SemanticLayer | None,
    after: Sequence[SemanticObject],
    tracks: TrackTable,
    present: int = 1,
) -> Callable[[Change], float]:
    """Return how likely it is that an object did not come or go, by a change; see `SecondLook`.

    Args:
        log: the parts of the log.
        drives: as in `SecondLook`, as `config`, `before`, `after` and `present`.
        config: likewise.
        before: likewise.
        after: likewise.
        tracks: of the map, whose colors tell objects apart; may change later.
        present: likewise.
    """
    differ = partial(objects_differ_in_color, tracks.snapshot())
    return SecondLook(FrameLog(log), drives, config, before, after, differ, present).chance


def _never(_before: int, _now: int) -> bool:
    return False


@dataclass(frozen=True, eq=False)
class SecondLook:
    """The logged frames of the newest drives.

    Attributes:
        log: the frames.
        drives: all drives, the present one last.
        config: of the map.
        before: the objects before the present drive; None for none.
        after: those after it.
        differ: whether objects that were there before, and one of the present drive, by their ids,
            are of such different colors that they are two.
        present: how many of the drives, the last ones, are the present one.
    """

    log: FrameLog
    drives: Sequence[Drive]
    config: MappingConfig
    before: SemanticLayer | None = None
    after: Sequence[SemanticObject] = ()
    differ: Callable[[int, int], bool] = _never
    present: int = 1
    _unpacked: dict[int, LoggedFrame] = field(default_factory=dict, init=False, repr=False)

    def chance(self, change: Change) -> float:
        """Return how likely it is that an object did not come or go, 0..1.

        One that came may have been there in the last of the earlier drives that could see its
        place, and one that is gone may still be there in the present drive. Before a drive could
        see the place, both are as likely; without one, the answer is 0.

        Beside another one of its class, it may also be a second object of that one: then the drive
        that shows it hardly detects both at once. But where rays pass that it stopped in the other
        drive, it is not there, and where as many are stopped, it is, whatever is detected; but not
        where most rays pass it anyway, and none of many frames detects it.
        """
        rows = rows_of_drives(len(self.log.frames), self.drives)[::-1]
        present, earlier = rows[: self.present], rows[self.present :]
        has_come, item, shapes = change.kind == ADDED, change.object, self._with_rivals(change)
        without, within = (earlier, present) if has_come else (present, earlier)
        there = self._looks_in(within, item, shapes)
        is_second = len(shapes) > 1 and there is not None and there.chance < _LIKELY
        looks = self._looks_in(without, item, self._with_neighbors(change, is_second))
        stayed = 0.0 if looks is None else looks.chance
        if len(shapes) > 1 and there is not None:
            stayed = max(stayed, 1 - there.chance)
        # What the map has may have been gone by the last drive before: that one is no measure.
        with_it = self._looks_in(within, item, shapes, least=1)
        if looks is None or with_it is None or not _stops_rays(item, with_it):
            return stayed
        more = looks.passed - with_it.passed
        if more >= _EMPTY:  # the detections are of what is beside it
            return min(stayed, 1 - _SURE)
        if with_it.passed > _HOLLOW and looks.shown >= _MANY and looks.detected == 0:
            return stayed  # few of the rays tell
        is_as_full = abs(more) < _DIFFERS * (1 - with_it.passed) and not self._is_taken(change)
        return max(stayed, _SURE) if is_as_full else stayed

    def _looks_in(
        self,
        drives: Sequence[slice],
        item: SemanticObject,
        shapes: Sequence[BaseGeometry],
        least: int = 0,
    ) -> _Looks | None:
        """Return the looks of the first of some drives that could see an object; None for none.

        Args:
            drives: rows of the log.
            item: the object.
            shapes: its own, and those of objects whose detections do not count; see `_looks`.
            least: frames of the drive that detect it.
        """
        found = (self._looks(item, rows, shapes) for rows in drives)
        return next((one for one in found if one is not None and one.detected >= least), None)

    def _is_taken(self, change: Change) -> bool:
        """Return whether another thing has come to the place of an object, or left it."""
        own, *others = valid_copies(as_objects([change.object.footprint, *self._instead(change)]))
        shared = shapely.area(shapely.intersection(others, own))
        return bool((shared > _IN_PLACE * own.area).any())

    def _instead(self, change: Change) -> list[BaseGeometry]:
        """Return the shapes of other objects that only the map without this one has there."""
        maps = [[] if self.before is None else self.before.objects(), self.after]
        here, elsewhere = maps if change.kind == ADDED else maps[::-1]
        kept = {item.id: item for item in elsewhere}
        return [
            item.footprint
            for item in here
            if item.id != change.object.id
            and (item.id not in kept or distance_between(item, kept[item.id]) >= MIN_SHIFT)
        ]

    def _with_rivals(self, change: Change) -> list[BaseGeometry]:
        """Return the shape of what came or went, then those of its class beside it on that map."""
        before = [] if self.before is None else self.before.objects()
        item, others = change.object, self.after if change.kind == ADDED else before
        alike = [one.footprint for one in others if one.name == item.name and one.id != item.id]
        own, *rest = valid_copies(as_objects([item.footprint, *alike]))
        return [own, *(shape for shape in rest if shapely.dwithin(shape, own, _NEXT))]

    def _looks(
        self, item: SemanticObject, rows: slice, shapes: Sequence[BaseGeometry]
    ) -> _Looks | None:
        """Return how the frames of a drive have seen an object; None if none could see it.

        Detections that rather are of the others of some `shapes`, of which its own is the first, do
        not count.
        """
        heights = [item.attributes.get(name) for name in ("z_min", "z_max")]
        if item.footprint.is_empty or not all(isinstance(one, int | float) for one in heights):
            return None
        samples, config = sample_points([PreparedPolygon.of(item.footprint)]), self.config.evidence
        passed: list[float] = []
        detected = 0
        for frame in self._frames_near(item, rows):
            view = frame.observation.view
            if view is None or not frame.finds_objects:
                continue
            seen = visible_shares(view, samples, np.array([heights], float), config.tolerance)
            if seen.visible[0] >= _VISIBLE:
                passed.append(seen.beyond[0] / seen.visible[0])
                detected += _detects(frame, item.name, shapes)
        return _Looks(len(passed), detected, float(np.median(passed))) if passed else None

    def _with_neighbors(self, change: Change, is_second: bool) -> list[BaseGeometry]:
        """Return the shape of an object, then those of others that may have been detected.

        These are unmoved ones, those that stood there before the present drive and were moved
        since, and those of another color that came or left instead. Only its own where poses and
        outlines are off by as much: next to small objects.

        Args:
            change: of the object.
            is_second: whether it may be the same one as what reaches into it, mapped twice.
        """
        item, has_come = change.object, change.kind == ADDED
        unmoved = [one.footprint for one in self._unmoved if one.name == item.name]
        moved = [one for one in self._moved if one.name == item.name and has_come]
        apart = [one.footprint for one in (*moved, *self._replaced(change))]
        own, *others = valid_copies(as_objects([item.footprint, *unmoved, *apart]))
        if own.area < _LARGE**2:
            return [own]
        if is_second or not has_come:
            unmoved = [one for one in others[: len(unmoved)] if _shared(one, own) <= _APART]
            others = [*unmoved, *others[len(others) - len(apart) :]]
        return [own, *(one for one in others if shapely.dwithin(one, own, 2 * _BESIDE))]

    def _replaced(self, change: Change) -> list[SemanticObject]:
        """Return what came instead of an object that is gone, or left where one has come."""
        item, has_come = change.object, change.kind == ADDED
        before = [] if self.before is None else self.before.objects()
        kept = {now.id for _, now in self._pairs}
        found = []
        for one in before if has_come else self.after:
            was, now = (one, item) if has_come else (item, one)
            if one.name == item.name and one.id not in kept and self._differ(was, now):
                found.append(one)
        return found

    def _differ(self, was: SemanticObject, now: SemanticObject) -> bool:
        return was.id is not None and now.id is not None and self.differ(was.id, now.id)

    @cached_property
    def _pairs(self) -> list[tuple[SemanticObject, SemanticObject]]:
        """The objects of both maps that the present drive has found, as they were and are."""
        was = {} if self.before is None else {item.id: item for item in self.before.objects()}
        return [(was[item.id], item) for item in self.after if item.id in was]

    @cached_property
    def _unmoved(self) -> list[SemanticObject]:
        """The objects that the present drive has found where they were before."""
        return [
            now
            for was, now in self._pairs
            if _observations(now) >= _observations(was) + CONFIRMED
            and distance_between(was, now) < MIN_MOVED
        ]

    @cached_property
    def _moved(self) -> list[SemanticObject]:
        """The objects that the present drive has found elsewhere, as they were before."""
        return [was for was, now in self._pairs if distance_between(was, now) >= MIN_SHIFT]

    def _frames_near(self, item: SemanticObject, rows: slice) -> list[LoggedFrame]:
        """Return the frames of a drive within the range in which an object can be missed."""
        poses = self.log.poses
        x, y = item.footprint.centroid.coords[0]
        far = np.hypot(poses[rows, 0, 3] - x, poses[rows, 1, 3] - y)
        near = rows.start + np.flatnonzero(far <= self.config.evidence.max_range)
        try:
            self._unpack([row for row in near.tolist() if row not in self._unpacked], poses)
        except FormatError:  # a damaged log must not keep a map from being saved
            return []
        return [self._unpacked[row] for row in near.tolist()]

    def _unpack(self, rows: list[int], poses: NDArray[np.float64]) -> None:
        """Unpack frames and keep them for other objects: this takes most of the time."""
        if rows:
            contents = self.log.frames
            some, resolution = [contents[row] for row in rows], self.config.occupancy.resolution
            moved = moved_frames(some, poses[rows], resolution, "the log of frames")
            self._unpacked.update(zip(rows, moved, strict=True))


def _observations(item: SemanticObject) -> int:
    count = item.attributes.get("evidence")
    return count if isinstance(count, int) else 0


def _detects(frame: LoggedFrame, name: str, shapes: Sequence[BaseGeometry]) -> bool:
    """Return whether a frame detects the first of some objects of a class, not only the others.

    Each detection is of one object, and each object is detected once: the nearest pairs first.
    """
    detected = [one.footprint for one in frame.observation.objects if one.name == name]
    found = valid_copies(as_objects(detected))
    pairs = [
        (-shapely.area(shapely.intersection(one, shape)), shapely.distance(one, shape), i, j)
        for i, one in enumerate(found)
        for j, shape in enumerate(shapes)
        if shapely.dwithin(one, shape, _BESIDE)
    ]
    free = set(range(len(found))), set(range(len(shapes)))
    for _, _, i, j in sorted(pairs):
        if i in free[0] and j in free[1]:
            free[0].remove(i)
            free[1].remove(j)
    return 0 not in free[1]


def _log_beta(a: float, b: float) -> float:
    return math.lgamma(a) + math.lgamma(b) - math.lgamma(a + b)


def _stops_rays(item: SemanticObject, looks: _Looks) -> bool:
    """Return whether rays tell if an object is there: at what is thin or flat, few of them end."""
    return looks.passed <= _THIN and _depth(valid_copies(as_objects([item.footprint]))[0]) >= _DEEP


def _depth(shape: BaseGeometry) -> float:
    """Return the shorter side of the smallest rectangle around a shape [m]."""
    if shape.area == 0:
        return 0.0
    a, b, c, *_ = shapely.get_coordinates(shapely.minimum_rotated_rectangle(shape))
    return float(min(np.hypot(*(b - a)), np.hypot(*(c - b))))


def _shared(one: BaseGeometry, other: BaseGeometry) -> float:
    """Return the share of the smaller of two shapes that is in the other one, 0..1."""
    least = min(one.area, other.area)
    return float(shapely.area(shapely.intersection(one, other)) / least) if least else 0.0
