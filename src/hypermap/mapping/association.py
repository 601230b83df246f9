"""Data association: which tracks an observed shape matches; one function per method.

Each takes the shape, its class, all tracks and the configuration, and returns the rows of the
tracks of that class that match, the best first.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap._loops import loop
from hypermap.mapping.prepared_polygon import PreparedPolygon, shared_area
from hypermap.mapping.stages import EvidenceConfig
from hypermap.mapping.track_shapes import Rows, TrackShapes

_FARTHEST_CORNER = 5.0  # times the margin, the farthest a buffered corner reaches: the miter limit


def jaccard(
    shape: PreparedPolygon, class_: int, tracks: TrackShapes, config: EvidenceConfig
) -> Rows:
    """Match by the Jaccard index (IoU), at least `min_jaccard`."""
    matches = []
    for row in tracks.near(class_, shape.box):
        shared = shared_area(shape, tracks.polygons[row])
        together = shape.area + tracks.polygons[row].area - shared
        matches.append((row, shared / together))
    return _best_first(matches, config.min_jaccard)


def overlap(
    shape: PreparedPolygon, class_: int, tracks: TrackShapes, config: EvidenceConfig
) -> Rows:
    """Match by the overlap coefficient, at least `min_overlap`: shared area over the smaller area.

    Unlike the Jaccard index, it also finds a table of which a frame shows one corner. The larger
    shape is buffered by `slack` [m], so that a thin object still matches when poses are a little
    off, but by at most a quarter of its size, to keep two cups that are close together apart.
    """
    reach = _FARTHEST_CORNER * min(config.slack, math.sqrt(shape.area) / 4)
    xmin, ymin, xmax, ymax = shape.box
    rows = tracks.near(class_, (xmin - reach, ymin - reach, xmax + reach, ymax + reach))
    if len(rows) == 1 and _overlaps(shape, tracks.polygons[rows[0]], config.min_overlap):
        return rows  # as buffered shapes, they share even more
    matches = []
    for row in rows:
        other = tracks.polygons[row]
        if other is shape:
            shared = shape.area
        # Buffering a shape takes longer than everything else here.
        elif other.area > shape.area:
            shared = shared_area(shape, other.cached(_widened, config.slack))
        else:
            shared = shared_area(other, shape.cached(_widened, config.slack))
        least = min(shape.area, other.area)  # 0 for a line that people have drawn
        matches.append((row, shared / least if least else 0.0))
    return _best_first(matches, config.min_overlap)


def radius(
    shape: PreparedPolygon, class_: int, tracks: TrackShapes, config: EvidenceConfig
) -> Rows:
    """Match tracks that intersect a square of half side `radius` [m] around the centroid."""
    center = shapely.get_coordinates(shapely.centroid(shape.geometry))[0]
    low, high = (center - config.radius).tolist(), (center + config.radius).tolist()
    rows = tracks.near(class_, (*low, *high))
    shapes = tracks.geometries(rows)
    is_match = shapely.intersects(shapely.box(*low, *high), shapes)
    distances = shapely.distance(shapely.Point(center), shapes)
    return [rows[i] for i in np.argsort(distances, kind="stable") if is_match[i]]


Association: TypeAlias = Callable[[PreparedPolygon, int, TrackShapes, EvidenceConfig], Rows]

ASSOCIATIONS: Mapping[str, Association] = {
    "jaccard": jaccard,
    "overlap": overlap,
    "radius": radius,
}


def _overlaps(one: PreparedPolygon, other: PreparedPolygon, least: float) -> bool:
    """Return whether two shapes match without slack."""
    shared = one.area if one is other else shared_area(one, other)
    return shared > 0 and shared >= least * min(one.area, other.area)


def _widened(shape: PreparedPolygon, margin: float) -> PreparedPolygon:
    if margin == 0:
        return shape
    distance = min(margin, math.sqrt(shape.area) / 4)
    ring = np.empty((len(shape.edges) + 1, 2))
    if shape.is_ring and _widen_hull(shape.edges, distance, ring):
        return PreparedPolygon.of_ring(ring)
    return PreparedPolygon.of(shapely.buffer(shape.geometry, distance, join_style="mitre"))


@loop()
def _widen_hull(edges: NDArray[np.float64], distance: float, ring: NDArray[np.float64]) -> bool:
    """Widen a convex polygon, as buffering does, but faster; return whether it is one.

    Polygons with sharp corners, which buffering cuts off, are left to it.

    Args:
        edges: of the polygon, as `PreparedPolygon.edges`.
        distance: by which its edges move outward [m].
        ring: filled with the closed ring of the wider polygon [m], shape (E + 1, 2).
    """
    count = len(edges)
    if count < 3:
        return False
    for e in range(count):
        before = e - 1 if e else count - 1
        ax, ay = edges[before, 2] - edges[before, 0], edges[before, 3] - edges[before, 1]
        bx, by = edges[e, 2] - edges[e, 0], edges[e, 3] - edges[e, 1]
        lengths = np.sqrt((ax * ax + ay * ay) * (bx * bx + by * by))
        turn = edges[e, 4] * (ax * by - ay * bx)
        along = 1 + (ax * bx + ay * by) / lengths
        if not (turn > 0 and along >= 2 / _FARTHEST_CORNER**2):
            return False
        # The sum of the outward normals of both edges, as long as it takes to reach both.
        a, b = np.sqrt(ax * ax + ay * ay), np.sqrt(bx * bx + by * by)
        scale = distance * edges[e, 4] / along
        ring[e, 0] = edges[e, 0] + scale * (ay / a + by / b)
        ring[e, 1] = edges[e, 1] - scale * (ax / a + bx / b)
    ring[count, 0], ring[count, 1] = ring[0, 0], ring[0, 1]
    return True


def _best_first(matches: list[tuple[int, float]], least: float) -> Rows:
    """Return the rows that match well enough, the best first; of equals the oldest first.

    Args:
        matches: rows in ascending order, each with its score.
        least: lowest score of a match.
    """
    enough = [match for match in matches if match[1] >= least and match[1] > 0]
    # Rounding in the areas must not decide between two that contain the whole shape.
    enough.sort(key=lambda match: -round(match[1], 9))
    return [row for row, _ in enough]
