"""Objects of different classes that are in the same place, of which only one can be real."""

from __future__ import annotations

from collections.abc import Iterable

from hypermap.mapping.known_shapes import KnownShapes
from hypermap.mapping.outlines import Outline, shared_area

_SAME_HEIGHT = 0.5  # height that two things share, over that of both together


def likeness(
    shape: Outline, heights: tuple[float, float], known: KnownShapes, rows: Iterable[int]
) -> list[float]:
    """Return how much some known objects are the same as a shape, whatever their class.

    Args:
        shape: a footprint in the map frame [m].
        heights: its lowest and highest point [m].
        known: all objects.
        rows: those to compare.

    Returns:
        The Jaccard index of the footprints, 0 for what lies above or below: a cup on a table is no
        rival of the table. One for each row.
    """
    alike = []
    for row in rows:
        low, high = known.heights[row].tolist()
        shared_height = min(high, heights[1]) - max(low, heights[0])
        whole_height = max(high, heights[1]) - min(low, heights[0])
        if shared_height >= _SAME_HEIGHT * whole_height:
            other = known.outlines[row]
            shared = shared_area(shape, other)
            alike.append(shared / (shape.area + other.area - shared))
        else:
            alike.append(0.0)
    return alike
