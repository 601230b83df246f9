"""Exact point-in-polygon tests, for single points and for many pairs at once."""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import BoolArray, IntArray, ObjectArray, of_rows
from hypermap.core.shapes import have_points

# The difference of two products of differences has the right sign if it exceeds this part of the
# sum of their sizes. Source: Shewchuk, Adaptive Precision Floating-Point Arithmetic and Fast Robust
# Geometric Predicates, 1997, the first bound of orient2d.
_UNSURE = 3.3306690738754716e-16
_MOST_CORNERS = 64  # of an outline that is tested edge by edge
_PAIRS = 2**14  # tested at a time, which limits the memory
_MOST_KEPT = 2**12  # outlines in plain Python

Ring = list[list[float]]  # the corners' x and y


def ranges(starts: IntArray, counts: IntArray) -> tuple[IntArray, IntArray]:
    """Return the numbers of several ranges, one range after the other, and the range of each.

    >>> ranges(np.array([5, 9]), np.array([3, 2]))
    (array([ 5,  6,  7,  9, 10]), array([0, 0, 0, 1, 1]))
    """
    owners = np.repeat(np.arange(len(counts)), counts)
    before = starts - np.cumsum(counts) + counts
    return np.arange(len(owners)) + before[owners], owners


class Outlines:
    """The corners of shapes as one array.

    A polygon without holes is tested edge by edge: a point is inside if a ray from it crosses
    an odd number of edges. GEOS, which is exact, decides where rounding errors matter, and for all
    other shapes. A point on an outline belongs to the shape.
    """

    def __init__(self, shapes: ObjectArray) -> None:
        self._shapes = shapes
        coordinates, owners = shapely.get_coordinates(shapes, return_index=True)
        self._x, self._y = np.ascontiguousarray(coordinates.T)
        self._starts = np.searchsorted(owners, np.arange(len(shapes) + 1))
        self._is_plain = (
            (shapely.get_type_id(shapes) == shapely.GeometryType.POLYGON)
            & (shapely.get_num_interior_rings(shapes) == 0)
            & (np.diff(self._starts) <= _MOST_CORNERS)
        )

    def first_corners(self, rows: IntArray) -> NDArray[np.float64]:
        """Return a corner of each of some shapes, shape (M, 2)."""
        first = self._starts[rows]
        return np.column_stack([self._x[first], self._y[first]])

    def cover(self, rows: IntArray, points_xy: NDArray[np.float64]) -> BoolArray:
        """Return whether each shape, by its row (M,), covers its point, (M, 2)."""
        covered = np.zeros(len(rows), dtype=bool)
        is_sure = self._is_plain[rows]
        plain = np.flatnonzero(is_sure)
        for part in np.split(plain, range(_PAIRS, len(plain), _PAIRS)):
            covered[part], is_sure[part] = self._cross(rows[part], of_rows(points_xy, part))
        others = np.flatnonzero(~is_sure)
        covered[others] = have_points(self._shapes[rows[others]], of_rows(points_xy, others))
        return covered

    def _cross(self, rows: IntArray, points_xy: NDArray[np.float64]) -> tuple[BoolArray, BoolArray]:
        """Return for pairs, (M,), whether the point is inside, and whether that is sure."""
        first = self._starts[rows]
        counts = self._starts[rows + 1] - first - 1
        edges, pairs = ranges(first, counts)
        # Only edges from a to b that reach the height of the point matter.
        height = points_xy[pairs, 1]
        a_is_above, b_is_above = self._y[edges] >= height, self._y[edges + 1] >= height
        b_is_level = self._y[edges + 1] == height
        near = np.flatnonzero((a_is_above != b_is_above) | b_is_level)
        edges, pairs = edges[near], pairs[near]
        x, y = of_rows(points_xy, pairs).T
        ax, ay = self._x[edges] - x, self._y[edges] - y
        bx, by = self._x[edges + 1] - x, self._y[edges + 1] - y
        left, right = ax * by, ay * bx
        is_left = left > right
        is_crossed = (a_is_above != b_is_above)[near] & (is_left == b_is_above[near])
        unsure = np.abs(left - right) <= _UNSURE * (np.abs(left) + np.abs(right))
        inside = np.bincount(pairs[is_crossed], minlength=len(rows)) % 2 == 1
        is_sure = np.ones(len(rows), dtype=bool)
        is_sure[pairs[unsure]] = False
        return inside, is_sure


class Rings:
    """The outlines of single shapes in plain Python, which is faster for these than arrays.

    They are cached, up to a limit, and tested as in `Outlines`. GEOS gets copies, one thread at a
    time: it prepares a shape during the first queries, and two threads that do so at once
    crash the program.
    """

    def __init__(self, shape_of: Callable[[int], BaseGeometry]) -> None:
        """Read outlines from the shapes of rows."""
        self._shape_of = shape_of
        self._kept: dict[int, Ring] = {}
        self._copies: dict[int, BaseGeometry] = {}
        self._asking = threading.Lock()

    def cover(self, row: int, x: float, y: float) -> bool:
        """Return whether the shape of a row covers a point."""
        try:
            ring = self._kept[row]
        except KeyError:
            ring = self._keep(row)
        is_inside = _is_around(ring, x, y) if ring else None
        return self._ask(row, x, y) if is_inside is None else is_inside

    def _ask(self, row: int, x: float, y: float) -> bool:
        """Return the answer of GEOS."""
        with self._asking:
            if row not in self._copies:
                if len(self._copies) >= _MOST_KEPT:
                    self._copies = {}
                self._copies[row] = shapely.force_2d(self._shape_of(row))
            return bool(shapely.intersects_xy(self._copies[row], x, y))

    def _keep(self, row: int) -> Ring:
        if len(self._kept) >= _MOST_KEPT:
            self._kept = {}
        ring = self._kept[row] = _plain_ring(self._shape_of(row))
        return ring


def _plain_ring(shape: BaseGeometry) -> Ring:
    """Return the corners, the first one twice; none if GEOS must decide about the shape."""
    corners: Ring = shapely.get_coordinates(shape).tolist()
    if not isinstance(shape, shapely.Polygon) or len(corners) > _MOST_CORNERS:
        return []
    has_holes = corners.index(corners[0], 1) < len(corners) - 1  # they follow the closed outline
    return [] if has_holes else corners


def _is_around(ring: Ring, x: float, y: float) -> bool | None:
    """Return whether a ring covers a point; None if rounding errors matter."""
    inside = False
    ax, ay = ring[0]
    for bx, by in ring:
        if (ay >= y) != (by >= y):
            left, right = (ax - x) * (by - y), (ay - y) * (bx - x)
            if abs(left - right) <= _UNSURE * (abs(left) + abs(right)):
                return None
            if (left > right) == (by >= y):
                inside = not inside
        elif by == y and (ay == y or bx == x):
            return None
        ax, ay = bx, by
    return inside
