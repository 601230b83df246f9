"""The evidence map: observed shapes become objects, which gain and lose existence.

Source: section 3.4.5 of the thesis of 2019 for the profile "thesis"; docs/mapping.md describes
both profiles.
"""

from __future__ import annotations

import logging
from collections.abc import Collection

import numpy as np

from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.mapping.association import ASSOCIATIONS
from hypermap.mapping.fusion import FUSIONS
from hypermap.mapping.known import KnownObject, KnownObjects
from hypermap.mapping.known_shapes import Rows
from hypermap.mapping.look_back import later_table
from hypermap.mapping.losing import forget, lose
from hypermap.mapping.pile import Evidence, evidence_of
from hypermap.mapping.rivals import likeness
from hypermap.mapping.stages import EvidenceConfig
from hypermap.perception.observation import Observation

_log = logging.getLogger(__name__)

_WELL_KNOWN = 4  # observations from which on an object may speak against another
_SIDE_BY_SIDE = 0.2  # share of an object's frames that show another beside it, to be sure of it


class EvidenceMap:
    """Objects and the evidence for them.

    An observation's shapes are associated with known objects of their class, one after the other;
    an object's shape is fused from its evidence, and its existence grows. Then the objects that
    lie in the observed area lose some existence. Objects are published when they have enough of
    it and forgotten when they have too little.

    Attributes:
        config: how all of this is done.
        ignored: how many observed shapes were left out because they are no areas.
    """

    def __init__(self, config: EvidenceConfig) -> None:
        self.config = config
        self.ignored = 0
        self._associate = ASSOCIATIONS[config.association]
        self._fuse = FUSIONS[config.fusion]
        self._shown: set[int] = set()  # ids of the objects to which this frame has given evidence
        self._touched: dict[int, tuple[KnownObject, KnownObject]] = {}  # with what they were
        self._classes: dict[str, int] = {}
        self._known = KnownObjects(config.max_existence)

    def __len__(self) -> int:
        """Return how many objects are published."""
        return int(np.count_nonzero(self._known.existence > self.config.publish_above))

    def update(self, observation: Observation) -> None:
        """Learn from one frame, or not at all: an update that fails leaves all as it was.

        Shapes that are empty, invalid or without area are left out and counted.
        """
        before, ignored = self._known.copy(), self.ignored
        self._touched.clear()
        try:
            self._learn(observation)
        except BaseException:  # as if memory runs out
            self._known, self.ignored = before, ignored
            for known, was in self._touched.values():
                known.become(was)
            raise

    def _learn(self, observation: Observation) -> None:
        self._shown.clear()
        found = evidence_of(observation, self.config.abstain)
        if len(found) < len(observation.objects):
            self.ignored += len(observation.objects) - len(found)
            _log.info("frame %.6f: shapes without area left out", observation.stamp)
        # All are judged by what was known before the frame: their order must not matter.
        mistaken = [self._mistaken_for(name, evidence) for name, evidence in found]
        seen = {
            self._add(name, evidence) if true is None else true
            for (name, evidence), true in zip(found, mistaken, strict=True)
        }
        if self.config.exclusive:
            self._note_neighbors()
        lose(self._known, observation, seen, self.config)
        forget(self._known, self.config.forget_below)

    def objects(self, ids: Collection[int] | None = None) -> list[SemanticObject]:
        """Return the objects with enough existence, in the order of their ids.

        An object keeps its id from one call to the next; of combined objects the oldest id stays.

        Args:
            ids: which of them; None for all.
        """
        rows = self._published_rows()
        return [
            self._published(row)
            for row in rows
            if ids is None or self._known.objects[row].id in ids
        ]

    def standing(self) -> list[tuple[int, int, float]]:
        """Return id, number of pieces of evidence and existence of each object of `objects`.

        This costs little, and an object's shape changes only with its evidence.
        """
        objects, existence = self._known.objects, self._known.existence
        return [
            (objects[row].id, objects[row].pile.count, float(existence[row]))
            for row in self._published_rows()
        ]

    def layer(self, name: str = "semantic", frame_id: str = "map") -> SemanticLayer:
        """Return the objects with enough existence as a layer, with the evidence for them."""
        objects = self.objects()
        ids = {item.id for item in objects}
        kept = {o.id: tuple(o.pile.items) for o in self._known.objects if o.id in ids}
        return SemanticLayer(name, frame_id, objects, evidence=later_table(kept))

    def evidence(self, object_id: int) -> tuple[Evidence, ...]:
        """Return the kept evidence behind an object, oldest first.

        Raises:
            KeyError: If there is no such object, or it was forgotten or combined with another.
        """
        rows = self._known.rows_of([object_id])
        if not rows:
            raise KeyError(object_id)
        return tuple(self._known.objects[rows[0]].pile.items)

    def _mistaken_for(self, name: str, evidence: Evidence) -> int | None:
        """Return the id of the well-known object of another class that was really seen, if any."""
        if self.config.slip >= 1:
            return None
        class_, shapes, objects = self._classes.get(name), self._known.shapes, self._known.objects
        rows = shapes.near(None, evidence.outline.box)
        alike = likeness(evidence.outline, (evidence.z_min, evidence.z_max), shapes, rows)
        true, most = None, 0.0
        for row, likeness_of_row in zip(rows, alike, strict=True):
            if shapes.classes[row] == class_:
                if likeness_of_row >= self.config.slip / 2:
                    return None
            elif objects[row].pile.count >= _WELL_KNOWN and likeness_of_row > most:
                true, most = objects[row].id, likeness_of_row
        return true if most >= self.config.slip else None

    def _add(self, name: str, evidence: Evidence) -> int:
        """Give evidence to the object it belongs to, old or new, and return that object's id."""
        class_ = self._classes.setdefault(name, len(self._classes))
        matches = self._associate(evidence.outline, class_, self._known.shapes, self.config)
        if self.config.exclusive:
            matches = self._known.without(matches, self._shown)
        if len(matches) == 0:
            row = self._known.append(name, class_, evidence, self.config.max_evidence)
        elif self.config.combine == "matches":
            row = self._combine(matches)
        else:
            row = matches[0]
        known = self._touch(row)
        known.pile.add(evidence)
        known.unfused += 1
        gain = self.config.gain * (evidence.score if self.config.gain_by_score else 1.0)
        self._known.change_existence(row, gain)
        if known.unfused > self.config.renewal * len(known.pile):
            self._renew(row)
            if self.config.combine == "overlapping":
                row = self._combine_with_overlapping(row)
        self._shown.add(self._known.objects[row].id)
        return self._known.objects[row].id

    def _combine(self, rows: Rows) -> int:
        """Make one object of several, the oldest of them, and return its row."""
        row, *others = sorted(rows)
        if others:
            known = self._touch(row)
            known.pile.merge(self._known.objects[other].pile for other in others)
            known.unfused = len(known.pile)
            for other in others:
                self._pass_on_neighbors(self._known.objects[other], known)
            self._known.change_existence(row, float(self._known.existence[others].sum()))
            self._known.remove(others)
        return row

    def _combine_with_overlapping(self, row: int) -> int:
        """Combine an object with others that its own shape matches, until there are none."""
        while True:
            known = self._known.objects[row]
            shape, class_ = self._known.shapes.outlines[row], int(self._known.shapes.classes[row])
            matches = self._associate(shape, class_, self._known.shapes, self.config)
            if self.config.exclusive:
                objects = self._known.objects
                matches = [one for one in matches if self._may_be_one(known, objects[one])]
            if len(matches) <= 1:  # it matches itself
                return row
            row = self._combine(matches)
            self._renew(row)

    def _may_be_one(self, one: KnownObject, other: KnownObject) -> bool:
        """Return whether two objects may be combined: not those often seen side by side."""
        if one is other:
            return True
        most = max(1, _SIDE_BY_SIDE * min(one.pile.count, other.pile.count))
        return other.id not in self._shown and one.beside[other.id] <= most

    def _note_neighbors(self) -> None:
        """Remember which objects of a class this frame showed side by side."""
        shown = [self._touch(row) for row in self._known.rows_of(self._shown)]
        for known in shown:
            known.beside.update(o.id for o in shown if o is not known and o.name == known.name)

    def _pass_on_neighbors(self, gone: KnownObject, kept: KnownObject) -> None:
        """Let an object take another's place beside its neighbors, on both sides."""
        kept.beside.update(gone.beside)
        for row in self._known.rows_of(gone.beside):
            neighbor = self._known.objects[row]
            neighbor.beside[kept.id] += neighbor.beside.pop(gone.id)

    def _renew(self, row: int) -> None:
        """Fuse an object's shape from its evidence."""
        known = self._touch(row)
        self._known.shapes.replace(row, self._fuse(known.pile, self.config))
        if self.config.sight == "rays" or self.config.contested > 0:
            self._known.shapes.heights[row] = known.pile.heights()
        known.unfused = 0

    def _touch(self, row: int) -> KnownObject:
        """Return an object that is about to change, and remember what it was before this frame."""
        known = self._known.objects[row]
        if known.id not in self._touched:
            self._touched[known.id] = known, known.copy()
        return known

    def _published_rows(self) -> list[int]:
        rows: list[int] = np.flatnonzero(self._known.existence > self.config.publish_above).tolist()
        return rows

    def _published(self, row: int) -> SemanticObject:
        """Return an object as the map's users see it."""
        known = self._known.objects[row]
        pile = known.pile
        # The stale shape stays in place: asking for objects must not change what is mapped.
        is_stale = known.unfused > 0
        shape = self._fuse(pile, self.config) if is_stale else self._known.shapes.outlines[row]
        z_min, z_max = pile.heights()
        return SemanticObject(
            name=known.name,
            footprint=shape.geometry,
            id=known.id,
            tags=(known.name,),
            confidence=(pile.score_sum / pile.count,),
            existence=float(self._known.existence[row]),
            first_seen=pile.first_seen,
            last_seen=pile.last_seen,
            attributes={"evidence": pile.count, "z_min": z_min, "z_max": z_max},
        )
