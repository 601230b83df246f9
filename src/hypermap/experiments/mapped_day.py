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
from hypermap.perception.frame import RgbdFrame
from hypermap.simulation.days import Day
from hypermap.simulation.sightings import Sightings
from hypermap.simulation.truth import true_objects
from hypermap.simulation.world import Point

LOOKED = 3
"""Frames that must show a place or a thing for it to count as looked at."""

_COVERED = 0.5  # share of a place that a frame must be able to see
_AROUND = 0.15  # [m]; radius of a place


class Shown:
    """How many frames of a drive show each thing large enough to be detected, and near enough.

    Attributes:
        visible: frames that show it, int64, shape (N,).
        detected: of these, frames with a detection of it by its own class, int64, shape (N,).
    """

    def __init__(self, day: Day, max_range: float) -> None:
        """Prepare to count; things that are more than `max_range` [m] away do not count."""
        self._places = np.array([one.place for one in day.world.objects]).reshape(-1, 2)
        self._max_range = max_range
        self.visible, self.detected, *self._before = np.zeros((4, len(self._places)), np.int64)

    def add(self, frame: RgbdFrame, sightings: Sightings) -> None:
        """Count a frame.

        Args:
            frame: the frame.
            sightings: of the recording, up to this frame.
        """
        visible, detected = self._before
        ways = np.hypot(*(self._places - frame.map_T_camera[:2, 3]).T)
        is_near = ways <= self._max_range
        self.visible += is_near & (sightings.visible > visible)
        self.detected += is_near & (sightings.detected > detected)
        self._before = [sightings.visible.copy(), sightings.detected.copy()]


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
