"""The evidence map: observed shapes become objects, which gain and lose existence.

Source: section 3.4.5 of the thesis of 2019 for the profile "thesis"; docs/mapping.md describes
both profiles.
"""

from __future__ import annotations

import dataclasses
import logging

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.mapping.association import ASSOCIATIONS, KnownShapes, Rows
from hypermap.mapping.config import EvidenceConfig
from hypermap.mapping.fusion import FUSIONS
from hypermap.mapping.pile import Evidence, Pile
from hypermap.perception.observation import Observation

_log = logging.getLogger(__name__)


@dataclasses.dataclass(eq=False)
class _Object:
    """What belongs to one object beside the columns of the map."""

    id: int
    name: str
    pile: Pile
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
        seen = [self._add(name, evidence) for name, evidence in self._usable(observation)]
        self._lose(observation, seen)
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
            (observed.name, Evidence.of(observed, observation))
            for observed, is_usable in zip(observation.objects, usable, strict=True)
            if is_usable
        ]

    def _add(self, name: str, evidence: Evidence) -> int:
        """Give evidence to the object it belongs to, old or new, and return that object's id."""
        class_ = self._classes.setdefault(name, len(self._classes))
        matches = self._associate(evidence.footprint, class_, self._known, self.config)
        if len(matches) == 0:
            row = self._append(name, class_, evidence.footprint)
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
        return self._objects[row].id

    def _append(self, name: str, class_: int, shape: BaseGeometry) -> int:
        """Add an object without evidence and return its row."""
        self._objects.append(_Object(self._next_id, name, Pile(self.config.max_evidence)))
        self._existence = np.append(self._existence, 0.0)
        self._next_id += 1
        return self._known.append(class_, shape)

    def _combine(self, rows: Rows) -> int:
        """Make one object of several, the oldest of them, and return its row."""
        row, *others = sorted(int(r) for r in rows)
        if others:
            known = self._objects[row]
            known.pile.merge(self._objects[other].pile for other in others)
            known.unfused = len(known.pile)
            self._set_existence(row, self._existence[rows].sum())
            self._remove(np.array(others))
        return row

    def _combine_with_overlapping(self, row: int) -> int:
        """Combine an object with others that its own shape matches, until there are none."""
        while True:
            shape, class_ = self._known.shapes[row], int(self._known.classes[row])
            matches = self._associate(shape, class_, self._known, self.config)
            if len(matches) <= 1:  # it matches itself
                return row
            row = self._combine(matches)
            self._renew(row)

    def _set_existence(self, rows: int | Rows, existence: float | NDArray[np.float64]) -> None:
        """Change existence, capped; rounded, so that five times 0.2 is 1 to the last digit."""
        self._existence[rows] = np.round(np.minimum(existence, self.config.max_existence), 9)

    def _renew(self, row: int) -> None:
        """Fuse an object's shape from its evidence."""
        known = self._objects[row]
        self._known.replace(row, self._fuse(known.pile, self.config))
        known.unfused = 0

    def _lose(self, observation: Observation, seen: list[int]) -> None:
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
            matched = np.array([self._objects[row].id in seen for row in losing], dtype=bool)
            losing = losing[~matched]
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
