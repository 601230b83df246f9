"""The evidence map: observed shapes become objects, which gain and lose existence.

Source: section 3.4.5 of the thesis of 2019 for the profile "thesis"; docs/mapping.md describes
both profiles.
"""

from __future__ import annotations

import dataclasses
import logging
from collections import Counter
from collections.abc import Callable
from functools import partial

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.mapping.association import ASSOCIATIONS, KnownShapes, Rows
from hypermap.mapping.config import EvidenceConfig
from hypermap.mapping.fusion import FUSIONS
from hypermap.mapping.pile import Evidence, Pile
from hypermap.mapping.rivals import likeness
from hypermap.mapping.sight import sights
from hypermap.perception.observation import Observation
from hypermap.perception.view import View

_log = logging.getLogger(__name__)

_WELL_KNOWN = 4  # observations from which on an object may speak against another
_VISIBLE = 0.5  # share of an object that a frame must be able to see for the object to lose
_SIDE_BY_SIDE = 0.2  # share of an object's frames that show another beside it, to be sure of it
_GONE = 0.9  # share of what can be seen of it that rays must pass for an object to be gone


@dataclasses.dataclass(eq=False)
class _Object:
    """What belongs to one object beside the columns of the map."""

    id: int
    name: str
    pile: Pile
    beside: Counter[int] = dataclasses.field(default_factory=Counter)  # frames with another, by id
    unfused: int = 0  # pieces of evidence that its shape does not know yet


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
        self._next_id = 0
        self._shown: set[int] = set()  # ids of the objects to which this frame has given evidence
        self._classes: dict[str, int] = {}
        # One row per object, in the order of their ids.
        self._objects: list[_Object] = []
        self._known = KnownShapes()
        self._existence = np.empty(0)

    def __len__(self) -> int:
        """Return how many objects are published."""
        return int(np.count_nonzero(self._existence > self.config.publish_above))

    def update(self, observation: Observation) -> None:
        """Learn from one frame.

        Shapes that are empty, invalid or without area are left out and counted.
        """
        self._shown.clear()
        seen = [self._learn(name, evidence) for name, evidence in self._usable(observation)]
        if self.config.exclusive:
            self._note_neighbors()
        if self.config.sight == "rays" and observation.view is not None:
            self._lose_in_view(observation.view, seen)
        else:
            self._lose_in_area(observation, seen)
        if self.config.contested > 0:
            self._lose_contested(seen)
        self._forget()

    def objects(self) -> list[SemanticObject]:
        """Return the objects with enough existence, in the order of their ids.

        An object keeps its id from one call to the next; of combined objects the oldest id stays.
        """
        published = np.flatnonzero(self._existence > self.config.publish_above)
        return [self._published(int(row)) for row in published]

    def layer(self, name: str = "semantic", frame_id: str = "map") -> SemanticLayer:
        """Return the objects with enough existence as a layer."""
        return SemanticLayer(name, frame_id, self.objects())

    def evidence(self, object_id: int) -> tuple[Evidence, ...]:
        """Return the kept evidence behind an object, oldest first.

        Raises:
            KeyError: If there is no such object, or it was forgotten or combined with another.
        """
        for known in self._objects:
            if known.id == object_id:
                return tuple(known.pile.items)
        raise KeyError(object_id)

    def _usable(self, observation: Observation) -> list[tuple[str, Evidence]]:
        """Return name and evidence of each observed shape that is an area."""
        shapes = np.array([observed.footprint for observed in observation.objects], dtype=object)
        usable = shapely.is_valid(shapes)
        usable[usable] = shapely.area(shapes[usable]) > 0
        if not usable.all():
            self.ignored += int(np.count_nonzero(~usable))
            _log.info("frame %.6f: shapes without area left out", observation.stamp)
        return [
            (observed.name, Evidence.of(observed, observation, self.config.abstain))
            for observed, is_usable in zip(observation.objects, usable, strict=True)
            if is_usable
        ]

    def _learn(self, name: str, evidence: Evidence) -> int:
        """Return the id of the object that was seen; it gains, unless its name was a slip."""
        class_ = self._classes.setdefault(name, len(self._classes))
        if self.config.slip < 1 and (true := self._mistaken_for(class_, evidence)) is not None:
            return true
        return self._add(name, evidence)

    def _mistaken_for(self, class_: int, evidence: Evidence) -> int | None:
        """Return the id of the well-known object of another class that was really seen, if any."""
        rows = self._known.near(None, shapely.bounds(evidence.footprint))
        heights = evidence.z_min, evidence.z_max
        alike = likeness(evidence.footprint, heights, self._known, rows)
        is_same = self._known.classes[rows] == class_
        if np.any(alike[is_same] >= self.config.slip / 2):
            return None
        counts = np.array([self._objects[row].pile.count for row in rows])
        alike[is_same | (counts < _WELL_KNOWN)] = 0
        if not np.any(alike >= self.config.slip):
            return None
        return self._objects[int(rows[np.argmax(alike)])].id

    def _add(self, name: str, evidence: Evidence) -> int:
        """Give evidence to the object it belongs to, old or new, and return that object's id."""
        class_ = self._classes.setdefault(name, len(self._classes))
        matches = self._associate(evidence.footprint, class_, self._known, self.config)
        if self.config.exclusive:
            matches = self._filter(matches, lambda known: known.id not in self._shown)
        if len(matches) == 0:
            row = self._append(name, class_, evidence)
        elif self.config.combine == "matches":
            row = self._combine(matches)
        else:
            row = int(matches[0])
        known = self._objects[row]
        known.pile.add(evidence)
        known.unfused += 1
        gain = self.config.gain * (evidence.score if self.config.gain_by_score else 1.0)
        self._set_existence(row, self._existence[row] + gain)
        if known.unfused > self.config.renewal * len(known.pile):
            self._renew(row)
            if self.config.combine == "overlapping":
                row = self._combine_with_overlapping(row)
        self._shown.add(self._objects[row].id)
        return self._objects[row].id

    def _append(self, name: str, class_: int, evidence: Evidence) -> int:
        """Add an object without evidence and return its row."""
        self._objects.append(_Object(self._next_id, name, Pile(self.config.max_evidence)))
        self._existence = np.append(self._existence, 0.0)
        self._next_id += 1
        return self._known.append(class_, evidence.footprint, (evidence.z_min, evidence.z_max))

    def _combine(self, rows: Rows) -> int:
        """Make one object of several, the oldest of them, and return its row."""
        row, *others = sorted(int(r) for r in rows)
        if others:
            known = self._objects[row]
            known.pile.merge(self._objects[other].pile for other in others)
            known.unfused = len(known.pile)
            for other in others:
                known.beside.update(self._objects[other].beside)
            self._set_existence(row, self._existence[rows].sum())
            self._remove(np.array(others))
        return row

    def _combine_with_overlapping(self, row: int) -> int:
        """Combine an object with others that its own shape matches, until there are none."""
        while True:
            shape, class_ = self._known.shapes[row], int(self._known.classes[row])
            matches = self._associate(shape, class_, self._known, self.config)
            if self.config.exclusive:
                matches = self._filter(matches, partial(self._may_be_one, self._objects[row]))
            if len(matches) <= 1:  # it matches itself
                return row
            row = self._combine(matches)
            self._renew(row)

    def _may_be_one(self, one: _Object, other: _Object) -> bool:
        """Return whether two objects may be combined: not those often seen side by side."""
        if one is other:
            return True
        most = max(1, _SIDE_BY_SIDE * min(one.pile.count, other.pile.count))
        return other.id not in self._shown and one.beside[other.id] <= most

    def _note_neighbors(self) -> None:
        """Remember which objects of a class this frame showed side by side."""
        shown = [self._objects[row] for row in self._rows_of(self._shown)]
        for known in shown:
            known.beside.update(o.id for o in shown if o is not known and o.name == known.name)

    def _filter(self, rows: Rows, keep: Callable[[_Object], bool]) -> Rows:
        kept = [keep(self._objects[row]) for row in rows]
        return np.asarray(rows[np.array(kept, dtype=bool)])

    def _set_existence(self, rows: int | Rows, existence: float | NDArray[np.float64]) -> None:
        """Change existence, capped; rounded, so that five times 0.2 is 1 to the last digit."""
        self._existence[rows] = np.round(np.minimum(existence, self.config.max_existence), 9)

    def _renew(self, row: int) -> None:
        """Fuse an object's shape from its evidence."""
        known = self._objects[row]
        self._known.replace(row, self._fuse(known.pile, self.config))
        if self.config.sight == "rays" or self.config.contested > 0:
            self._known.heights[row] = known.pile.heights()
        known.unfused = 0

    def _lose_in_view(self, view: View, seen: list[int]) -> None:
        """Take existence from the objects that the rays should have shown."""
        boxes = self._known.boxes
        offsets = (boxes[:, :2] + boxes[:, 2:]) / 2 - view.position[:2]
        rows = self._unmatched(np.flatnonzero(np.hypot(*offsets.T) <= self.config.max_range), seen)
        shapes = shapely.convex_hull(self._known.shapes[rows])
        visible, through = sights(view, shapes, self._known.heights[rows], self.config.tolerance)
        losses = np.where(through >= _GONE * visible, self.config.gone_loss, self.config.loss)
        is_visible = visible >= _VISIBLE
        rows, losses = rows[is_visible], losses[is_visible]
        self._set_existence(rows, self._existence[rows] - losses)

    def _lose_contested(self, seen: list[int]) -> None:
        """Take existence from the objects in whose place the frame shows another class."""
        for row in self._rows_of(set(seen)):
            near = self._unmatched(self._known.near(None, self._known.boxes[row]), seen)
            near = near[self._known.classes[near] != self._known.classes[row]]
            heights = self._known.heights[row]
            shape = self._known.shapes[row]
            alike = likeness(shape, (heights[0], heights[1]), self._known, near)
            losing = near[alike >= self.config.min_contested]
            self._set_existence(losing, self._existence[losing] - self.config.contested)

    def _rows_of(self, ids: set[int]) -> list[int]:
        return [row for row, known in enumerate(self._objects) if known.id in ids]

    def _unmatched(self, rows: Rows, seen: list[int]) -> Rows:
        """Return the rows of the objects that the frame did not show."""
        return self._filter(rows, lambda known: known.id not in seen)

    def _lose_in_area(self, observation: Observation, seen: list[int]) -> None:
        """Take existence from the objects that lie within the observed area."""
        area = observation.visible_area
        if self.config.margin > 0:
            area = shapely.buffer(area, -self.config.margin, join_style="mitre")
        if area.is_empty:
            return
        boxes, limits = self._known.boxes, shapely.bounds(area)
        centers = (boxes[:, :2] + boxes[:, 2:]) / 2
        distances = np.hypot(*(centers - observation.map_T_camera[:2, 3]).T)
        rows = np.flatnonzero(
            (boxes[:, :2] >= limits[:2]).all(axis=1)
            & (boxes[:, 2:] <= limits[2:]).all(axis=1)
            & (distances <= self.config.max_range)
        )
        shapely.prepare(area)
        losing = rows[shapely.covers(area, self._known.shapes[rows])]
        if self.config.loses == "unmatched":
            losing = self._unmatched(losing, seen)
        self._set_existence(losing, self._existence[losing] - self.config.loss)

    def _forget(self) -> None:
        """Remove the objects that have lost too much."""
        forgotten = np.flatnonzero(self._existence < self.config.forget_below)
        if len(forgotten):
            self._remove(forgotten)

    def _remove(self, rows: Rows) -> None:
        """Remove some objects from all columns."""
        for row in sorted(rows, reverse=True):
            del self._objects[row]
        self._known.remove(rows)
        self._existence = np.delete(self._existence, rows)

    def _published(self, row: int) -> SemanticObject:
        """Return an object as the map's users see it."""
        known = self._objects[row]
        pile = known.pile
        # The stale shape stays in place: asking for objects must not change what is mapped.
        shape = self._fuse(pile, self.config) if known.unfused else self._known.shapes[row]
        z_min, z_max = pile.heights()
        return SemanticObject(
            name=known.name,
            footprint=shape,
            id=known.id,
            tags=(known.name,),
            confidence=(pile.score_sum / pile.count,),
            existence=float(self._existence[row]),
            first_seen=pile.first_seen,
            last_seen=pile.last_seen,
            attributes={"evidence": pile.count, "z_min": z_min, "z_max": z_max},
        )
