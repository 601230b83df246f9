"""The objects of the map at one time, and what is different at another."""

from __future__ import annotations

from typing import Any, NamedTuple, TypedDict

from hypermap.mapping.evidence import EvidenceMap
from hypermap.viewer.watch.sight import Polygons, polygons_of


class Thing(NamedTuple):
    """An object as it was at one time.

    Attributes:
        name: its class.
        existence: how sure the map is of it.
        evidence: how many observations there were of it.
        polygons: its shape [m].
    """

    name: str
    existence: float
    evidence: int
    polygons: Polygons


Things = dict[int, Thing]
"""The objects of the map at one time, by id."""


class Difference(TypedDict):
    """What makes the objects at one time of those at another, fit for JSON.

    Attributes:
        set: objects that are new or were seen: id, name, existence, evidence and polygons.
        existence: objects of which nothing else has changed: id and existence.
        gone: ids of the objects that are no longer there.
    """

    set: list[list[Any]]
    existence: list[tuple[int, float]]
    gone: list[int]


def things_of(evidence: EvidenceMap, before: Things) -> Things:
    """Return the objects of the map now.

    Args:
        evidence: what the map knows.
        before: an earlier answer; the shapes that cannot have changed since are taken from it.
    """
    summary = evidence.summary()
    changed = {number for number, count, _ in summary if not _is_known(before.get(number), count)}
    shapes = {thing.id: thing for thing in evidence.objects(changed)} if changed else {}
    things: Things = {}
    for number, count, existence in summary:
        if number in changed:
            thing = shapes[number]
            things[number] = Thing(thing.name, existence, count, polygons_of(thing.footprint))
        elif before[number].existence == existence:
            things[number] = before[number]
        else:
            things[number] = before[number]._replace(existence=existence)
    return things


def difference(before: Things, after: Things) -> Difference:
    """Return what makes `after` of `before`."""
    changes: Difference = {"set": [], "existence": [], "gone": []}
    for number, thing in after.items():
        known = before.get(number)
        if known == thing:
            continue
        if known is not None and known._replace(existence=thing.existence) == thing:
            changes["existence"].append((number, thing.existence))
        else:
            changes["set"].append([number, *thing])
    changes["gone"] = [number for number in before if number not in after]
    return changes


def changed_by(things: Things, changes: Difference) -> Things:
    """Return the objects after changes, in the order of their ids."""
    after = dict(things)
    change(after, changes)
    return dict(sorted(after.items()))


def change(things: Things, changes: Difference) -> None:
    """Change objects in place; new ones come last."""
    for number in changes["gone"]:
        things.pop(number, None)
    for number, *columns in changes["set"]:
        things[number] = Thing(*columns)
    for id_, existence in changes["existence"]:
        things[id_] = things[id_]._replace(existence=existence)


def merged(first: Difference, second: Difference) -> Difference:
    """Return the changes that are one set of changes after another.

    It costs as much as there are changes, however many objects there are. What the first adds and
    the second takes away is told as gone.
    """
    set_ = {number: [number, *columns] for number, *columns in first["set"]}
    existence = dict(first["existence"])
    gone = dict.fromkeys(first["gone"])
    for number in second["gone"]:
        set_.pop(number, None)
        existence.pop(number, None)
        gone[number] = None
    for number, *columns in second["set"]:
        existence.pop(number, None)
        gone.pop(number, None)
        set_[number] = [number, *columns]
    for id_, value in second["existence"]:
        if id_ in set_:
            name, _, *others = set_[id_][1:]
            set_[id_] = [id_, name, value, *others]
        else:
            existence[id_] = value
    return {
        "set": list(set_.values()),
        "existence": list(existence.items()),
        "gone": list(gone),
    }


def _is_known(thing: Thing | None, evidence: int) -> bool:
    return thing is not None and thing.evidence == evidence
