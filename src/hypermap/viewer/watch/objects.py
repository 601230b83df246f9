"""The objects of the map at each step, and the differences between steps."""

from __future__ import annotations

from typing import Any, NamedTuple, TypedDict

from hypermap.mapping.evidence import EvidenceMap
from hypermap.viewer.watch.observation import Polygons, polygon_rings


class ObjectState(NamedTuple):
    """The state of an object at one step.

    Attributes:
        name: its class.
        existence: how surely it is real.
        evidence: how many observations there were of it.
        polygons: its shape [m].
    """

    name: str
    existence: float
    evidence: int
    polygons: Polygons


ObjectStates = dict[int, ObjectState]
"""The objects of the map at one step, by id."""


class Difference(TypedDict):
    """The difference between the objects of two steps, ready for JSON.

    Attributes:
        set: objects that are new or were seen: id, name, existence, evidence and polygons.
        existence: objects of which nothing else has changed: id and existence.
        removed: ids of the objects that no longer exist.
    """

    set: list[list[Any]]
    existence: list[tuple[int, float]]
    removed: list[int]


def object_states(evidence: EvidenceMap, before: ObjectStates) -> ObjectStates:
    """Return the objects of the map now.

    Args:
        evidence: what the map knows.
        before: an earlier answer; the shapes that cannot have changed since are taken from it.
    """
    summary = evidence.summary()
    changed = {number for number, count, _ in summary if not _is_known(before.get(number), count)}
    shapes = {state.id: state for state in evidence.objects(changed)} if changed else {}
    objects: ObjectStates = {}
    for number, count, existence in summary:
        if number in changed:
            state = shapes[number]
            objects[number] = ObjectState(
                state.name, existence, count, polygon_rings(state.footprint)
            )
        elif before[number].existence == existence:
            objects[number] = before[number]
        else:
            objects[number] = before[number]._replace(existence=existence)
    return objects


def difference(before: ObjectStates, after: ObjectStates) -> Difference:
    """Return the difference that turns `before` into `after`."""
    changes: Difference = {"set": [], "existence": [], "removed": []}
    for number, state in after.items():
        known = before.get(number)
        if known == state:
            continue
        if known is not None and known._replace(existence=state.existence) == state:
            changes["existence"].append((number, state.existence))
        else:
            changes["set"].append([number, *state])
    changes["removed"] = [number for number in before if number not in after]
    return changes


def changed_by(objects: ObjectStates, changes: Difference) -> ObjectStates:
    """Return the objects after changes, in the order of their ids."""
    after = dict(objects)
    change(after, changes)
    return dict(sorted(after.items()))


def change(objects: ObjectStates, changes: Difference) -> None:
    """Change objects in place; new ones come last."""
    for number in changes["removed"]:
        objects.pop(number, None)
    for number, *columns in changes["set"]:
        objects[number] = ObjectState(*columns)
    for id_, existence in changes["existence"]:
        objects[id_] = objects[id_]._replace(existence=existence)


def merged(first: Difference, second: Difference) -> Difference:
    """Return the difference that equals one difference after another.

    The cost depends on the number of changes, not of objects. What the first one adds and the
    second one removes is listed as removed.
    """
    set_ = {number: [number, *columns] for number, *columns in first["set"]}
    existence = dict(first["existence"])
    removed = dict.fromkeys(first["removed"])
    for number in second["removed"]:
        set_.pop(number, None)
        existence.pop(number, None)
        removed[number] = None
    for number, *columns in second["set"]:
        existence.pop(number, None)
        removed.pop(number, None)
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
        "removed": list(removed),
    }


def _is_known(state: ObjectState | None, evidence: int) -> bool:
    return state is not None and state.evidence == evidence
