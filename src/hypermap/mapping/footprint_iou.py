"""Intersection over union of footprints, for objects at the same height."""

from __future__ import annotations

from collections.abc import Iterable

from hypermap.mapping.prepared_polygon import PreparedPolygon, shared_area
from hypermap.mapping.track_shapes import TrackShapes

_SAME_HEIGHT = 0.5  # height range that two objects share, over the range of both together


def footprint_ious(
    shape: PreparedPolygon, heights: tuple[float, float], tracks: TrackShapes, rows: Iterable[int]
) -> list[float]:
    """Return how well tracks match a shape, whatever their class.

    Args:
        shape: a footprint in the map frame [m].
        heights: its lowest and highest point [m].
        tracks: the shapes of all tracks.
        rows: those to compare.

    Returns:
        The Jaccard index of the footprints for each row; 0 for what lies above or below, as a
        cup on a table does not compete with the table.
    """
    ious = []
    for row in rows:
        low, high = tracks.heights[row].tolist()
        if at_same_height((low, high), heights):
            other = tracks.polygons[row]
            shared = shared_area(shape, other)
            ious.append(shared / (shape.area + other.area - shared))
        else:
            ious.append(0.0)
    return ious


def at_same_height(one: tuple[float, float], other: tuple[float, float]) -> bool:
    """Return whether two objects, given by lowest and highest point [m], share enough height."""
    shared = min(one[1], other[1]) - max(one[0], other[0])
    return shared >= _SAME_HEIGHT * (max(one[1], other[1]) - min(one[0], other[0]))
