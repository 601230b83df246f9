"""What changed between two states of one layer, object by object: equal ids are one object."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import shapely
from shapely import affinity

from hypermap.core.arrays import as_objects
from hypermap.core.history import (
    ADDED,
    CORRECTED,
    EARLIEST,
    EDITED,
    EXPIRED,
    FIRST_SEEN,
    GONE,
    MOVED,
    RENAMED,
    RESHAPED,
    Cause,
    Change,
)
from hypermap.core.objects import ObjectTable
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.core.shapes import valid_copies
from hypermap.history.expiry import expiry_of
from hypermap.history.likeness import (
    MIN_SHIFT,
    SAME_SHAPE,
    distance_between,
    fills_its_place,
    likeness,
)

MOVE = "moved"
"""The attribute in which mapping says of an object that it was moved: how likely it is that one,
`confidence`, 0..1, and the stamp from which on it was seen at its new place, `since` [s]."""

_MEASURED = {"evidence", "z_min", "z_max", "by_hand", MOVE}  # attributes that mapping writes
_TOLERANCE = 1e-6  # meters between points that are the same
_PART = 0.8  # share of an object that another one was, from which on it was part of it
_STILL_THERE = 0.5  # share of an object that is where it was, from which on it was not moved
_SAME_WHEN_EDITED = 0.9  # likeness of shapes from which on a person has moved an object


def differences(
    before: SemanticLayer | None,
    after: SemanticLayer | None,
    cause: Cause,
    now: float,
    shifts: Mapping[int, tuple[float, float]] | None = None,
) -> list[Change]:
    """Return what changed in a layer, in the order of the ids.

    Mapping always changes shapes and times a little; of its changes, only those count that
    `hypermap diff` shows. Of an edit, all count.

    Args:
        before: the layer before; None if it was not there.
        after: the layer after; None if it is not there any more.
        cause: what has changed it.
        now: in seconds since 1970; what is gone by then may have expired.
        shifts: by how much corrected poses have shifted each object, in x and y [m], by its id.
            Then mapping must say so of what was moved. None if no poses were corrected.
    """
    layer = before if after is None else after
    assert layer is not None
    old, new = (_table(one) for one in (before, after))
    if old is new:
        return []
    at = {int(number): row for row, number in enumerate(new.ids)}
    found: dict[int, Change] = {}
    for row, number in enumerate(old.ids.tolist()):
        if number not in at:
            found[number] = _left(layer.name, old.object(row), cause, now)
    was = {number: row for row, number in enumerate(old.ids.tolist())}
    known_until = float(np.fmax.reduce(old.last_seen, initial=-np.inf))
    for number, row in at.items():
        if number not in was:
            item = new.object(row)
            kind, sure = _came(item, cause, known_until), _sureness(item, cause)
            if kind == ADDED and cause == "mapping" and _was_part(item, old, new, at):
                kind = FIRST_SEEN
            found[number] = Change(kind, layer.name, None, item, confidence=sure)
    both = [number for number in at if number in was]
    rows = np.array([[was[number], at[number]] for number in both], np.int64).reshape(-1, 2)
    for i in _suspicious(old, new, rows):
        pair = old.object(int(rows[i, 0])), new.object(int(rows[i, 1]))
        if (change := _changed(layer.name, *pair, cause, shifts)) is not None:
            found[both[i]] = change
    return [found[number] for number in sorted(found)]


def _table(layer: SemanticLayer | None) -> ObjectTable:
    return ObjectTable.of([]) if layer is None else layer.table


def _suspicious(old: ObjectTable, new: ObjectTable, rows: Any) -> list[int]:
    """Return which pairs of rows may differ; comparing all of them this way is fast."""
    a, b = rows.T
    same = shapely.equals_exact(old.footprints[a], new.footprints[b], _TOLERANCE)
    same &= np.asarray(old.names[a] == new.names[b], dtype=bool)
    same &= np.asarray(old.tags[a] == new.tags[b], dtype=bool)
    same &= np.asarray(old.attributes[a] == new.attributes[b], dtype=bool)
    return np.flatnonzero(~same).tolist()


def _came(item: SemanticObject, cause: Cause, known_until: float) -> str:
    """Return the kind of change of an object that was not on the map before.

    What mapping has detected already, though too seldom for the map, was there before.

    Args:
        item: the object.
        cause: what has put it there.
        known_until: the newest stamp of the objects before [s].
    """
    if cause == "edit" or item.first_seen is None or item.first_seen < EARLIEST:
        return ADDED
    said = item.attributes.get(MOVE)
    since = said.get("since") if isinstance(said, Mapping) else None
    is_moved = isinstance(since, int | float) and since > known_until
    return FIRST_SEEN if item.first_seen <= known_until and not is_moved else ADDED


def _was_part(
    item: SemanticObject, old: ObjectTable, new: ObjectTable, at: Mapping[int, int]
) -> bool:
    """Return whether an object was part of one that still is where it was: one became two.

    Args:
        item: the object, which is not in `old`.
        old: the objects before.
        new: the objects after.
        at: their rows, by their ids.
    """
    boxes = shapely.envelope(old.footprints)
    is_like = (old.names == item.name) & shapely.intersects(boxes, item.footprint.envelope)
    for row in np.flatnonzero(is_like).tolist():
        still = at.get(int(old.ids[row]))
        if still is not None:
            whole = old.footprints[row]
            *parts, whole = valid_copies(as_objects([item.footprint, new.footprints[still], whole]))
            shared = shapely.area(shapely.intersection(parts, whole))
            if (shared >= np.array([_PART, _STILL_THERE]) * shapely.area(parts)).all():
                return True
    return False


def _left(layer: str, item: SemanticObject, cause: Cause, now: float) -> Change:
    moment = expiry_of(item)
    if moment is not None and moment <= now:
        return Change(EXPIRED, layer, item, None)
    return Change(GONE, layer, item, None, confidence=_sureness(item, cause))


def _sureness(item: SemanticObject, cause: Cause) -> float | None:
    """Return how likely it is that an object which came or went is, or was, there; None if edited.

    An object that was doubtful, and is not on the map any more, probably never was there.
    """
    return None if cause == "edit" or not item.confidence else max(item.confidence)


def _changed(
    layer: str,
    old: SemanticObject,
    new: SemanticObject,
    cause: Cause,
    shifts: Mapping[int, tuple[float, float]] | None,
) -> Change | None:
    """Return how an object changed; None if that does not count."""
    distance, may_have_moved = distance_between(old, new), True
    if shifts is not None:
        alone = distance_between(_shifted(old, shifts), new)
        may_have_moved = _is_newly_moved(old, new) and alone >= MIN_SHIFT
        distance = alone if may_have_moved else distance
    kind = _kind(old, new, distance, cause)
    if kind == MOVED and not may_have_moved:
        kind = CORRECTED
    if kind is None:
        return None
    confidence = confidence_of_move(old, new) if kind == MOVED else None
    return Change(kind, layer, old, new, distance, confidence)


def _shifted(item: SemanticObject, shifts: Mapping[int, tuple[float, float]]) -> SemanticObject:
    """Return an object where it would be at the corrected poses."""
    assert item.id is not None
    x, y = shifts.get(item.id, (0.0, 0.0))
    return replace(item, footprint=affinity.translate(item.footprint, x, y))


def _kind(old: SemanticObject, new: SemanticObject, distance: float, cause: Cause) -> str | None:
    is_edit = cause == "edit"
    if old.name != new.name:
        return RENAMED
    if not shapely.equals_exact(old.footprint, new.footprint, _TOLERANCE):
        if distance >= MIN_SHIFT and is_said_to_have_moved(old, new):
            return MOVED  # mapping has compared the evidence of both places, not one view's shapes
        alike = likeness(old.footprint, new.footprint)
        if alike < (_SAME_WHEN_EDITED if is_edit else SAME_SHAPE):
            return RESHAPED
        if is_edit or (distance >= MIN_SHIFT and not fills_its_place(old.footprint, new.footprint)):
            return MOVED
    if is_edit and (old.tags != new.tags or _free(old.attributes) != _free(new.attributes)):
        return EDITED
    return None


def _free(attributes: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in attributes.items() if key not in _MEASURED}


def confidence_of_move(old: SemanticObject, new: SemanticObject) -> float:
    """Return how likely it is that an object is the same one, as mapping has found."""
    if is_said_to_have_moved(old, new):
        value = new.attributes[MOVE].get("confidence")
        if isinstance(value, int | float):
            return float(value)
    return 1.0


def _is_newly_moved(old: SemanticObject, new: SemanticObject) -> bool:
    """Return whether an object has moved since, by a move other than that already known.

    Corrected poses change how likely a known move is.
    """
    known = old.attributes.get(MOVE)
    since = known.get("since") if isinstance(known, Mapping) else None
    return is_said_to_have_moved(old, new) and new.attributes[MOVE].get("since") != since


def is_said_to_have_moved(old: SemanticObject, new: SemanticObject) -> bool:
    """Return whether mapping has found since that an object was moved."""
    said = new.attributes.get(MOVE)
    return isinstance(said, Mapping) and said != old.attributes.get(MOVE)
