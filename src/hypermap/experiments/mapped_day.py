"""One day of a world that changes: the truth, the map after the drive, and what the drive saw."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.core.hypermap import Hypermap
from hypermap.core.objects import SemanticObject
from hypermap.evaluation.matching import match_objects
from hypermap.experiments.shown import Shown
from hypermap.simulation.days import Day
from hypermap.simulation.truth import true_objects
from hypermap.simulation.world import Point

LOOKED = 3
"""Frames that must show a place or a thing for it to count as looked at."""

_COVERED = 0.5  # share of a place that a frame must be able to see
_AROUND = 0.15  # [m]; radius of a place


@dataclass(frozen=True, eq=False)
class MappedDay:
    """A day, the map after its drive, and what the drive saw.

    Attributes:
        day: the truth.
        hypermap: the map.
        visible: what each mapped frame could see of the floor.
        shown: how often the drive showed each true thing, and its detections did.
    """

    day: Day
    hypermap: Hypermap
    visible: list[BaseGeometry]
    shown: Shown

    @cached_property
    def truth(self) -> list[SemanticObject]:
        """The true objects; their ids are the numbers of the things."""
        objects = true_objects(self.day.world).objects()
        pairs = zip(objects, self.day.things, strict=True)
        return [dataclasses.replace(item, id=thing) for item, thing in pairs]

    @cached_property
    def objects(self) -> list[SemanticObject]:
        """The objects of the map."""
        return self.hypermap.semantic().objects()

    @cached_property
    def id_of(self) -> dict[int, int]:
        """The id in the map of each thing that it has."""
        pairs = (
            (self.truth[match.ground_truth].id, self.objects[match.estimate].id)
            for match in match_objects(self.objects, self.truth)
        )
        return {thing: one for thing, one in pairs if thing is not None and one is not None}

    def place_of(self, thing: int) -> Point | None:
        """Return where a thing is; None if it is not there on this day."""
        if thing not in self.day.things:
            return None
        return self.day.world.objects[self.day.things.index(thing)].place

    def frames_of(self, thing: int) -> tuple[int, int]:
        """Return how many frames show a thing that is there, and how many of them detect it."""
        row = self.day.things.index(thing)
        return int(self.shown.visible[row]), int(self.shown.detected[row])

    def looked_at(self, place: Point | BaseGeometry) -> bool:
        """Return whether some frames could see a place [m]."""
        point = place if isinstance(place, BaseGeometry) else shapely.Point(place)
        spot = point.centroid.buffer(_AROUND)
        areas = np.array(self.visible, dtype=object)
        areas = areas[shapely.intersects(areas, spot)]
        shares = shapely.area(shapely.intersection(areas, spot)) / spot.area
        return int(np.count_nonzero(shares >= _COVERED)) >= LOOKED
