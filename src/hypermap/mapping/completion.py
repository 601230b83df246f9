"""Amodal completion: give objects seen from one side the usual depth of their class.

A shelf between two others shows only its front, so its footprint is a strip that hardly overlaps
with the true one. The missing part is behind the visible one, away from the cameras.

Source: completion by knowledge of the class, as in Kar, Tulsiani, Carreira, Malik, "Amodal
completion and size constancy in natural scenes", ICCV 2015; here on the floor.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import affinity
from shapely.geometry.base import BaseGeometry

from hypermap.core.evidence import is_one_sided, mean_view
from hypermap.core.occupancy import FREE, OccupancyLayer

FreeShare = Callable[[BaseGeometry], float]
"""Returns how much of an area on the floor is known to be free, 0..1."""

# Usual minimum depth of bulky objects, from front to back [m]. Low and small ones need none, as the
# camera also sees their top: completion makes the shape of a cup worse.
CLASS_DEPTHS: Mapping[str, float] = MappingProxyType(
    {
        "bed": 1.9,
        "bench": 0.4,
        "bookshelf": 0.3,
        "box": 0.35,
        "cabinet": 0.45,
        "couch": 0.85,
        "cupboard": 0.45,
        "desk": 0.7,
        "diningtable": 0.8,
        "dishwasher": 0.6,
        "microwave": 0.35,
        "oven": 0.6,
        "person": 0.25,
        "plant": 0.35,
        "pottedplant": 0.35,
        "refrigerator": 0.6,
        "shelf": 0.5,
        "sink": 0.5,
        "sofa": 0.85,
        "table": 0.7,
        "wardrobe": 0.6,
    }
)
_STEP = 0.05  # meters
_MOST_FREE = 0.5  # share of a step that may be known free space
_WORTH = 0.02  # meters; a smaller missing part is ignored


def completed(
    shape: BaseGeometry,
    name: str,
    cameras_xy: NDArray[np.float64],
    is_free: FreeShare | None = None,
    class_depths: Mapping[str, float] = MappingProxyType({}),
) -> BaseGeometry:
    """Return a shape, extended to the usual depth of its class if it was seen from one side.

    Args:
        shape: of the object in the map frame [m].
        name: its class. Shapes of classes without a known depth stay as they are.
        cameras_xy: positions from which it was seen [m], shape (N, 2).
        is_free: returns the known free share of an area, into which shapes do not grow; None if
            nothing is known to be free.
        class_depths: depths of classes in place of those of `CLASS_DEPTHS` [m]; 0 for none.
    """
    depth = _depth_of(name, class_depths)
    if not depth or shape.geom_type != "Polygon" or shape.is_empty:
        return shape
    center = shapely.get_coordinates(shapely.centroid(shape))[0]
    if not is_one_sided(center, cameras_xy):
        return shape
    away, extent = _along(shape, mean_view(center, cameras_xy))
    more = depth - extent
    if more < _WORTH or not np.isfinite(away).all():
        return shape
    if is_free is not None:
        more = _room_behind(shape, away, more, is_free)
    return _swept(shape, more * away) if more > 0 else shape


def free_share(occupancy: OccupancyLayer, area: BaseGeometry) -> float:
    """Return how much of an area a map knows to be free, 0..1."""
    values = occupancy.values_in(area).values
    return float(np.mean(values == FREE)) if len(values) else 0.0


def _depth_of(name: str, class_depths: Mapping[str, float]) -> float | None:
    """Return the usual depth of a class [m], however its name is spaced; None if unknown."""
    plain = name.replace(" ", "").lower()
    own = {key.replace(" ", "").lower(): depth for key, depth in class_depths.items()}
    return own.get(plain, CLASS_DEPTHS.get(plain))


def _along(shape: BaseGeometry, view: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """Return the axis of a shape that points away from the cameras, and its extent along it [m].

    The axes are those of the smallest rectangle around it; not finite if it has none.
    """
    with np.errstate(divide="ignore", invalid="ignore"):  # as of coordinates of 1e-310
        rectangle = shapely.get_coordinates(shapely.minimum_rotated_rectangle(shape))
        sides = np.diff(rectangle[:3], axis=0)
        lengths = np.hypot(*sides.T)
        axes = sides / lengths[:, np.newaxis]
    along = axes @ view
    k = int(np.argmax(np.abs(along)))
    return np.copysign(1.0, along[k]) * axes[k], float(lengths[k])


def _room_behind(
    shape: BaseGeometry, away: NDArray[np.float64], most: float, is_free: FreeShare
) -> float:
    """Return how far a shape can grow before it would cover known free space [m]."""
    reached, whole = 0.0, shape
    while reached < most:
        further = min(reached + _STEP, most)
        grown = _swept(shape, further * away)
        if is_free(shapely.difference(grown, whole)) > _MOST_FREE:
            break
        reached, whole = further, grown
    return reached


def _swept(shape: BaseGeometry, by: NDArray[np.float64]) -> BaseGeometry:
    """Return the convex hull of a shape and its translation."""
    moved = affinity.translate(shape, *by.tolist())
    return shapely.convex_hull(shapely.union(shape, moved))
