"""Two published objects of one class in one place are one object.

Poses that are a few centimeters off may make two tracks of one cup. Only after frames were made to
agree on where objects are (`landmarks`) do their footprints overlap as those of one object do.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence

import numpy as np
import shapely

from hypermap.core.arrays import as_objects
from hypermap.core.semantic import SemanticObject
from hypermap.mapping.footprint_iou import at_same_height


def without_doubles(
    objects: Sequence[SemanticObject],
    may_be_one: Callable[[int, int], bool],
    min_overlap: float,
    fixed: Collection[int] = (),
) -> list[SemanticObject]:
    """Return the objects without those that fill the place of an older one of their class.

    Args:
        objects: of a map, in the order of their ids, with the attributes `z_min` and `z_max`.
        may_be_one: says of two ids whether they may be one object, or many frames have shown both.
        min_overlap: least share of the smaller footprint that two share at the same height.
        fixed: ids of objects that do not change, because they were edited by hand.
    """
    free = [item for item in objects if item.id not in fixed]
    shapes = as_objects(item.footprint for item in free)
    first, second = shapely.STRtree(shapes).query(shapes, predicate="intersects")
    is_pair = first < second
    first, second = first[is_pair], second[is_pair]
    shared = shapely.area(shapely.intersection(shapes[first], shapes[second]))
    smaller = np.minimum(shapely.area(shapes[first]), shapely.area(shapes[second]))
    is_one = shared >= min_overlap * smaller
    doubles: set[int | None] = set()
    for i, j in zip(first[is_one].tolist(), second[is_one].tolist(), strict=True):
        one, other = free[i], free[j]
        if one.name != other.name or one.id is None or other.id is None:
            continue
        if one.id not in doubles and _same_height(one, other) and may_be_one(one.id, other.id):
            doubles.add(other.id)
    return [item for item in objects if item.id not in doubles]


def _same_height(one: SemanticObject, other: SemanticObject) -> bool:
    heights = [(item.attributes["z_min"], item.attributes["z_max"]) for item in (one, other)]
    return at_same_height(*heights)
