"""Two published objects of one class that together are as large as others of it are one object.

A drive may see the two ends of a shelf from two aisles, so that they make two tracks. Each is
smaller than the other shelves of the map, and both together are as large as these.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from heapq import heapify, heappop, heappush
from typing import cast

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import as_objects
from hypermap.core.semantic import SemanticObject

_FARTHEST = 0.15  # meters between two parts of one object
_SMALL = 0.75  # of the median area of the class; the smaller one of two parts is no larger
_ENOUGH = 4  # objects of a class whose median area is its usual one


def joined_parts(
    objects: Sequence[SemanticObject],
    may_be_one: Callable[[int, int], bool],
    max_growth: float,
    fixed: Collection[int] = (),
) -> list[SemanticObject]:
    """Return the objects, of which those that are parts of one object of usual size are joined.

    The older one takes in the other: its footprint is the convex hull of both.

    Args:
        objects: of a map, in the order of their ids, with the attributes `evidence`, `z_min` and
            `z_max`.
        may_be_one: says of two ids whether they may be one object, or many frames have shown both.
        max_growth: largest area of both together, as a multiple of the median area of their class.
        fixed: ids of objects that do not change, because they were edited by hand.
    """
    classes: dict[str, list[int]] = {}
    for place, item in enumerate(objects):
        classes.setdefault(item.name, []).append(place)
    found: list[SemanticObject | None] = list(objects)
    for places in classes.values():
        if len(places) < _ENOUGH:
            continue
        free = [n for n in places if objects[n].id is not None and objects[n].id not in fixed]
        usual = float(np.median([objects[n].footprint.area for n in places]))
        joined = _joined_class([objects[n] for n in free], usual, may_be_one, max_growth)
        for place, whole in zip(free, joined, strict=True):
            found[place] = whole
    return [item for item in found if item is not None]


def _joined_class(
    objects: Sequence[SemanticObject],
    usual: float,
    may_be_one: Callable[[int, int], bool],
    max_growth: float,
) -> list[SemanticObject | None]:
    """Return the objects of one class after joining, None for those that others have taken in.

    Args:
        objects: of a class, in the order of their ids.
        usual: the median area of the class [m²].
        may_be_one: as in `joined_parts`.
        max_growth: likewise.
    """
    found: list[SemanticObject | None] = list(objects)
    shapes = as_objects(item.footprint for item in objects)
    near = shapely.STRtree(shapes).query(shapes, predicate="dwithin", distance=_FARTHEST)
    pairs = [(i, j) for i, j in zip(*near.tolist(), strict=True) if i < j]
    heapify(pairs)
    while pairs:  # the first ones first; what has grown is compared again
        i, j = heappop(pairs)
        one, other = found[i], found[j]
        if one is None or other is None or min(shapely.area(shapes[[i, j]])) > _SMALL * usual:
            continue
        both = shapely.convex_hull(shapely.union(shapes[i], shapes[j]))
        if both.area > max_growth * usual or not may_be_one(*_ids(one, other)):
            continue
        found[i], found[j] = _joined(one, other, both), None
        shapes[i], shapes[j] = both, shapely.Polygon()
        for other_place in shapely.dwithin(shapes, both, _FARTHEST).nonzero()[0].tolist():
            if other_place != i:
                heappush(pairs, (min(i, other_place), max(i, other_place)))
    return found


def _ids(*objects: SemanticObject) -> list[int]:
    return [cast(int, item.id) for item in objects]


def _joined(one: SemanticObject, other: SemanticObject, both: BaseGeometry) -> SemanticObject:
    mine, others = one.attributes, other.attributes
    measured = {
        "evidence": mine["evidence"] + others["evidence"],
        "z_min": min(mine["z_min"], others["z_min"]),
        "z_max": max(mine["z_max"], others["z_max"]),
    }
    stamps = [item.last_seen for item in (one, other) if item.last_seen is not None]
    latest = max(stamps, default=None)
    return replace(one, footprint=both, last_seen=latest, attributes={**mine, **measured})
