"""Relations between objects: what is on what, on which side, and what meets what.

All take objects in the base frame, and none is its own other.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import BoolArray, FloatArray, IntArray, ObjectArray
from hypermap.core.errors import HypermapError
from hypermap.core.frames import Pose2D
from hypermap.core.hypermap import Matches
from hypermap.questions.sizes import height_of

NO_HEIGHTS = "the map does not have the heights of objects (z_min, z_max)"

_TOUCHING = 0.15  # [m] between an object and the top of the one below it, as measured
_FIRST, _MORE = 16, 7  # others that objects are compared with at first, and how many times more
_AT_ONCE = 1_000_000  # pairs at most, so that memory stays bounded
_MOST = 4_000_000  # pairs of objects that are compared for a question, in some seconds
_MOST_BOXES = 40_000_000  # pairs of which only the bounding boxes are
_ROUNDED = 1 + 1e-9  # share by which distances of boxes are rounded at most


class Stacks:
    """Tells which objects are on or under others in whose footprints they are, by heights."""

    def __init__(self, relation: str, found: Matches, others: Matches) -> None:
        self._relation = relation
        self._heights = heights_of(found), heights_of(others)
        self._areas = shapely.area(found.shapes), shapely.area(others.shapes)

    def __call__(self, at: IntArray, of: IntArray) -> BoolArray:
        """Return which of some pairs are so."""
        low, high = self._heights[0][at].T
        other_low, other_high = self._heights[1][of].T
        is_known = ~np.isnan(low + high + other_low + other_high)
        if self._relation == "under":
            if not is_known.all():
                raise HypermapError(NO_HEIGHTS)
            is_so: BoolArray = (high <= other_high) & (low <= other_low + _TOUCHING)
            return is_so
        smaller = self._areas[0][at] < self._areas[1][of]
        return np.where(is_known, low >= other_high - _TOUCHING, smaller)


class Sides:
    """Tells which objects are on a side of others, as someone sees these."""

    def __init__(self, relation: str, found: Matches, others: Matches, asker: Pose2D) -> None:
        self._relation = relation
        self._found, self._others = found.centroids, others.centroids
        self._asker_xy = np.array([asker.x, asker.y])

    def __call__(self, at: IntArray, of: IntArray) -> BoolArray:
        """Return which of some pairs are so."""
        ahead = self._others[of] - self._asker_xy
        offset = self._found[at] - self._others[of]
        behind = (ahead * offset).sum(axis=1)
        left = ahead[:, 0] * offset[:, 1] - ahead[:, 1] * offset[:, 0]
        sides = {"left of": left, "right of": -left, "behind": behind, "in front of": -behind}
        most = np.maximum(np.abs(left), np.abs(behind))
        is_so: BoolArray = (sides[self._relation] > 0) & (sides[self._relation] >= most)
        return is_so


class SidesOfAsker:
    """Tells which objects are on a side of someone, by where the nearest point of each is."""

    def __init__(self, relation: str, found: Matches, asker: Pose2D) -> None:
        self._relation, self._asker = relation, asker
        self._shapes, self._middles = found.shapes, found.centroids

    def __call__(self, at: IntArray, of: IntArray) -> BoolArray:  # noqa: ARG002
        """Return which of some pairs with the asker's place are so."""
        place = shapely.Point(self._asker.x, self._asker.y)
        ways = np.asarray(shapely.shortest_line(place, self._shapes[at]))
        nearest = shapely.get_coordinates(shapely.get_point(ways, 1))
        is_around = shapely.length(ways) == 0  # the asker stands on it
        nearest[is_around] = self._middles[at[is_around]]
        x, y = (nearest - (self._asker.x, self._asker.y)).T
        c, s = np.cos(self._asker.yaw), np.sin(self._asker.yaw)
        ahead, left = c * x + s * y, c * y - s * x
        sides = {"left of": left, "right of": -left, "in front of": ahead, "behind": -ahead}
        most = np.maximum(np.abs(ahead), np.abs(left))
        is_so: BoolArray = (sides[self._relation] > 0) & (sides[self._relation] >= most)
        return is_so


def any_pair(
    found: Matches,
    others: Matches,
    shapes: ObjectArray,
    predicate: Any,
    distance: float | None = None,
    is_so: Callable[[IntArray, IntArray], BoolArray] | None = None,
    most: int = _MOST,
) -> BoolArray:
    """Return for which objects a predicate holds with any of others; none is its own other.

    Args:
        found: the objects.
        others: those that they are compared with.
        shapes: of the objects.
        predicate: of shapely's STRtree; None compares bounding boxes alone.
        distance: for the predicate "dwithin" [m].
        is_so: what else must hold, for the places of objects and others.
        most: pairs that are compared.

    Raises:
        HypermapError: If too many pairs would have to be compared.
    """
    holds = np.zeros(len(found), dtype=bool)
    order = np.random.default_rng(0).permutation(len(others))  # so that most find one soon
    begin = count = 0
    while begin < len(order):
        some = order[begin : begin + max(_FIRST, _MORE * begin)]
        tree, left = shapely.STRtree(others.shapes[some]), np.flatnonzero(~holds)
        for rows in np.split(left, range(0, len(left), max(1, _AT_ONCE // len(some)))[1:]):
            part = shapes[rows]
            if predicate is not None:  # prepares them, and threads must not share prepared ones
                part = shapely.force_2d(part)
            at, of = tree.query(part, predicate=predicate, distance=distance)
            at, of = rows[at], some[of]
            count += len(at)
            _check_few(count, most)
            is_other = found.keys[at] != others.keys[of]
            at, of = at[is_other], of[is_other]
            holds[at if is_so is None else at[is_so(at, of)]] = True
        begin += len(some)
    return holds


def are_near(found: Matches, others: Matches, within: float) -> BoolArray:
    """Return which objects are within a distance [m] of another one, not itself, shape (N,).

    Raises:
        HypermapError: If too many pairs would have to be compared.
    """
    ends, other_ends = shapely.bounds(found.shapes), shapely.bounds(others.shapes)
    x0, y0, x1, y1 = ends.T
    boxes = np.asarray(shapely.box(x0 - within, y0 - within, x1 + within, y1 + within))
    count = 0

    def is_near(at: IntArray, of: IntArray) -> BoolArray:
        nonlocal count
        gaps = np.maximum(ends[at, :2] - other_ends[of, 2:], other_ends[of, :2] - ends[at, 2:])
        near: BoolArray = np.hypot(*np.maximum(gaps, 0).T) <= within * _ROUNDED
        rows = np.flatnonzero(near)
        count += len(rows)
        _check_few(count, _MOST)
        near[rows] = shapely.dwithin(found.shapes[at[rows]], others.shapes[of[rows]], within)
        return near

    return any_pair(found, others, boxes, None, is_so=is_near, most=_MOST_BOXES)


def _check_few(count: int, most: int) -> None:
    """Raise a HypermapError if there are too many pairs."""
    if count > most:
        raise HypermapError(
            f"more than {most:,} pairs of objects would have to be compared; ask about "
            "fewer objects, as those in one room, or a smaller distance"
        )


def are_carrying(found: Matches, others: Matches) -> BoolArray:
    """Return which objects have another one on them, its middle in their footprint, (N,)."""
    on = Stacks("on", others, found)
    middles: ObjectArray = np.asarray(shapely.points(others.centroids))

    def is_so(at: IntArray, of: IntArray) -> BoolArray:
        carried: BoolArray = shapely.intersects(found.shapes[at], middles[of]) & on(of, at)
        return carried

    return any_pair(found, others, found.shapes, "intersects", is_so=is_so)


def are_between(found: Matches, one: BaseGeometry, other: BaseGeometry) -> BoolArray:
    """Return which objects are between two shapes, and not on one of them, shape (N,).

    Their middles lie in the convex hull of both, or they are on the straight line between the
    middles of these, as what is in the way of someone who goes from one to the other.
    """
    both = [shapely.convex_hull(one), shapely.convex_hull(other)]
    hull = shapely.convex_hull(shapely.GeometryCollection(both))
    middles: ObjectArray = np.asarray(shapely.points(found.centroids))
    line = shapely.LineString([both[0].centroid, both[1].centroid])
    gap = line.difference(both[0]).difference(both[1])
    for shape in (hull, *both):
        shapely.prepare(shape)
    is_inside = shapely.intersects(hull, middles)
    is_inside &= ~shapely.intersects(both[0], middles) & ~shapely.intersects(both[1], middles)
    between: BoolArray = is_inside | shapely.intersects(gap, found.shapes)
    return between


def heights_of(found: Matches) -> FloatArray:
    """Return the lowest and highest point of each object [m], shape (N, 2); NaN where unknown."""
    heights = np.full((len(found), 2), np.nan)
    if (found.keys < 0).any():  # places of the question
        return heights
    for row, own in zip(heights, found.column("attributes"), strict=True):
        row[:] = [height_of(own.get(key)) for key in ("z_min", "z_max")]
    return heights
