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
    existence: list[list[float]]
    gone: list[int]


def things_of(evidence: EvidenceMap, before: Things) -> Things:
    """Return the objects of the map now.

    Args:
        evidence: what the map knows.
        before: an earlier answer; the shapes that cannot have changed since are taken from it.
    """
    standing = evidence.standing()
    changed = {number for number, count, _ in standing if not _is_known(before.get(number), count)}
    shapes = {thing.id: thing for thing in evidence.objects(changed)} if changed else {}
    things: Things = {}
    for number, count, existence in standing:
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
            changes["existence"].append([number, thing.existence])
        else:
            changes["set"].append([number, *thing])
    changes["gone"] = [number for number in before if number not in after]
    return changes


def changed_by(things: Things, changes: Difference) -> Things:
    """Return the objects after changes, in the order of their ids."""
    after = dict(things)
    for number in changes["gone"]:
        del after[number]
    for number, *columns in changes["set"]:
        after[number] = Thing(*columns)
    for id_, existence in changes["existence"]:
        after[int(id_)] = after[int(id_)]._replace(existence=existence)
    return dict(sorted(after.items()))


def _is_known(thing: Thing | None, evidence: int) -> bool:
    return thing is not None and thing.evidence == evidence
