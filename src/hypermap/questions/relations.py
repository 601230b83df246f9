"""Relations between objects: how far apart they are, what is on what, and on which side.

All take objects in the base frame, and none is its own other.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
import shapely

from hypermap.core.arrays import BoolArray, FloatArray, IntArray, ObjectArray, as_objects
from hypermap.core.errors import HypermapError
from hypermap.core.frames import Pose2D
from hypermap.core.hypermap import FoundObject

_TOUCHING = 0.15  # [m] between what stands on a thing and that thing's top, as they are measured
_ROUNDING = 1e-6  # [m]
_AT_ONCE = 1000  # objects are compared with all others, so that memory stays bounded


class Stacks:
    """Tells which objects are on or under others in whose footprints they are, by heights."""

    def __init__(
        self, relation: str, found: Sequence[FoundObject], others: Sequence[FoundObject]
    ) -> None:
        self._relation = relation
        self._found, self._others = _heights(found), _heights(others)
        self._areas = shapely.area(footprints(found)), shapely.area(footprints(others))

    def __call__(self, at: IntArray, of: IntArray) -> BoolArray:
        """Return which of some pairs are so."""
        (low, high), (other_low, other_high) = self._found[at].T, self._others[of].T
        is_known = ~np.isnan(low + high + other_low + other_high)
        if self._relation == "under":
            if not is_known.all():
                raise HypermapError("the map does not have the heights of objects (z_min, z_max)")
            is_so: BoolArray = (high <= other_high) & (low <= other_low + _TOUCHING)
            return is_so
        smaller = self._areas[0][at] < self._areas[1][of]
        return np.where(is_known, low >= other_high - _TOUCHING, smaller)


class Sides:
    """Tells which objects are on a side of others, as someone sees these."""

    def __init__(
        self,
        relation: str,
        found: Sequence[FoundObject],
        others: Sequence[FoundObject],
        asker: Pose2D,
    ) -> None:
        self._relation = relation
        self._found = np.array([item.point_xy for item in found])
        self._others = np.array([item.point_xy for item in others])
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


def any_pair(
    found: Sequence[FoundObject],
    others: Sequence[FoundObject],
    shapes: ObjectArray,
    predicate: Any,
    distance: float | None = None,
    is_so: Callable[[IntArray, IntArray], BoolArray] | None = None,
) -> BoolArray:
    """Return for which objects a predicate holds with any of others; none is its own other.

    Args:
        found: the objects.
        others: those that they are compared with.
        shapes: of the objects.
        predicate: of shapely's STRtree.
        distance: for the predicate "dwithin" [m].
        is_so: what else must hold, for the places of objects and others.
    """
    tree = shapely.STRtree(footprints(others))
    numbers: dict[tuple[str, int | None], int] = {}
    keys, other_keys = (
        np.array([numbers.setdefault(key_of(one), len(numbers)) for one in each])
        for each in (found, others)
    )
    holds = np.zeros(len(found), dtype=bool)
    for begin in range(0, len(found), _AT_ONCE):
        part = shapes[begin : begin + _AT_ONCE]
        at, of = tree.query(part, predicate=predicate, distance=distance)
        at = at + begin
        is_other = keys[at] != other_keys[of]
        at, of = at[is_other], of[is_other]
        holds[at if is_so is None else at[is_so(at, of)]] = True
    return holds


def distances(
    found: Sequence[FoundObject], others: Sequence[FoundObject], within: float | None = None
) -> FloatArray:
    """Return how far each object is from the nearest other one [m]; infinite if there is none.

    Args:
        found: the objects.
        others: those that they are compared with.
        within: larger distances do not matter [m]; None for any.
    """
    shapes, other_shapes = footprints(found), footprints(others)
    counts = Counter(shapely.to_wkb(other_shapes).tolist())
    own = {key_of(one) for one in others}.intersection(map(key_of, found))
    far = np.full(len(found), np.inf)
    # A shape is not compared with itself; those with twins are identified by their number.
    (at, _), meters = shapely.STRtree(other_shapes).query_nearest(
        shapes,
        max_distance=None if within is None else within + _ROUNDING,
        all_matches=False,
        exclusive=bool(own),
        return_distance=True,
    )
    far[at] = meters
    if own:
        equal = [counts[shape] for shape in shapely.to_wkb(shapes).tolist()]
        has_twin = np.array(equal) > [key_of(one) in own for one in found]
        far[has_twin] = 0.0
    return far


def _heights(found: Sequence[FoundObject]) -> FloatArray:
    """Return the lowest and highest point of objects [m], shape (N, 2); NaN where unknown."""
    heights = np.full((len(found), 2), np.nan)
    for row, item in zip(heights, found, strict=True):
        values = [item.object.attributes.get(key) for key in ("z_min", "z_max")]
        if all(isinstance(value, int | float) for value in values):
            row[:] = values
    return heights


def key_of(item: FoundObject) -> tuple[str, int | None]:
    """Return what tells an object from all others."""
    return item.layer, item.object.id


def footprints(found: Iterable[FoundObject]) -> ObjectArray:
    """Return the footprints of objects, shape (N,)."""
    return as_objects([item.object.footprint for item in found])
