"""Shapes in the plane: checked once, and repaired if an outline crosses itself."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import BoolArray, ObjectArray, as_objects
from hypermap.core.errors import AreaError
from hypermap.core.tangles import (
    FEW,
    are_untangled,
    check_tangle,
    has_empty_hole,
    is_quickly_sound,
    is_sound,
)

_FAR = 1e9  # meters; areas are clipped there
_FARTHEST = 1e100  # meters; products of two such lengths do not overflow
_NANOMETERS = 9  # decimals


def box_of(area: Any) -> tuple[float, float, float, float] | None:
    """Return x0, y0, x1, y1 of an area that is an axis-aligned box; None if it is not.

    Faster than `as_area`, which such an area does not need.
    """
    if not isinstance(area, shapely.Polygon):
        return None
    corners = shapely.get_coordinates(area)
    if len(corners) != 5:
        return None
    (ax, ay), (bx, by), (cx, cy), (dx, dy), _ = corners.tolist()
    is_upright = ax == bx and by == cy and cx == dx and dy == ay
    is_level = ay == by and bx == cx and cy == dy and dx == ax
    x0, x1 = (ax, cx) if ax < cx else (cx, ax)
    y0, y1 = (ay, cy) if ay < cy else (cy, ay)
    is_good = -_FAR <= x0 < x1 <= _FAR and -_FAR <= y0 < y1 <= _FAR
    return (x0, y0, x1, y1) if is_good and (is_upright or is_level) else None


def as_area(area: Any) -> BaseGeometry:
    """Return a valid copy of an area for queries; an empty area contains nothing.

    A copy, because the caller may have prepared the area (`shapely.contains_xy` prepares, too), and
    threads that share a prepared geometry crash the program.

    Raises:
        TypeError: If it is not a shapely geometry.
        AreaError: If a coordinate is not finite, or GEOS cannot read or repair its outline.
    """
    if not isinstance(area, BaseGeometry):
        raise TypeError(f"an area must be a shapely geometry, got {type(area).__name__}")
    own: BaseGeometry = shapely.force_2d(area)
    if is_quickly_sound(own) and all(abs(side) <= _FAR for side in own.bounds):
        return own  # as nearly all areas
    farthest = np.abs(shapely.get_coordinates(own)).max(initial=0)
    if not np.isfinite(farthest):
        raise AreaError("an area must be finite; there is a NaN or infinite coordinate")
    try:
        if farthest > _FAR:
            own = shapely.transform(own, lambda xy: np.clip(xy, -_FARTHEST, _FARTHEST))
        _check_tangle(own)
        if farthest > _FAR:
            # `clip_by_rect` is faster, but wrong or empty if corners are very far outside.
            own = shapely.intersection(_valid(own), shapely.box(-_FAR, -_FAR, _FAR, _FAR))
        return _valid(own)
    except shapely.GEOSException as error:
        raise AreaError(
            f"GEOS cannot follow the outline of an area with coordinates up to {farthest:g} m: "
            f"{error}"
        ) from error


def _check_tangle(area: BaseGeometry) -> None:
    try:
        check_tangle(area)
    except ValueError as error:
        raise AreaError(f"{error}; ask about a simpler area") from None


def _valid(area: BaseGeometry) -> BaseGeometry:
    valid: BaseGeometry = area if is_sound(area) else repaired(area)
    return valid


def repaired(shape: Any) -> Any:
    """Repair a geometry whose outline crosses itself; also for an array of them.

    Whatever the outline winds around is inside: both halves of a bow tie, and what it winds
    around twice. A polygon without area becomes the line or point that it is. If lengths are so
    small that GEOS cannot compute with them, those below a nanometer are ignored.
    """
    with np.errstate(all="ignore"):  # GEOS divides by the lengths of edges without length
        try:
            return shapely.make_valid(shape, method="structure", keep_collapsed=True)
        except shapely.GEOSException:
            if not isinstance(shape, BaseGeometry):
                return as_objects(repaired(one) for one in shape)
            coarse = shapely.transform(shape, lambda xy: np.round(xy, _NANOMETERS))
            return shapely.make_valid(coarse, method="structure", keep_collapsed=True)


def valid_copies(shapes: ObjectArray) -> ObjectArray:
    """Return the shapes, (N,), with the invalid ones repaired."""
    bad = ~is_sound(shapes)
    if not bad.any():
        return shapes
    valid = shapes.copy()
    valid[bad] = repaired(shapes[bad])
    # A hole as large as its shell leaves nothing; keep the outline.
    nothing = shapely.is_empty(valid)
    valid[nothing] = shapely.boundary(shapes[nothing])
    return valid


def have_points(shapes: ObjectArray, points_xy: NDArray[np.float64]) -> BoolArray:
    """Return whether each shape, (N,), covers its point, (N, 2), boundary included.

    The points come first because GEOS uses the first geometry's preparation. Users may have
    prepared a shape, and threads must not share a prepared geometry.
    """
    return np.asarray(shapely.intersects(shapely.points(points_xy), shapes))


def check_footprint(footprint: Any) -> None:
    """Check that an object can have this shape; its outline may cross itself.

    Raises:
        TypeError: If it is not a shapely polygon or multipolygon.
        ValueError: If it has no points, an empty hole, or a third, non-finite or absurdly large
            coordinate, or its outline is so tangled that it cannot be repaired.
    """
    if not isinstance(footprint, shapely.Polygon | shapely.MultiPolygon):
        raise TypeError(
            f"a footprint must be a polygon or multipolygon, got {type(footprint).__name__}"
        )
    if footprint.is_empty:
        raise ValueError("a footprint must not be empty")
    if footprint.has_z:
        raise ValueError("a footprint is 2D; its points must have two coordinates")
    if has_empty_hole(footprint):
        raise ValueError("a hole of a footprint must have corners; leave out the empty hole")
    corners = shapely.get_coordinates(footprint)
    farthest = np.abs(corners).max()
    if not farthest <= _FAR:
        raise ValueError(f"a footprint must be finite and within {_FAR:g} m, got {farthest}")
    if len(corners) > FEW:
        check_tangle(footprint)


def can_be_corners(points: NDArray[np.float64]) -> bool:
    """Return whether a footprint may have all these points, shape (N, 2)."""
    # False for NaN, too
    return bool(points.min(initial=0) >= -_FAR and points.max(initial=0) <= _FAR)


def can_be_footprints(shapes: ObjectArray) -> BoolArray:
    """Return which geometries, shape (N,), `check_footprint` would accept."""
    kinds = shapely.get_type_id(shapes)
    good = (kinds == shapely.GeometryType.POLYGON) | (kinds == shapely.GeometryType.MULTIPOLYGON)
    good &= ~shapely.is_empty(shapes) & ~shapely.has_z(shapes) & ~has_empty_hole(shapes)
    if not can_be_corners(shapely.get_coordinates(shapes)):
        points, owners = shapely.get_coordinates(shapes, return_index=True)
        good[owners[~(np.abs(points) <= _FAR).all(axis=1)]] = False
    good[good] = are_untangled(shapes[good])
    return np.asarray(good)
