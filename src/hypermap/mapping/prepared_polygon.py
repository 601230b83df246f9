"""Prepared polygons: geometry with the edges that compiled loops compute with."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeAlias, TypeVar, cast

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap._loops import loop
from hypermap.core.arrays import BoolArray, IntArray, ObjectArray, as_objects

_POLYGON = 3  # shapely's number of this type
_NOTHING = 1e-12  # share of a shape's area; less is rounding, where shapes only touch

T = TypeVar("T")
Box: TypeAlias = tuple[float, float, float, float]  # xmin, ymin, xmax, ymax [m]


@dataclass(frozen=True, eq=False)
class PreparedPolygon:
    """A polygon with derived values that are computed once, like a prepared geometry of GEOS.

    Attributes:
        box: xmin, ymin, xmax, ymax [m], NaN if empty.
        area: of the geometry [m²].
        edges: of all rings: x0, y0, x1, y1 [m], and 1 if the inside is to the left of the edge or
            -1 if it is to the right, float64, shape (E, 5).
        is_ring: whether it is one polygon without holes.
    """

    box: Box
    area: float
    edges: NDArray[np.float64]
    is_ring: bool
    _cache: dict[object, Any] = field(default_factory=dict, repr=False)

    @cached_property
    def geometry(self) -> BaseGeometry:
        """Polygon or multipolygon in the map frame [m]; may be empty."""
        return cast("BaseGeometry", shapely.polygons(self.edges[:, :2]))  # others are kept

    @cached_property
    def diameter(self) -> float:
        """The largest distance between two of its points [m]; 0 if empty."""
        return float(_diameter(shapely.get_coordinates(shapely.convex_hull(self.geometry))))

    @classmethod
    def of(cls, geometry: BaseGeometry) -> PreparedPolygon:
        """Prepare one geometry."""
        if isinstance(geometry, shapely.Polygon) and not shapely.get_num_interior_rings(geometry):
            return cls.of_ring(shapely.get_coordinates(geometry))._keeping(geometry)
        return cls.all_of([geometry])[0]

    @classmethod
    def of_ring(cls, points: NDArray[np.float64]) -> PreparedPolygon:
        """Prepare a polygon, given its closed ring [m], shape (P, 2); empty without points."""
        edges = np.empty((max(len(points) - 1, 0), 5))
        x0, y0, x1, y1, area = _measure_ring(points, edges)
        return cls((x0, y0, x1, y1), area, edges, is_ring=True)

    @classmethod
    def all_of(cls, geometries: Sequence[BaseGeometry]) -> list[PreparedPolygon]:
        """Prepare many geometries, which is faster than one by one."""
        shapes = as_objects(geometries)
        boxes = shapely.bounds(shapes).tolist()
        areas = shapely.area(shapes).tolist()
        is_ring = _are_rings(shapes)
        edges, first = _edges_of(shapes, is_ring)
        columns = geometries, boxes, areas, first[:-1], first[1:], is_ring.tolist()
        return [
            cls(tuple(box), area, edges[begin:end], alone)._keeping(geometry)
            for geometry, box, area, begin, end, alone in zip(*columns, strict=True)
        ]

    def _keeping(self, geometry: BaseGeometry) -> PreparedPolygon:
        """Return itself with the geometry that it was made of."""
        vars(self)["geometry"] = geometry
        return self

    def cached(self, make: Callable[..., T], *arguments: Hashable) -> T:
        """Return the result of a function, which is called once for this polygon and arguments.

        Args:
            make: takes the polygon and the other arguments.
            arguments: the other arguments.
        """
        key = (make, *arguments)
        if key not in self._cache:
            self._cache[key] = make(self, *arguments)
        return cast(T, self._cache[key])


def shared_area(one: PreparedPolygon, other: PreparedPolygon) -> float:
    """Return the area that two shapes share [m²]; 0 where they only touch."""
    shared = float(_shared_area(one.edges, other.edges))
    return shared if shared > _NOTHING * min(one.area, other.area) else 0.0


@loop()
def _shared_area(edges: NDArray[np.float64], others: NDArray[np.float64]) -> float:
    """Return the area that two shapes share [m²].

    A shape is the signed sum of the strips below its edges: positive below upper edges, negative
    below lower ones. So the shared area is the signed sum over all pairs of strips of the area
    below the lower one of two edges, over their common interval of x.

    Args:
        edges: of one shape, as `PreparedPolygon.edges`.
        others: those of the other shape.
    """
    total = 0.0
    if len(edges) == 0 or len(others) == 0:
        return total
    x_origin, y_origin = edges[0, 0], edges[0, 1]  # so distant shapes lose no precision
    for i in range(len(edges)):
        xa0, ya0 = edges[i, 0] - x_origin, edges[i, 1] - y_origin
        xa1, ya1 = edges[i, 2] - x_origin, edges[i, 3] - y_origin
        if xa0 == xa1:
            continue
        slope_a = (ya1 - ya0) / (xa1 - xa0)
        left_a, right_a = min(xa0, xa1), max(xa0, xa1)
        sign_a = edges[i, 4] if xa1 < xa0 else -edges[i, 4]
        for j in range(len(others)):
            xb0, xb1 = others[j, 0] - x_origin, others[j, 2] - x_origin
            left, right = max(left_a, min(xb0, xb1)), min(right_a, max(xb0, xb1))
            if left >= right:
                continue
            yb0, yb1 = others[j, 1] - y_origin, others[j, 3] - y_origin
            slope_b = (yb1 - yb0) / (xb1 - xb0)
            a_left, a_right = ya0 + slope_a * (left - xa0), ya0 + slope_a * (right - xa0)
            b_left, b_right = yb0 + slope_b * (left - xb0), yb0 + slope_b * (right - xb0)
            heights = min(a_left, b_left) + min(a_right, b_right)
            over_left, over_right = a_left - b_left, a_right - b_right
            if over_left * over_right < 0:  # the edges cross
                heights += abs(over_left * over_right / (over_left - over_right))
            sign_b = others[j, 4] if xb1 < xb0 else -others[j, 4]
            total += sign_a * sign_b * heights / 2 * (right - left)
    return total


@loop()
def _measure_ring(
    points: NDArray[np.float64], edges: NDArray[np.float64]
) -> tuple[float, float, float, float, float]:
    """Return box and area of one closed ring, shape (P, 2), and fill in its edges."""
    count = len(edges)
    xmin = ymin = xmax = ymax = np.nan
    if count:
        xmin, ymin = xmax, ymax = points[0, 0], points[0, 1]
    twice_area = 0.0
    for p in range(count):
        x, y = points[p, 0], points[p, 1]
        xmin, ymin, xmax, ymax = min(xmin, x), min(ymin, y), max(xmax, x), max(ymax, y)
        edges[p, 0], edges[p, 1] = x, y
        edges[p, 2], edges[p, 3] = points[p + 1, 0], points[p + 1, 1]
        # In shapely's order, so that the area is the same to the last bit.
        before = points[p - 1, 1] if p else points[count - 1, 1]
        twice_area += (x - points[0, 0]) * (points[p + 1, 1] - before)
    for p in range(count):
        edges[p, 4] = 1 if twice_area > 0 else -1
    return xmin, ymin, xmax, ymax, abs(twice_area / 2)


@loop()
def _diameter(points: NDArray[np.float64]) -> float:
    """Return the largest distance between two points, shape (P, 2)."""
    most = 0.0
    for i in range(len(points)):
        for j in range(i):
            dx, dy = points[i, 0] - points[j, 0], points[i, 1] - points[j, 1]
            most = max(most, dx * dx + dy * dy)
    return float(np.sqrt(most))


def _are_rings(shapes: ObjectArray) -> BoolArray:
    """Return which shapes are single polygons without holes, shape (N,)."""
    is_polygon = shapely.get_type_id(shapes) == _POLYGON
    return np.asarray(is_polygon & (shapely.get_num_interior_rings(shapes) == 0))


def _edges_of(shapes: ObjectArray, is_ring: BoolArray) -> tuple[NDArray[np.float64], list[int]]:
    """Return the edges of all shapes, and where those of each begin and the last ones end."""
    if is_ring.all():  # the usual case: the points of each shape are those of its only ring
        rings, shape_of_ring = shapely.get_exterior_ring(shapes), np.arange(len(shapes))
        points, ring_of_point = shapely.get_coordinates(shapes, return_index=True)
        is_hole = np.zeros(len(shapes), dtype=bool)
    else:
        parts, shape_of_part = shapely.get_parts(shapes, return_index=True)
        rings, part_of_ring = shapely.get_rings(parts, return_index=True)
        is_hole = np.append(False, part_of_ring[1:] == part_of_ring[:-1])
        shape_of_ring = shape_of_part[part_of_ring]
        points, ring_of_point = shapely.get_coordinates(rings, return_index=True)
    is_inside_left = shapely.is_ccw(rings) != is_hole
    edges, first = np.empty((len(points), 5)), np.empty(len(shapes) + 1, np.int64)
    _fill_edges(points, ring_of_point, shape_of_ring, is_inside_left, edges, first)
    return edges, first.tolist()


@loop()
def _fill_edges(
    points: NDArray[np.float64],
    ring_of_point: IntArray,
    shape_of_ring: IntArray,
    is_inside_left: BoolArray,
    edges: NDArray[np.float64],
    first: IntArray,
) -> None:
    """Find the edges of rings.

    Args:
        points: of all rings, each closed [m], shape (P, 2).
        ring_of_point: ascending, shape (P,).
        shape_of_ring: ascending, shape (R,).
        is_inside_left: of each ring, shape (R,).
        edges: filled, as `PreparedPolygon.edges`, shape (P, 5).
        first: filled with where the edges of each shape begin, and where the last ones end.
    """
    count = shape = 0
    for p in range(len(points) - 1):
        ring = ring_of_point[p]
        if ring_of_point[p + 1] == ring:
            while shape <= shape_of_ring[ring]:
                first[shape] = count
                shape += 1
            edges[count, 0], edges[count, 1] = points[p, 0], points[p, 1]
            edges[count, 2], edges[count, 3] = points[p + 1, 0], points[p + 1, 1]
            edges[count, 4] = 1 if is_inside_left[ring] else -1
            count += 1
    for rest in range(shape, len(first)):
        first[rest] = count
