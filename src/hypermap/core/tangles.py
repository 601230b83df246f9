"""Limits on self-intersections, so that no small file or request keeps the program busy.

Where edges cross each other, GEOS needs time quadratic in the number of corners, or more. Real
objects do not exceed these limits; other outlines are refused before GEOS begins.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import BoolArray, IntArray, ObjectArray, as_objects

MOST_CORNERS = 100_000
"""Largest number of corners of a shape."""

FEW = 32
"""Number of corners up to which any tangle is repaired in a millisecond."""

_MANY = 1_000  # corners; any tangle of so few is found in a millisecond
_CROSSINGS = 4  # per edge, besides `_FIRST`, of an outline that can be repaired
_FIRST = 1_000
_NEAR = 1_000_000  # pairs of edges whose boxes meet, each counted twice


def is_sound(shape: Any) -> Any:
    """Return whether GEOS can compute with a geometry; also for an array of them.

    It must be valid, and no hole may be empty: GEOS finds that valid, and crashes. Lengths below
    1e-100 m are none that it can compute with.
    """
    if isinstance(shape, BaseGeometry):  # whose property is several times faster
        try:
            return shape.is_valid and not has_empty_hole(shape)
        except shapely.GEOSException:
            return False
    try:
        return shapely.is_valid(shape) & ~has_empty_hole(shape)
    except shapely.GEOSException:
        return np.fromiter(map(is_sound, shape), dtype=bool)


def has_empty_hole(shape: Any) -> Any:
    """Return whether a geometry has a hole without corners; also for an array of them, (N,)."""
    if isinstance(shape, shapely.Polygon) and shapely.get_num_interior_rings(shape) == 0:
        return False  # as nearly all
    if isinstance(shape, BaseGeometry):
        return bool(has_empty_hole(as_objects([shape]))[0])
    found = np.zeros(len(shape), dtype=bool)
    may = shapely.get_num_interior_rings(shape) > 0
    may |= shapely.get_type_id(shape) >= shapely.GeometryType.MULTIPOINT
    rows = np.flatnonzero(may)
    parts, part_of = _parts(shape[rows])
    is_whole = ~shapely.is_empty(parts)  # the shell of an empty part is empty, too
    rings, ring_of = shapely.get_rings(parts[is_whole], return_index=True)
    found[rows[part_of[is_whole][ring_of[shapely.is_empty(rings)]]]] = True
    return found


def is_quickly_sound(shape: BaseGeometry) -> bool:
    """Return whether a geometry has few enough corners to be validated at once, and is valid."""
    return bool(shapely.get_num_coordinates(shape) <= _MANY and is_sound(shape))


def check_tangle(shape: BaseGeometry) -> None:
    """Check that a geometry of finite coordinates can be validated and repaired quickly.

    Raises:
        ValueError: If it has too many corners, or its edges cross or touch each other too often.
    """
    corners = int(shapely.get_num_coordinates(shape))
    if corners <= FEW or is_quickly_sound(shape):
        return
    if corners > MOST_CORNERS:
        raise ValueError(f"an outline may have {MOST_CORNERS} corners, got {corners}")
    edges = _edges(shape)
    near = _near(edges)
    if near is not None and is_sound(shape):
        return
    # Each edge meets the next one; all others that it meets cross or touch it.
    if near is None or (
        np.count_nonzero(shapely.intersects(edges[near[0]], edges[near[1]]))
        > (1 + _CROSSINGS) * len(edges) + _FIRST
    ):
        raise ValueError(
            f"an outline of {corners} corners crosses or touches itself too often to be repaired"
        )


def are_untangled(shapes: ObjectArray) -> BoolArray:
    """Return which geometries, shape (N,), `check_tangle` would accept."""
    good = np.ones(len(shapes), dtype=bool)
    corners = shapely.get_num_coordinates(shapes)
    some = np.flatnonzero((corners > FEW) & (corners <= _MANY))
    some = some[~is_sound(shapes[some])] if len(some) else some
    for row in np.concatenate([some, np.flatnonzero(corners > _MANY)]).tolist():
        good[row] = _is_untangled(shapes[row])
    return good


def _is_untangled(shape: BaseGeometry) -> bool:
    try:
        check_tangle(shape)
    except ValueError:
        return False
    return True


def _edges(shape: BaseGeometry) -> ObjectArray:
    """Return the edges of a geometry's polygons; its other parts are never repaired."""
    parts, _ = _parts(as_objects([shape]))
    corners, ring_of = shapely.get_coordinates(shapely.get_rings(parts), return_index=True)
    ends = np.stack([corners[:-1], corners[1:]], axis=1)
    return np.asarray(shapely.linestrings(ends[ring_of[:-1] == ring_of[1:]]))


def _parts(shapes: ObjectArray) -> tuple[ObjectArray, IntArray]:
    """Return the single parts of geometries, (N,), and the number of the geometry of each."""
    parts, of = shapely.get_parts(shapes, return_index=True)
    while (shapely.get_type_id(parts) >= shapely.GeometryType.MULTIPOINT).any():  # not single
        parts, outer = shapely.get_parts(parts, return_index=True)
        of = of[outer]
    return parts, of


def _near(edges: ObjectArray) -> IntArray | None:
    """Return the pairs of edges whose boxes meet, each once, (2, P); None if there are too many."""
    if not len(edges):
        return np.empty((2, 0), dtype=np.int64)
    tree, found, count = shapely.STRtree(edges), [], 0
    step = max(1, _NEAR // len(edges))  # so that no step finds more
    for start in range(0, len(edges), step):
        pairs = tree.query(edges[start : start + step])
        count += pairs.shape[1]
        if count > _NEAR:
            return None
        pairs[0] += start
        found.append(pairs[:, pairs[0] < pairs[1]])
    return np.concatenate(found, axis=1)
