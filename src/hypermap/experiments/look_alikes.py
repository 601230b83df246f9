"""True changes as they appear: two objects that look alike cannot be distinguished."""

from __future__ import annotations

import math
from collections.abc import Sequence

from shapely.geometry import Point

from hypermap.core.history import MOVED, Change
from hypermap.history.likeness import MIN_MOVED
from hypermap.simulation.days import SAME_SIZE, ChangeKind, WorldChange, look_alike
from hypermap.simulation.world import WorldObject


def as_told(
    true: Sequence[WorldChange], said: Sequence[Change], near: float, share: float = SAME_SIZE
) -> tuple[list[WorldChange], set[int]]:
    """Return the true changes with look-alikes taken for each other as a map has taken them.

    If a chair is removed and one like it is brought, a map may as well say that it was moved. If a
    chair is moved and one like it is brought, either may be the new one; and if one comes to stand
    where another one like it stood, nothing has changed there. So the place that a thing has left
    and the place to which another one like it has come are the ends of one move, if the map says
    so or if they are the same place. All else stays.

    Args:
        true: the changes of a day.
        said: those that the map reports.
        near: how far a shape on the map may be from the place of a thing [m].
        share: by which the sizes of things that look alike differ at most.

    Returns:
        The changes, and the numbers of the things that were taken for others.
    """
    changes, mistaken = list(true), set[int]()

    def take_for_one(left: WorldChange, came: WorldChange, change: Sequence[WorldChange]) -> None:
        rest = [one for one in changes if one is not left and one is not came]
        changes[:] = [*rest, *change, *_rest(came.thing, came.before, left.after)]
        mistaken.update((left.thing, came.thing))

    while replaced := _replaced(changes, share):
        take_for_one(*replaced, [])
    for one in said:
        ends = _ends(one, changes, near, share) if one.kind == MOVED else None
        if ends is not None and ends[0] is not ends[1]:
            left, came = ends
            move = WorldChange("moved", left.thing, left.before, came.after)
            take_for_one(left, came, [move])
    return changes, mistaken


def _replaced(
    changes: Sequence[WorldChange], share: float
) -> tuple[WorldChange, WorldChange] | None:
    """Return which thing has left its place to another one like it; None if there is none."""
    for left, came in _possible_moves(changes, share):
        assert left.before is not None
        assert came.after is not None
        if left is not came and math.dist(left.before.place, came.after.place) < MIN_MOVED:
            return left, came
    return None


def _possible_moves(
    changes: Sequence[WorldChange], share: float
) -> list[tuple[WorldChange, WorldChange]]:
    """Return which changes have left a place to which, as it seems, others have come."""
    told = [change for change in changes if change.kind in ("moved", "removed", "added")]
    return [
        (left, came)
        for left in told
        for came in told
        if left.before is not None
        and came.after is not None
        and look_alike(left.before, came.after, share)
    ]


def _rest(
    thing: int, before: WorldObject | None, after: WorldObject | None
) -> Sequence[WorldChange]:
    """Return what else happened, where both ends of another move are known; none if nothing."""
    if before is None or after is None:
        kind: ChangeKind = "added" if before is None else "removed"
        return [WorldChange(kind, thing, before, after)] if before or after else []
    if math.dist(before.place, after.place) < MIN_MOVED:
        return []
    return [WorldChange("moved", thing, before, after)]


def _ends(
    said: Change, changes: Sequence[WorldChange], near: float, share: float
) -> tuple[WorldChange, WorldChange] | None:
    """Return which change has left the place where a move begins, and which came to its end."""
    assert said.before is not None  # a move has both ends
    assert said.after is not None
    found: list[tuple[bool, float, int, WorldChange, WorldChange]] = []
    for left, came in _possible_moves(changes, share):
        assert left.before is not None
        assert came.after is not None
        if left.before.label != said.object.name:
            continue
        away = max(
            said.before.footprint.distance(Point(left.before.place)),
            said.after.footprint.distance(Point(came.after.place)),
        )
        if away <= near:
            found.append((left is not came, away, len(found), left, came))
    if not found:
        return None
    *_, left, came = min(found)
    return left, came
