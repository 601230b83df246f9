"""A part of a thing that is taken for something else: a bench no larger than a leaf of a plant.

A box around nothing, or with the wrong class, cuts out a part of what stands there. Where enough
frames do so, the part becomes an object of its own, inside of the thing that it is a part of. A cup
in a sink is inside of it, too; but it is as large as other cups.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.core.arrays import as_objects
from hypermap.core.semantic import SemanticObject
from hypermap.core.shapes import valid_copies

_INSIDE = 0.5  # share of its volume that is inside of another object, at least
_SMALL = 0.16  # of the volume that is usual for its class in this map, at most
_TINY = 1e-9


def without_misnamed_parts(
    objects: Sequence[SemanticObject], fixed: Collection[int] = ()
) -> list[SemanticObject]:
    """Return the objects without those that are only a part of one of another class.

    They are mostly inside of an object that has more evidence, and far smaller than others of their
    class. Nothing is known of the only object of a class, which stays.

    Args:
        objects: of a map, with the attributes `evidence`, `z_min` and `z_max`.
        fixed: ids of objects that do not change, because they were edited by hand.
    """
    free = [item for item in objects if item.id not in fixed]  # those drawn by hand have no heights
    small = _much_smaller_than_usual(free)
    if not small:
        return list(objects)
    parts = {id(free[n]) for n in small if _is_part(free[n], free)}
    return [item for item in objects if id(item) not in parts]


def _much_smaller_than_usual(objects: Sequence[SemanticObject]) -> list[int]:
    """Return which objects are far smaller than the median of the others of their class."""
    names = np.array([item.name for item in objects])
    volumes = _volumes(objects)
    found: list[int] = []
    for name in np.unique(names):
        rows = np.flatnonzero(names == name)
        for row in rows.tolist() if len(rows) > 1 else ():
            usual = np.median(volumes[rows[rows != row]])
            if volumes[row] <= _SMALL * usual:
                found.append(row)
    return found


def _volumes(objects: Sequence[SemanticObject]) -> NDArray[np.float64]:
    """Return the volumes of objects [m³], shape (N,).

    The mean side of its box is what tells a front of an object, that is thin, from a small object.
    """
    boxes = shapely.oriented_envelope(as_objects(item.footprint for item in objects))
    heights = [item.attributes["z_max"] - item.attributes["z_min"] for item in objects]
    volumes: NDArray[np.float64] = (shapely.length(boxes) / 4) ** 2 * np.array(heights)
    return volumes


def _is_part(one: SemanticObject, objects: Sequence[SemanticObject]) -> bool:
    """Return whether most of an object is inside of one of another class with more evidence."""
    (shape,) = valid_copies(as_objects([one.footprint]))
    low, high = one.attributes["z_min"], one.attributes["z_max"]
    for other in objects:
        if other.name == one.name or other.attributes["evidence"] <= one.attributes["evidence"]:
            continue
        shared = min(high, other.attributes["z_max"]) - max(low, other.attributes["z_min"])
        share = shared / max(high - low, _TINY)
        if share >= _INSIDE and shapely.intersects(shape, other.footprint):
            (whole,) = valid_copies(as_objects([other.footprint]))
            inside = shapely.area(shapely.intersection(shape, whole))
            if share * inside >= _INSIDE * shapely.area(shape):
                return True
    return False
