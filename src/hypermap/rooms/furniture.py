"""Cells that known objects take: furniture, which divides no room."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import scipy
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import BoolArray
from hypermap.core.grid import GridGeometry

_MARGIN = 1.0  # cells by which an object reaches farther in a grid than its outline
_EVERYWHERE = np.ones((3, 3), dtype=bool)


def without_furniture(
    free: BoolArray, outlines: Iterable[BaseGeometry], grid: GridGeometry
) -> BoolArray:
    """Return free cells, and with them those that objects take.

    An object is unchanged where what is free around it hangs together only through it, as where
    its outline reaches through a wall: so nothing is connected that was not.

    Args:
        free: shape (height, width).
        outlines: of the objects, in the layer's frame.
        grid: geometry of the cells.
    """
    result = free.copy()
    standing = [outline for outline in outlines if not outline.is_empty]
    count = -1
    while len(standing) != count:  # objects between two others are found once these are removed
        count = len(standing)
        standing = [outline for outline in standing if not _cleared(result, free, outline, grid)]
    return result


def _cleared(free: BoolArray, seen: BoolArray, outline: BaseGeometry, grid: GridGeometry) -> bool:
    """Make the cells of an object free, if that connects nothing; return whether that is done.

    It must be next to cells that were `seen` to be free: no row of objects leads out of a room.
    """
    rows, cols = grid.cells_in(outline.buffer(_MARGIN * grid.resolution))
    if not len(rows):
        return True
    window = (
        slice(max(rows.min() - 2, 0), rows.max() + 3),
        slice(max(cols.min() - 2, 0), cols.max() + 3),
    )
    inside = np.zeros(free[window].shape, dtype=bool)
    inside[rows - window[0].start, cols - window[1].start] = True
    around = free[window] & ~inside
    parts, _ = scipy.ndimage.label(around)
    beside = scipy.ndimage.binary_dilation(inside, _EVERYWHERE) & around
    if len(np.unique(parts[beside])) != 1 or not seen[window][beside].any():
        return False
    free[window] |= inside
    return True
