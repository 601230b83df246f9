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


class ObjectsNow:
    """The objects of a map that is being made.

    Attributes:
        states: as they were at the last look; never changed in place.
    """

    def __init__(self) -> None:
        self.states: ObjectStates = {}
        self._made_of: dict[int, tuple[int, float]] = {}
        self._evidence: EvidenceMap | None = None

    def look(self, evidence: EvidenceMap) -> None:
        """Look at the map now; only shapes whose evidence has changed are made again."""
        if evidence is not self._evidence:  # as when poses were corrected
            self._evidence, self._made_of = evidence, {}
        summary = evidence.summary()
        made_of = {number: (count, last_seen) for number, count, last_seen, _ in summary}
        changed = {n for n, evidence_of in made_of.items() if self._made_of.get(n) != evidence_of}
        shapes = {state.id: state for state in evidence.objects(changed)} if changed else {}
        objects: ObjectStates = {}
        for number, count, _, existence in summary:
            if number in changed:
                state = shapes[number]
                rings = polygon_rings(state.footprint)
                objects[number] = ObjectState(state.name, existence, count, rings)
            elif self.states[number].existence == existence:
                objects[number] = self.states[number]
            else:
                objects[number] = self.states[number]._replace(existence=existence)
        self.states, self._made_of = objects, made_of


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
