"""Shapes for displays: triangles, line segments, and a point for the name."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import mapbox_earcut
import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.core.arrays import IntArray, ObjectArray
from hypermap.core.shapes import have_points

_POLYGON = 3  # shapely's type number


@dataclass(frozen=True, eq=False)
class Corners:
    """Corners of many shapes, in the order in which they are drawn.

    Attributes:
        points_xy: shape (N, 2) [m]; three in a row are a triangle, or two a line segment.
        owners: which shape each corner belongs to, shape (N,).
    """

    points_xy: NDArray[np.float64]
    owners: IntArray


def triangles(shapes: ObjectArray) -> Corners:
    """Return triangles that fill valid shapes, without their holes.

    Args:
        shapes: shapely geometries, shape (N,); parts that are not polygons have nothing to fill.

    >>> len(triangles(np.array([shapely.box(0, 0, 2, 1)])).points_xy)
    6
    """
    polygons, owners = _polygons(shapes)
    points, ring_starts, first_rings = _rings(polygons)
    begins = ring_starts[first_rings]  # of each polygon's points
    sizes, rings = np.diff(begins), np.diff(first_rings)
    local = points - np.repeat(points[begins[:-1]], sizes, axis=0)  # exact far from the origin
    ring_ends = (ring_starts[1:] - np.repeat(begins[:-1], rings)).astype(np.uint32)
    spans = zip(pairwise(begins.tolist()), pairwise(first_rings.tolist()), strict=True)
    found = [
        mapbox_earcut.triangulate_float64(local[first:last], ring_ends[ring:next_ring])
        for (first, last), (ring, next_ring) in spans
    ]
    counts = [len(corners) for corners in found]
    corners = np.concatenate([*found, np.empty(0, dtype=np.uint32)])
    chosen = corners + np.repeat(begins[:-1], counts)
    return Corners(points[chosen], np.repeat(owners, counts))


def ring_segments(shapes: ObjectArray) -> Corners:
    """Return the line segments of all rings of polygons and multipolygons, shape (N,).

    >>> len(ring_segments(np.array([shapely.box(0, 0, 2, 1)])).points_xy)
    8
    """
    polygons, owners = _polygons(shapes)
    points, ring_starts, first_rings = _rings(polygons)
    if len(polygons) == 0:
        return Corners(np.empty((0, 2)), np.empty(0, dtype=np.int64))
    begins = np.ones(len(points), dtype=bool)
    begins[ring_starts[1:] - 1] = False  # a ring's last point ends its last segment
    begin = np.flatnonzero(begins)
    segments = np.stack([points[begin], points[begin + 1]], axis=1).reshape(-1, 2)
    polygon_starts = ring_starts[first_rings]
    owner_of_point = np.repeat(owners, np.diff(polygon_starts))
    return Corners(segments, np.repeat(owner_of_point[begin], 2))


def label_points(shapes: ObjectArray, centroids: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a point for each shape's name, shape (N, 2): its centroid, or another point inside.

    Args:
        shapes: shapely geometries, shape (N,).
        centroids: of the shapes, shape (N, 2).
    """
    points = centroids.copy()
    outside = ~have_points(shapes, centroids)
    if outside.any():
        inside = shapely.point_on_surface(shapes[outside])
        points[outside] = shapely.get_coordinates(inside)
    return points


def _polygons(shapes: ObjectArray) -> tuple[ObjectArray, IntArray]:
    """Return all polygons in shapes, and the shape that each belongs to."""
    parts, owners = shapely.get_parts(shapes, return_index=True)
    parts, places = shapely.get_parts(parts, return_index=True)  # multipolygons in collections
    is_polygon = (shapely.get_type_id(parts) == _POLYGON) & ~shapely.is_empty(parts)
    return parts[is_polygon], owners[places][is_polygon]


def _rings(polygons: ObjectArray) -> tuple[NDArray[np.float64], IntArray, IntArray]:
    """Return the points of closed rings, where each ring starts, and each polygon's first ring.

    Both of the latter end with the place after the last.
    """
    if len(polygons) == 0:
        zero: Any = np.zeros(1, dtype=np.int64)
        return np.empty((0, 2)), zero, zero
    _, points, (ring_starts, first_rings) = shapely.to_ragged_array(polygons)
    return points, ring_starts, first_rings
