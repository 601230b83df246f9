"""How alike tracks of earlier drives and of the present one are: in place, shape and height."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.history.likeness import likeness
from hypermap.mapping.prepared_polygon import PreparedPolygon
from hypermap.mapping.track_shapes import Rows
from hypermap.mapping.tracks import TrackTable

_HEIGHT_ERROR = 0.05  # share of a height by which maps measure it wrongly
_ON_FLOOR = 0.3  # [m]; the lower side of objects above is not measured
_IN_PART = 0.4  # how alike two shapes are, of which one is a part that could be seen, at least
_OVER = 0.15  # [m] by which what is seen over a table begins higher
_THIN = 0.1  # [m] below which a shape is only the front of an object that is as deep as this
_SIDE = (0.7, 1.2)  # such a front's length, as multiples of the shorter and the longer side
_TINY = 1e-12


@dataclass(frozen=True, eq=False)
class ComparedTracks:
    """The tracks of one class, N of earlier drives and M of the present one.

    Attributes:
        known: rows of those of earlier drives.
        fresh: rows of the others.
        areas: of their shapes [m²], shapes (N,) and (M,).
        shared: areas that two of them share [m²], shape (N, M).
        distances: between their centers [m], shape (N, M).
        height_gaps: share of the height by which two differ, beyond the error, 0..1, shape (N, M).
    """

    known: Rows
    fresh: Rows
    areas: tuple[NDArray[np.float64], NDArray[np.float64]]
    shared: NDArray[np.float64]
    distances: NDArray[np.float64]
    height_gaps: NDArray[np.float64]

    @classmethod
    def of(cls, tracks: TrackTable, known: Rows, fresh: Rows) -> ComparedTracks:
        """Compare tracks."""
        shapes = tracks.shapes
        a, b = shapes.geometries(known), shapes.geometries(fresh)
        boxes, theirs = shapes.boxes[known][:, None], shapes.boxes[fresh]
        meet = (boxes[..., :2] <= theirs[:, 2:]) & (boxes[..., 2:] >= theirs[:, :2])
        shared = np.zeros((len(known), len(fresh)))
        for i, j in np.argwhere(meet.all(axis=2)).tolist():
            one, other = shapes.polygons[known[i]], shapes.polygons[fresh[j]]
            shared[i, j] = other.cached(_shared_with, one)
        distances = shapely.distance(shapely.centroid(a)[:, None], shapely.centroid(b))
        distances = np.nan_to_num(distances, nan=math.inf)  # what is empty is far from everything
        areas = shapely.area(a), shapely.area(b)
        return cls(known, fresh, areas, shared, distances, _height_gaps(tracks, known, fresh))


def _height_gaps(tracks: TrackTable, known: Rows, fresh: Rows) -> NDArray[np.float64]:
    """Return by which share the heights of tracks differ, beyond their error, shape (N, M).

    A view that ends at the border of its image, or at what is in front, may lack the top. So the
    top of a track is anywhere from the median of its views to their upper quartile.
    """
    lowest, (least, most) = tracks.shapes.heights[:, 0], _tops(tracks, known)
    fresh_least, fresh_most = _tops(tracks, fresh)
    is_on_floor = np.maximum(lowest[known][:, None], lowest[fresh]) <= _ON_FLOOR
    low = np.maximum(np.maximum(least[:, None], fresh_least), _TINY)
    ratios = np.minimum(most[:, None], fresh_most) / low
    return np.where(is_on_floor, np.maximum(1 - _HEIGHT_ERROR - ratios, 0), 0)


def _tops(tracks: TrackTable, rows: Rows) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the median and the upper quartile of the highest points of tracks [m], (N,) both."""
    least = tracks.shapes.heights[rows, 1]
    most = np.array([tracks.objects[row].buffer.top() for row in rows])
    return least, np.maximum(most, least)


def likeness_of_tracks(tracks: TrackTable, one: int, other: int) -> float:
    """Return how alike the shapes of tracks in two rows may be, 0..1; see `likeness`.

    What can be seen over a table, or from the front, may be a part of the other shape.
    """
    shapes = tracks.shapes
    a, b = shapes.polygons[one], shapes.polygons[other]
    smaller, larger = (one, other) if a.area < b.area else (other, one)
    is_over = shapes.heights[smaller, 0] > shapes.heights[larger, 0] + _OVER
    is_part = is_over or _is_front(shapes.polygons[smaller], shapes.polygons[larger])
    return max(likeness_of(a, b), _IN_PART if is_part else 0.0)


def _is_front(one: PreparedPolygon, whole: PreparedPolygon) -> bool:
    """Return whether a shape may be the front, or another side, of what another shape is all of."""
    thickness, length = one.cached(sides)
    if thickness >= _THIN:
        return False
    shorter, longer = whole.cached(sides)
    return shorter > _THIN and _SIDE[0] * shorter <= length <= _SIDE[1] * longer


def likeness_of(known: PreparedPolygon, fresh: PreparedPolygon) -> float:
    """Return how alike a known shape and one of the drive are; see `likeness`."""
    return fresh.cached(_likeness_to, known)


def sides(shape: PreparedPolygon) -> tuple[float, float]:
    """Return the sides of the smallest rectangle around a shape, the shorter one first [m]."""
    corners = shapely.get_coordinates(shapely.minimum_rotated_rectangle(shape.geometry))
    if len(corners) < 4:  # a point or a line
        return 0.0, float(shapely.length(shape.geometry))
    shorter, longer = sorted(np.hypot(*(corners[1:3] - corners[:2]).T).tolist())
    return shorter, longer


def _shared_with(fresh: PreparedPolygon, known: PreparedPolygon) -> float:
    return float(shapely.area(shapely.intersection(known.geometry, fresh.geometry)))


def _likeness_to(fresh: PreparedPolygon, known: PreparedPolygon) -> float:
    return likeness(known.geometry, fresh.geometry)
