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
        shared_height = min(high, heights[1]) - max(low, heights[0])
        whole_height = max(high, heights[1]) - min(low, heights[0])
        if shared_height >= _SAME_HEIGHT * whole_height:
            other = tracks.polygons[row]
            shared = shared_area(shape, other)
            ious.append(shared / (shape.area + other.area - shared))
        else:
            ious.append(0.0)
    return ious
