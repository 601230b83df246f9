"""Why a map did not tell a change, or told a wrong one: the stage at which it went wrong."""

from __future__ import annotations

import math
from collections.abc import Mapping

import shapely

from hypermap.core.history import ADDED, GONE, Change
from hypermap.core.objects import SemanticObject
from hypermap.experiments.mapped_day import LOOKED, MappedDay
from hypermap.history.likeness import MIN_MOVED
from hypermap.simulation.days import WorldChange

CAUSES: Mapping[str, str] = {
    "out of sight": "fewer than 3 frames of a drive show the thing, large enough to be detected",
    "not detected": "of the frames that show it, fewer than 2 of a drive detect it",
    "not in the map": "2 frames or more detect it, but the map after that drive lacks it",
    "still in the map": "the map still has the object at the place that the thing has left",
    "not matched": "both maps have the thing, as two objects; the first one is gone",
    "another thing": "the object became one of another thing",
    "same place": "both maps have the thing as one object, but its place or shape is wrong",
    "double": "a second object of one thing",
    "another class": "an object of another class at the place of a thing",
    "ghost": "an object where there is no thing",
    "real": "the thing changed like this, but the report does not count, or its place is wrong",
}
"""What the causes mean, in the order of the stages."""

_NEAR = 0.5  # [m] between an object and the thing that it shows


def cause_of_missed(change: WorldChange, before: MappedDay, after: MappedDay) -> str:
    """Return why a map does not tell a true change."""
    thing = change.thing
    if change.before is not None and thing not in before.id_of:
        return _why_unknown(thing, before)
    if change.after is not None and thing not in after.id_of:
        return _why_unknown(thing, after)
    if change.before is None:
        return "another thing" if after.id_of[thing] in _ids(before) else "real"
    object_id = before.id_of[thing]
    if change.after is not None and after.id_of[thing] == object_id:
        return "same place"
    if object_id not in _ids(after):
        return "not matched" if change.after is not None else "real"
    is_there = _distance(_object(after, object_id), _object(before, object_id)) < MIN_MOVED
    return "still in the map" if is_there else "another thing"


def cause_of_wrong(said: Change, before: MappedDay, after: MappedDay) -> str:
    """Return why a map tells a change that is none, or another one."""
    if said.kind == ADDED:
        return _cause_of_end(said.object, after, before, after)
    if said.kind == GONE:
        return _cause_of_end(said.object, before, before, after)
    assert said.before is not None  # a move has both ends
    assert said.after is not None
    things = _thing_of(said.before, before), _thing_of(said.after, after)
    for thing, item, day in zip(things, (said.before, said.after), (before, after), strict=True):
        if thing is None:
            return _why_no_thing(item, day)
    if things[0] != things[1]:
        return "another thing"
    assert things[0] is not None
    return "same place" if _is_unmoved(things[0], before, after) else "real"


def _cause_of_end(item: SemanticObject, day: MappedDay, before: MappedDay, after: MappedDay) -> str:
    """Return why an object seems to have come or gone, which only one of two maps has.

    Args:
        item: the object.
        day: whose map has it.
        before: the day before the change.
        after: the day after.
    """
    thing, other = _thing_of(item, day), before if day is after else after
    if thing is None:
        return _why_no_thing(item, day)
    here, there = day.place_of(thing), other.place_of(thing)
    if here is None or there is None:
        return "real"
    if thing not in other.id_of:
        return _why_unknown(thing, other)
    if _is_unmoved(thing, before, after):
        return "not matched"
    is_left = before.id_of[thing] in _ids(after)
    return "still in the map" if is_left else "not matched"


def _is_unmoved(thing: int, before: MappedDay, after: MappedDay) -> bool:
    was, now = before.place_of(thing), after.place_of(thing)
    return was is not None and now is not None and math.dist(was, now) < MIN_MOVED


def _why_unknown(thing: int, day: MappedDay) -> str:
    """Return why a map lacks a thing."""
    shown, detected = day.frames_of(thing)
    if shown < LOOKED:
        return "out of sight"
    return "not detected" if detected < 2 else "not in the map"


def _why_no_thing(item: SemanticObject, day: MappedDay) -> str:
    """Return what an object is that stands for no thing."""
    near = {
        thing.name
        for thing in day.truth
        if shapely.distance(thing.footprint, item.footprint) <= _NEAR
    }
    if item.name in near:
        return "double"
    is_covered = any(thing.footprint.intersects(item.footprint) for thing in day.truth)
    return "another class" if is_covered else "ghost"


def _thing_of(item: SemanticObject, day: MappedDay) -> int | None:
    """Return which thing an object of a day's map stands for; None for none."""
    return next((thing for thing, one in day.id_of.items() if one == item.id), None)


def _ids(day: MappedDay) -> set[int | None]:
    return {item.id for item in day.objects}


def _object(day: MappedDay, number: int) -> SemanticObject:
    return next(item for item in day.objects if item.id == number)


def _distance(one: SemanticObject, other: SemanticObject) -> float:
    return float(shapely.distance(one.footprint.centroid, other.footprint.centroid))
