"""The occlusion test: how much of an object on the map a frame could see."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap._loops import inner_loop, loop
from hypermap.core.arrays import IntArray
from hypermap.mapping.prepared_polygon import PreparedPolygon
from hypermap.perception.depth_view import NEAREST, DepthView

_AROUND = np.arange(8) / 8  # samples along the contour
_INWARD = 0.75  # where the samples lie between centroid and contour
_HEIGHTS = (0.25, 0.5, 0.75)  # of the samples, between lowest and highest point
_NO_HULL = -1.0
_FEWEST_RAYS = 10  # of a whole view, that must be able to hit an object that is detected


@dataclass(frozen=True, eq=False)
class SamplePoints:
    """Where the occlusion test samples N objects.

    Attributes:
        around: points of their contours [m], shape (N, 8, 2).
        xy: their centers, and points between these and the contours [m], shape (N, 9, 2).
        widths: the largest distance between opposite samples of each contour [m], shape (N,).
    """

    around: NDArray[np.float64]
    xy: NDArray[np.float64]
    widths: NDArray[np.float64]

    def sample(self, row: int, shape: PreparedPolygon) -> None:
        """Replace the samples of one object by those of another shape."""
        around, xy = self.around[row], self.xy[row]
        width = _sample_hull(shape.edges, around, xy) if shape.is_ring else _NO_HULL
        if width == _NO_HULL:
            hull = shapely.convex_hull(shape.geometry)
            ring = shapely.get_exterior_ring(hull)
            places = shapely.line_interpolate_point(ring, _AROUND, normalized=True)
            around[:] = shapely.get_coordinates(places)
            xy[:1] = shapely.get_coordinates(shapely.centroid(hull))
            width = _sample_inside(around, xy)
        self.widths[row] = width


def sample_points(shapes: Sequence[PreparedPolygon]) -> SamplePoints:
    """Return the sample points of objects, from the convex hulls of their shapes."""
    count = len(shapes)
    found = SamplePoints(np.empty((count, 8, 2)), np.empty((count, 9, 2)), np.empty(count))
    for row, shape in enumerate(shapes):
        found.sample(row, shape)
    return found


@loop()
def _sample_inside(around: NDArray[np.float64], xy: NDArray[np.float64]) -> float:
    """Sample an object between its center and its contour, and return its width [m].

    Args:
        around: as in `SamplePoints`, shape (8, 2).
        xy: the first row is the center; the others are filled, shape (9, 2).
    """
    width, half = 0.0, len(around) // 2
    for k in range(len(around)):
        for axis in range(2):
            xy[k + 1, axis] = xy[0, axis] + _INWARD * (around[k, axis] - xy[0, axis])
    for k in range(half):
        dx, dy = around[k, 0] - around[k + half, 0], around[k, 1] - around[k + half, 1]
        width = max(width, np.sqrt(dx * dx + dy * dy))
    return width


@loop()
def _sample_hull(
    edges: NDArray[np.float64], around: NDArray[np.float64], xy: NDArray[np.float64]
) -> float:
    """Sample a polygon that is a convex hull as GEOS makes it, and return its width [m].

    Such a hull is clockwise from its lowest corner, without corners on straight lines.

    Args:
        edges: of the polygon, as `PreparedPolygon.edges`.
        around: filled with points of its contour [m], shape (8, 2).
        xy: filled with its centroid, and points between this and the contour [m], shape (9, 2).

    Returns:
        `_NO_HULL` for other polygons.
    """
    count = len(edges)
    if count < 3:
        return _NO_HULL
    x0, y0 = edges[0, 0], edges[0, 1]
    length = area = x = y = 0.0
    for e in range(count):
        ax, ay = edges[e, 2] - edges[e, 0], edges[e, 3] - edges[e, 1]
        after = (e + 1) % count
        bx, by = edges[after, 2] - edges[after, 0], edges[after, 3] - edges[after, 1]
        is_lowest = edges[e, 1] > y0 or (edges[e, 1] == y0 and edges[e, 0] >= x0)
        if not (ax * by - ay * bx < 0 and is_lowest):
            return _NO_HULL
        length += np.hypot(ax, ay)
        cross = (edges[e, 0] - x0) * (edges[e, 3] - y0) - (edges[e, 2] - x0) * (edges[e, 1] - y0)
        area += cross
        x += cross * (edges[e, 0] + edges[e, 2] - 2 * x0)
        y += cross * (edges[e, 1] + edges[e, 3] - 2 * y0)
    xy[0, 0], xy[0, 1] = x0 + x / (3 * area), y0 + y / (3 * area)
    e, begin = 0, 0.0
    for k in range(len(around)):
        place = length * k / len(around)
        own = np.hypot(edges[e, 2] - edges[e, 0], edges[e, 3] - edges[e, 1])
        while place > begin + own and e + 1 < count:
            begin += own
            e += 1
            own = np.hypot(edges[e, 2] - edges[e, 0], edges[e, 3] - edges[e, 1])
        share = (place - begin) / own
        around[k, 0] = edges[e, 0] + share * (edges[e, 2] - edges[e, 0])
        around[k, 1] = edges[e, 1] + share * (edges[e, 3] - edges[e, 1])
    return _sample_inside(around, xy)


@dataclass(frozen=True, eq=False)
class SeenShares:
    """How much of N objects a frame could see, as shares of the samples, shape (N,) each.

    Attributes:
        visible: samples whose rays ended at the object or behind it.
        through: samples whose rays ended behind the whole object.
        beyond: samples whose rays ended behind the sample itself. Where an object on a wall is
            gone, rays hit the wall, which is not behind the whole object by the tolerance.
    """

    visible: NDArray[np.float64]
    through: NDArray[np.float64]
    beyond: NDArray[np.float64]

    def lists(self) -> tuple[list[float], list[float], list[float]]:
        """Return them as lists, which are faster to read one by one."""
        return self.visible.tolist(), self.through.tolist(), self.beyond.tolist()


def visible_shares(
    view: DepthView,
    samples: SamplePoints,
    heights: NDArray[np.float64],
    tolerance: float,
    rows: IntArray | None = None,
    detected_from: NDArray[np.float64] | None = None,
) -> SeenShares:
    """Return how much of each object a frame could see, and how much it saw through.

    Samples of each object are projected into the depth image. A ray that ended before the object
    shows an occlusion; one that ended behind it passed through its place. Objects too small or too
    far away to be detected have no visible samples, unless they were detected from there.

    Args:
        view: where the frame's rays ended.
        samples: of the N objects.
        heights: lowest and highest point of each object [m], shape (N, 2).
        tolerance: error of the measured surface of an object [m].
        rows: of the objects to look at; None for all.
        detected_from: up to which distance each of these is known to be detected [m], however
            small it is, shape (R,); None for none.
    """
    rows = np.arange(len(heights)) if rows is None else rows
    detected_from = np.zeros(len(rows)) if detected_from is None else detected_from
    found = np.empty((3, len(rows)))
    _count_seen(
        view.reach,
        view.camera.K,
        view.map_T_camera,
        samples.around,
        samples.xy,
        samples.widths,
        heights,
        rows,
        detected_from,
        tolerance,
        _FEWEST_RAYS / view.every**2,
        found,
    )
    return SeenShares(*found)


@loop()
def _count_seen(
    reach: NDArray[np.float32],
    K: NDArray[np.float64],
    map_T_camera: NDArray[np.float64],
    around: NDArray[np.float64],
    xy: NDArray[np.float64],
    widths: NDArray[np.float64],
    heights: NDArray[np.float64],
    rows: IntArray,
    detected_from: NDArray[np.float64],
    tolerance: float,
    fewest: float,
    found: NDArray[np.float64],
) -> None:
    """Find the shares of `visible_shares`.

    Args:
        reach: of the view, as its `K` and `map_T_camera`.
        K: likewise.
        map_T_camera: likewise.
        around: of the samples of each object, shape (N, 8, 2).
        xy: likewise, shape (N, 9, 2).
        widths: likewise, shape (N,).
        heights: as in `visible_shares`, as `rows` and `tolerance`.
        rows: likewise.
        detected_from: likewise.
        tolerance: likewise.
        fewest: rays that must be able to hit an object; smaller ones are not detected otherwise.
        found: filled with the shares, shape (3, R).
    """
    T = map_T_camera
    for n in range(len(rows)):
        i = rows[n]
        nearest, farthest, mean = np.inf, 0.0, 0.0
        for k in range(around.shape[1]):
            far = np.hypot(around[i, k, 0] - T[0, 3], around[i, k, 1] - T[1, 3])
            nearest, farthest = min(nearest, far), max(farthest, far)
            mean += far / around.shape[1]
        size = widths[i] * (heights[i, 1] - heights[i, 0])
        visible = through = beyond = 0
        is_large = size * K[0, 0] * K[1, 1] / max(mean, 1e-3) ** 2 >= fewest
        if is_large or nearest <= detected_from[n]:
            for k in range(xy.shape[1]):
                x, y = xy[i, k, 0] - T[0, 3], xy[i, k, 1] - T[1, 3]
                own = np.hypot(x, y)
                for share in _HEIGHTS:
                    z = heights[i, 0] + (heights[i, 1] - heights[i, 0]) * share - T[2, 3]
                    far = _reach_towards(reach, K, T, x, y, z)
                    # Without a return, the comparisons with NaN are false: not visible.
                    visible += far >= nearest - tolerance
                    through += far > farthest + tolerance
                    beyond += far > own + tolerance
        count = xy.shape[1] * len(_HEIGHTS)
        found[0, n], found[1, n] = visible / count, through / count
        found[2, n] = beyond / count


@inner_loop()
def _reach_towards(
    reach: NDArray[np.float32],
    K: NDArray[np.float64],
    map_T_camera: NDArray[np.float64],
    x: float,
    y: float,
    z: float,
) -> float:
    """Return how far the ray towards a point went, as `DepthView.reach_towards` does.

    Args:
        reach: of the view, as its `K` and `map_T_camera`.
        K: likewise.
        map_T_camera: likewise.
        x: of the point, from the camera, along the axes of the map [m].
        y: likewise.
        z: likewise.
    """
    T = map_T_camera
    ahead = x * T[0, 2] + y * T[1, 2] + z * T[2, 2]
    if not ahead > NEAREST:
        return np.nan
    col = np.rint(K[0, 0] * (x * T[0, 0] + y * T[1, 0] + z * T[2, 0]) / ahead + K[0, 2])
    row = np.rint(K[1, 1] * (x * T[0, 1] + y * T[1, 1] + z * T[2, 1]) / ahead + K[1, 2])
    if not (0 <= col < reach.shape[1] and 0 <= row < reach.shape[0]):
        return np.nan
    return float(reach[int(row), int(col)])
