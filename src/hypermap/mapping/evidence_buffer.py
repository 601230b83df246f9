"""The evidence for one object: its newest observations."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from operator import attrgetter
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import ObjectArray, as_objects
from hypermap.core.embeddings import Embedding
from hypermap.core.history import EARLIEST
from hypermap.core.pictures import ObjectPicture, best_pictures
from hypermap.core.tangles import is_sound
from hypermap.mapping.columns import Column
from hypermap.mapping.joined_views import JoinedViews
from hypermap.mapping.prepared_polygon import PreparedPolygon
from hypermap.mapping.seen_areas import seen_areas
from hypermap.perception.observation import Observation, ObservedObject
from hypermap.perception.paint import Rgb

CONFIRMED = 4
"""Observations that confirm a track."""

MAPPED = 3
"""Observations from which on a track may be in the map, by the default gain and limit."""

STALE = 3600.0
"""Seconds after which a place may have changed unnoticed: in another drive, or much later."""

_ENOUGH = 3  # colors of an object in a drive
_MOST_COLORS = 12


class SeenColor(NamedTuple):
    """The color of an object in one frame.

    Attributes:
        stamp: time of the frame [s].
        rgb: the median of its pixels, sRGB, 0..255; None if they are of several colors.
    """

    stamp: float
    rgb: Rgb | None


@dataclass(frozen=True, eq=False)
class Evidence:
    """One observed shape, with the view from which it was seen.

    It keeps the camera's pose and the stamp, so that a corrected trajectory can move it.

    Attributes:
        stamp: time of the frame [s].
        map_T_camera: pose of the camera's optical frame in the map, shape (4, 4).
        prepared_area: polygon in the map frame [m] that the frame could have seen; may be empty.
        score: the detector's, 0..1.
        prepared: the footprint, a polygon in the map frame [m].
        centroid_xy: the footprint's centroid [m], shape (2,).
        z_min: height of the lowest point [m].
        z_max: height of the highest point [m].
        correction: how the recorded pose was corrected to `map_T_camera`: by x, y [m] and a
            rotation about the camera [rad]; zeros if it was not.
    """

    stamp: float
    map_T_camera: NDArray[np.float64]
    prepared_area: PreparedPolygon
    score: float
    prepared: PreparedPolygon
    centroid_xy: NDArray[np.float64]
    z_min: float
    z_max: float
    correction: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def footprint(self) -> BaseGeometry:
        """The footprint's geometry."""
        return self.prepared.geometry

    @property
    def visible_area(self) -> BaseGeometry:
        """The visible area's geometry."""
        return self.prepared_area.geometry

    @cached_property
    def seen(self) -> NDArray[np.float64]:
        """What decides on its weight and place, shape (7,).

        The score, the distance to the camera over the floor [m], and the footprint's area [m²] and
        box: xmin, ymin, xmax, ymax [m].
        """
        row: NDArray[np.float64] = _seen_of([self])[0]
        return row


def _seen_of(items: Sequence[Evidence]) -> NDArray[np.float64]:
    """Return `Evidence.seen` of some pieces, shape (N, 7)."""
    offsets = np.array([item.centroid_xy - item.map_T_camera[:2, 3] for item in items])
    shapes = [(item.score, 0.0, item.prepared.area, *item.prepared.box) for item in items]
    found = np.array(shapes, np.float64)
    found[:, 1] = np.hypot(offsets[:, 0], offsets[:, 1])
    return found


FoundEvidence: TypeAlias = list[tuple[ObservedObject, Evidence]]
"""The objects of a frame, each with its evidence."""


def evidence_from(
    observation: Observation, abstain: Literal["hidden", "outside"] = "outside"
) -> FoundEvidence:
    """Return each object of a frame whose footprint is an area, with its evidence.

    Args:
        observation: the frame.
        abstain: "outside": the frame has seen its whole visible area; "hidden": not what is hidden
            behind walls.
    """
    return evidence_from_frames([observation], abstain)[0]


def evidence_from_frames(
    observations: Sequence[Observation], abstain: Literal["hidden", "outside"] = "outside"
) -> list[FoundEvidence]:
    """Return the same as `evidence_from` for each frame, which is faster than one by one."""
    footprints = as_objects(one.footprint for each in observations for one in each.objects)
    is_usable = is_sound(footprints)
    is_usable[is_usable] = shapely.area(footprints[is_usable]) > 0
    flags = iter(is_usable.tolist())
    usable = [[one for one in each.objects if next(flags)] for each in observations]
    shown = [each for each, objects in zip(observations, usable, strict=True) if objects]
    if not shown:
        return [[] for _ in observations]
    footprints, areas = footprints[is_usable], iter(seen_areas(shown, abstain))
    centroids = shapely.get_coordinates(shapely.centroid(footprints))
    shapes = zip(PreparedPolygon.all_of(list(footprints)), centroids, strict=True)
    found = []
    for each, objects in zip(observations, usable, strict=True):
        area = next(areas) if objects else None
        found.append([(one, _evidence(each, one, *next(shapes), area)) for one in objects])
    items = [item for each in found for _, item in each]
    for item, row in zip(items, _seen_of(items), strict=True):
        vars(item)["seen"] = row
    return found


def _evidence(
    observation: Observation,
    observed: ObservedObject,
    footprint: PreparedPolygon,
    centroid_xy: NDArray[np.float64],
    area: PreparedPolygon | None,
) -> Evidence:
    assert area is not None  # each frame with objects has one
    return Evidence(
        stamp=observation.stamp,
        map_T_camera=observation.map_T_camera,
        prepared_area=area,
        score=observed.score,
        prepared=footprint,
        centroid_xy=centroid_xy,
        z_min=observed.z_min,
        z_max=observed.z_max,
        correction=observation.correction,
    )


class EvidenceBuffer:
    """The newest evidence for one object, at most `limit` pieces, and statistics of all of it.

    Attributes:
        items: the kept evidence, oldest first.
        count: number of all pieces, including dropped ones.
        score_sum: the sum of all scores.
        first_seen: the oldest stamp [s].
        last_seen: the newest stamp [s].
        pictures: of the object, best first.
        embedding: weighted mean of all views; None if none was embedded.
        colors: of the object, a few of each of the newest drives, oldest first.
    """

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._heights: tuple[float, float] | None = None
        self._top: float | None = None
        self._surely_there: tuple[float, float] | None = None
        self._agreement: tuple[PreparedPolygon, float] | None = None
        self._angle: float | None = None
        self._sizes: NDArray[np.float64] | None = None
        self._oldest, self._newest = math.inf, -math.inf  # stamps of all pieces
        self.items: list[Evidence] = []
        self._centroids = Column(np.empty((0, 2)))
        self._views: JoinedViews | None = None  # made when it is needed
        self.count = 0
        self.score_sum = 0.0
        self.first_seen = np.inf
        self.last_seen = -np.inf
        self.pictures: tuple[ObjectPicture, ...] = ()
        self.embedding: Embedding | None = None
        self.colors: tuple[SeenColor, ...] = ()

    @classmethod
    def of(
        cls,
        items: list[Evidence],
        limit: int,
        count: int,
        score_sum: float,
        first_seen: float,
        last_seen: float,
    ) -> EvidenceBuffer:
        """Return a buffer with these attributes."""
        buffer = cls(limit)
        for item in items:
            buffer.add(item)
        buffer.count, buffer.score_sum = count, score_sum
        buffer.first_seen, buffer.last_seen = first_seen, last_seen
        return buffer

    def __len__(self) -> int:
        return len(self.items)

    def copy(self) -> EvidenceBuffer:
        """Return an independent copy."""
        other = object.__new__(type(self))
        vars(other).update(vars(self))
        other.items = list(self.items)
        other._centroids = self._centroids.copy()
        other._views = None
        return other

    def add(self, evidence: Evidence) -> None:
        """Add one piece; the oldest one is dropped when the buffer is full."""
        self.items.append(evidence)
        self._centroids.append(evidence.centroid_xy)
        if self._views is not None:
            self._views.add(evidence)
        if len(self.items) > self._limit:
            del self.items[0]
            self._centroids.remove_first()
            if self._views is not None:
                self._views.remove_first()
        self._count(1, evidence.score, evidence.stamp, evidence.stamp)

    def merge(self, others: Iterable[EvidenceBuffer]) -> None:
        """Take over the evidence of other buffers, in order of time."""
        for other in others:
            self.items.extend(other.items)
            self.pictures = best_pictures([*self.pictures, *other.pictures])
            self.colors = _newest([*self.colors, *other.colors])
            if other.embedding is not None:
                self.embedding = other.embedding.plus(self.embedding)
            self._count(other.count, other.score_sum, other.first_seen, other.last_seen)
            self._oldest = min(self._oldest, other._oldest)
            self._newest = max(self._newest, other._newest)
        self.items = sorted(self.items, key=lambda evidence: evidence.stamp)[-self._limit :]
        self._centroids, self._views = Column(np.empty((0, 2))), None
        for evidence in self.items:
            self._centroids.append(evidence.centroid_xy)

    @property
    def state(self) -> tuple[object, ...]:
        """What differs after each change of the buffer, and is equal as long as there is none."""
        ends = self.items[:1], self.items[-1:], len(self.items)
        counts = self.count, self.score_sum, self.first_seen, self.last_seen
        return (*ends, *counts, self.pictures, self.colors, self.embedding)

    def lacks_colors(self, stamp: float) -> bool:
        """Return whether few of its colors are of the drive that goes on at a stamp [s]."""
        newest = self.colors[-_ENOUGH:]
        return len(newest) < _ENOUGH or stamp - newest[0].stamp > STALE

    def add_color(self, color: SeenColor) -> None:
        """Add a color; there may be enough of its drive (`lacks_colors`)."""
        self.colors = _newest([*self.colors, color])

    @property
    def has_gap(self) -> bool:
        """Whether there may be pieces of more than one drive: some are `STALE` seconds apart."""
        return self._newest - self._oldest > STALE

    @property
    def centroids(self) -> NDArray[np.float64]:
        """The centroids of the kept footprints [m], shape (N, 2)."""
        return self._centroids.values

    @property
    def views(self) -> JoinedViews:
        """The kept evidence as arrays."""
        if self._views is None:
            self._views = JoinedViews(self.items)
        return self._views

    @property
    def sizes(self) -> NDArray[np.float64]:
        """The diameter [m] and the area [m²] of each kept footprint, shape (N, 2)."""
        if self._sizes is None:
            sizes = [(item.prepared.diameter, item.prepared.area) for item in self.items]
            self._sizes = np.array(sizes, np.float64).reshape(-1, 2)
        return self._sizes

    def footprints(self) -> ObjectArray:
        """Return the kept footprints, shape (N,)."""
        return as_objects(evidence.footprint for evidence in self.items)

    def heights(self) -> tuple[float, float]:
        """Return the median lowest and highest point of the kept evidence [m]."""
        if self._heights is None:
            low = _median([evidence.z_min for evidence in self.items])
            high = _median([evidence.z_max for evidence in self.items])
            self._heights = float(low), float(high)
        return self._heights

    def top(self) -> float:
        """Return the upper quartile of the highest points of the kept evidence [m].

        Views of a part of the object may lack its top; 0 if there are none.
        """
        if self._top is None:
            tops = [evidence.z_max for evidence in self.items]
            self._top = float(np.quantile(tops, 0.75)) if tops else 0.0
        return self._top

    def agreement(self, shape: PreparedPolygon) -> float:
        """Return how far the kept footprints agree with a shape: their mean IoU with it, 0..1."""
        if not self.items:
            return 1.0
        if self._agreement is None or self._agreement[0] is not shape:
            areas = [item.prepared.area for item in self.items]
            shared = shapely.area(_shared(self.footprints(), shape.geometry))
            ious = shared / (np.array(areas) + shape.area - shared)
            self._agreement = shape, float(ious.mean())
        return self._agreement[1]

    def angle(self) -> float:
        """Return the greatest angle, seen from above, between two kept views of the object [rad].

        Directions are from the median centroid to the cameras.
        """
        if not self.items:
            return 0.0
        if self._angle is None:
            cameras = np.array([item.map_T_camera[:2, 3] for item in self.items]).reshape(-1, 2)
            offsets = cameras - np.median(self.centroids, axis=0)
            lengths = np.hypot(*offsets.T)
            is_aside = lengths > 0.01  # not above the object
            offsets = offsets[is_aside] / lengths[is_aside, np.newaxis]
            self._angle = math.acos(min(max(float((offsets @ offsets.T).min(initial=1)), -1), 1))
        return self._angle

    @property
    def surely_there(self) -> tuple[float, float]:
        """The stamps from which on and up to which there surely was an object [s].

        They are those of the first and the last observation, except for a single one in an earlier
        drive, which was not published (it often is of something else, such as a false detection),
        and for a few ones in a later drive: they may be of what has taken the object's place.
        """
        if self._surely_there is None:
            of_one_drive = self.first_seen, self.last_seen
            self._surely_there = (self._began(), self._left()) if self.has_gap else of_one_drive
        return self._surely_there

    def _began(self) -> float:
        items = self.items
        if len(items) < 2 or self.count > len(items):
            return self.first_seen
        second = items[1].stamp
        is_alone = second - items[0].stamp > STALE >= items[-1].stamp - second
        return second if is_alone else self.first_seen

    def _left(self) -> float:
        stamps = [evidence.stamp for evidence in self.items[-CONFIRMED:]]
        gaps = [i for i, (a, b) in enumerate(pairwise(stamps)) if b - a > STALE]
        return stamps[gaps[-1]] if gaps else self.last_seen

    def keep_looks(
        self,
        pictures: Sequence[ObjectPicture],
        colors: Sequence[SeenColor],
        embedding: Embedding | None,
    ) -> None:
        """Add what earlier drives have seen of the object's looks."""
        self.pictures = best_pictures([*pictures, *self.pictures])
        self.colors = _newest([*colors, *self.colors])
        if embedding is not None:
            self.embedding = embedding.plus(self.embedding)

    def since(self, first_seen: float) -> EvidenceBuffer:
        """Return a copy for an object that was first seen elsewhere, at this stamp [s]."""
        other = self.copy()
        other.first_seen, other._surely_there = first_seen, None
        return other

    def _count(self, count: int, score: float, first: float, last: float) -> None:
        self._heights = self._top = self._surely_there = None
        self._agreement = self._angle = self._sizes = None
        self._oldest, self._newest = min(self._oldest, first), max(self._newest, last)
        self.count += count
        self.score_sum += score
        if first > EARLIEST or not EARLIEST < self.first_seen < np.inf:  # a clock that was not set
            self.first_seen = min(self.first_seen, first)
        self.last_seen = max(self.last_seen, last)


def _median(numbers: list[float]) -> float:
    """Return the median, as `statistics.median` does, but in half the time."""
    numbers.sort()
    middle = len(numbers) // 2
    return numbers[middle] if len(numbers) % 2 else (numbers[middle - 1] + numbers[middle]) / 2


def _newest(colors: Iterable[SeenColor]) -> tuple[SeenColor, ...]:
    return tuple(sorted(colors, key=attrgetter("stamp"))[-_MOST_COLORS:])


def _shared(shapes: ObjectArray, shape: BaseGeometry) -> ObjectArray:
    """Return what each of some shapes shares with another one, shape (N,)."""
    try:
        shared: ObjectArray = shapely.intersection(shapes, shape)
    except shapely.GEOSException:  # outlines in a file may cross themselves
        shared = shapely.intersection(shapely.make_valid(shapes), shapely.make_valid(shape))
    return shared
