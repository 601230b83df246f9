"""Objects of different classes that are in the same place, of which only one can be real."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.mapping.association import KnownShapes, Rows

_SAME_HEIGHT = 0.5  # height that two things share, over that of both together


def likeness(
    shape: BaseGeometry, heights: tuple[float, float], known: KnownShapes, rows: Rows
) -> NDArray[np.float64]:
    """Return how much some known objects are the same as a shape, whatever their class.

    Args:
        shape: a footprint in the map frame [m].
        heights: its lowest and highest point [m].
        known: all objects.
        rows: those to compare.

    Returns:
        The Jaccard index of the footprints, 0 for what lies above or below: a cup on a table is no
        rival of the table. Shape (N,).
    """
    shared = shapely.area(shapely.intersection(shape, known.shapes[rows]))
    together = shapely.area(shape) + known.areas[rows] - shared
    low, high = known.heights[rows].T
    shared_height = np.minimum(high, heights[1]) - np.maximum(low, heights[0])
    whole_height = np.maximum(high, heights[1]) - np.minimum(low, heights[0])
    is_as_high = shared_height >= _SAME_HEIGHT * whole_height
    return np.asarray(np.where(is_as_high, shared / together, 0.0))
