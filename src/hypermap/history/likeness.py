"""How alike two shapes are, wherever they are and however they are turned."""

from __future__ import annotations

import shapely
from shapely import affinity
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import as_objects
from hypermap.core.semantic import SemanticObject
from hypermap.core.shapes import valid_copies

MIN_MOVED = 0.3
"""Meters; nearer objects of one name are the same one in the same place."""

MIN_SHIFT = 0.25
"""Meters from which on a known object of a map has moved: by 0.3 m, which maps measure to 5 cm."""

SAME_SHAPE = 0.5
"""Likeness from which on two shapes of one object are the same."""

MAY_BE = 0.3
"""Likeness from which on one object may be the other, moved."""

FARTHEST = 20.0
"""Meters that an object is moved at most."""

_FILLED = 0.85  # share of the smaller of two shapes in the other one
_TURNS = range(0, 180, 15)  # [degrees] by which it may be turned


def likeness(one: BaseGeometry, other: BaseGeometry) -> float:
    """Return the largest IoU of two shapes whose centroids coincide, over turns of one."""
    a, b = valid_copies(as_objects([one, other]))
    smaller, larger = sorted((a.area, b.area))
    if larger == 0 or smaller / larger < MAY_BE:
        return float(smaller / larger) if larger else 0.0  # no IoU is larger
    (ax, ay), (bx, by) = shapely.get_coordinates(shapely.centroid([a, b]))
    b = affinity.translate(b, ax - bx, ay - by)
    turned = as_objects(affinity.rotate(b, degrees, (ax, ay)) for degrees in _TURNS)
    shared = shapely.area(shapely.intersection(a, turned))
    return float((shared / (a.area + b.area - shared)).max())


def fills_its_place(one: BaseGeometry, other: BaseGeometry) -> bool:
    """Return whether an object still fills most of its place, or is part of what it was.

    So the end of a long shelf that was hidden before moves the centroid, but not the shelf.
    """
    shapes = valid_copies(as_objects([one, other]))
    smaller = shapely.area(shapes).min()
    return bool(shapely.area(shapely.intersection(*shapes)) >= _FILLED * smaller)


def distance_between(one: SemanticObject, other: SemanticObject) -> float:
    """Return the distance of the centroids of two objects [m]."""
    shapes = valid_copies(as_objects([one.footprint, other.footprint]))
    here, there = shapely.centroid(shapes)
    return float(shapely.distance(here, there))
