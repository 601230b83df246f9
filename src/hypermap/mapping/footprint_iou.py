"""Intersection over union of footprints, for objects at the same height."""

from __future__ import annotations

from collections.abc import Iterable

from hypermap.mapping.prepared_polygon import PreparedPolygon, shared_area
from hypermap.mapping.track_shapes import TrackShapes

_SAME_HEIGHT = 0.5  # least IoU of two height ranges


def footprint_ious(
    shape: PreparedPolygon, heights: tuple[float, float], tracks: TrackShapes, rows: Iterable[int]
) -> list[float]:
    """Return the Jaccard index of a shape and each of some tracks, whatever their classes.

    Args:
        shape: a footprint in the map frame [m].
        heights: its lowest and highest point [m].
        tracks: the shapes of all tracks.
        rows: of the tracks to compare.

    Returns:
        The Jaccard index of the footprints for each row; 0 if the heights differ, because a cup on
        a table does not compete with the table.
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
