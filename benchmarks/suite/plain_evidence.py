"""The rules of the thesis of 2019, written down plainly with shapely.

What one would write first, without looking for speed: objects in a list, and a loop over all of
them for each shape that a frame shows. Shapely tells who shares which area, and who is covered.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.perception.observation import Observation

_MIN_JACCARD = 0.2
_GAIN, _LOSS = 1.0, 0.2
_CAP, _FORGET_BELOW, _PUBLISH_ABOVE = 20.0, -5.0, 2.0
_MAX_EVIDENCE = 1000  # as ours keeps, so that the work is the same


@dataclass(eq=False)
class PlainObject:
    """An object with all of its evidence, oldest first.

    Attributes:
        name: its class.
        shape: its best shape.
        existence: how surely it exists.
        evidence: stamps, footprints and their centroids.
    """

    name: str
    shape: BaseGeometry
    existence: float = 0.0
    evidence: list[tuple[float, BaseGeometry, tuple[float, float]]] = field(default_factory=list)

    def add(self, stamp: float, footprint: BaseGeometry) -> None:
        """Take a footprint as evidence, and choose the best shape again."""
        centroid = footprint.centroid
        self.evidence.append((stamp, footprint, (centroid.x, centroid.y)))
        del self.evidence[:-_MAX_EVIDENCE]
        centroids = np.array([place for _, _, place in self.evidence])
        offsets = centroids - centroids.mean(axis=0)
        self.shape = self.evidence[int(np.argmin((offsets**2).sum(axis=1)))][1]

    def take_over(self, other: PlainObject) -> None:
        """Become one with another object."""
        self.evidence = sorted([*self.evidence, *other.evidence], key=lambda item: item[0])
        self.existence += other.existence


class PlainEvidenceMap:
    """Objects that gain existence where they are seen, and lose it in the observed area."""

    def __init__(self) -> None:
        self._objects: list[PlainObject] = []

    def update(self, observation: Observation) -> None:
        """Learn from one frame."""
        for seen in observation.objects:
            if seen.footprint.is_valid and seen.footprint.area > 0:
                self._add(observation.stamp, seen.name, seen.footprint)
        area = observation.visible_area
        shapely.prepare(area)
        for known in self._objects:
            if area.covers(known.shape):
                known.existence = round(known.existence - _LOSS, 9)
        self._objects = [o for o in self._objects if o.existence >= _FORGET_BELOW]

    def objects(self) -> list[PlainObject]:
        """Return the objects with enough existence."""
        return [known for known in self._objects if known.existence > _PUBLISH_ABOVE]

    def _add(self, stamp: float, name: str, footprint: BaseGeometry) -> None:
        matches = [known for known in self._objects if self._is_match(known, name, footprint)]
        if not matches:
            matches = [PlainObject(name, footprint)]
            self._objects += matches
        first, *others = matches
        for other in others:
            first.take_over(other)
            self._objects.remove(other)
        first.existence = min(first.existence, _CAP)
        first.add(stamp, footprint)
        first.existence = round(min(first.existence + _GAIN, _CAP), 9)

    def _is_match(self, known: PlainObject, name: str, footprint: BaseGeometry) -> bool:
        if known.name != name or not known.shape.intersects(footprint):
            return False
        shared = known.shape.intersection(footprint).area
        together = known.shape.area + footprint.area - shared
        return bool(shared > 0 and shared / together >= _MIN_JACCARD)
