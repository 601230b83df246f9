"""Two published objects of one class that together are as large as others of it are one object.

A drive may see the two ends of a shelf from two aisles, so that they make two tracks. Each is
smaller than the other shelves of the map, and both together are as large as these.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
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
        may_be_one: says of two ids whether they may be one object, or frames have shown both.
        max_growth: largest area of both together, as a multiple of the median area of their class.
        fixed: ids of objects that do not change, because they were edited by hand.
    """
    usual = _usual_areas(objects)
    found = list(objects)
    while True:
        pair = _parts(found, usual, may_be_one, max_growth, fixed)
        if pair is None:
            return found
        i, j, both = pair
        found[i] = _joined(found[i], found[j], both)
        del found[j]


def _parts(
    objects: Sequence[SemanticObject],
    usual: Mapping[str, float],
    may_be_one: Callable[[int, int], bool],
    max_growth: float,
    fixed: Collection[int],
) -> tuple[int, int, BaseGeometry] | None:
    """Return the first two parts of one object, the older first, with the hull of both."""
    places = [
        n
        for n, item in enumerate(objects)
        if item.name in usual and item.id is not None and item.id not in fixed
    ]
    shapes = as_objects(objects[n].footprint for n in places)
    pairs = shapely.STRtree(shapes).query(shapes, predicate="dwithin", distance=_FARTHEST)
    for first, second in sorted(zip(*pairs.tolist(), strict=True)):
        i, j = places[first], places[second]
        one, other = objects[i], objects[j]
        if i >= j or one.name != other.name:
            continue
        area = usual[one.name]
        if min(one.footprint.area, other.footprint.area) > _SMALL * area:
            continue
        both = shapely.convex_hull(shapely.union(one.footprint, other.footprint))
        if both.area <= max_growth * area and may_be_one(cast(int, one.id), cast(int, other.id)):
            return i, j, both
    return None


def _usual_areas(objects: Sequence[SemanticObject]) -> dict[str, float]:
    """Return the median area of each class of which there are enough objects [m²]."""
    areas: dict[str, list[float]] = {}
    for item in objects:
        areas.setdefault(item.name, []).append(item.footprint.area)
    return {name: float(np.median(of)) for name, of in areas.items() if len(of) >= _ENOUGH}


def _joined(one: SemanticObject, other: SemanticObject, both: BaseGeometry) -> SemanticObject:
    mine, others = one.attributes, other.attributes
    measured = {
        "evidence": mine["evidence"] + others["evidence"],
        "z_min": min(mine["z_min"], others["z_min"]),
        "z_max": max(mine["z_max"], others["z_max"]),
    }
    return replace(one, footprint=both, attributes={**mine, **measured})
