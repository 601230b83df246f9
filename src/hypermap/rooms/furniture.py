"""Cells that known objects take: furniture, which divides no room."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import scipy
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import BoolArray
from hypermap.core.grid import GridGeometry

_MARGIN = 1.0  # cells by which an object reaches farther in a grid than its outline
_AROUND = 0.2  # [m]; what is blocked and ends so close to an object is no wall
_SPECK = 0.25  # [m^2]; a smaller group of free cells is no part of a room
_EVERYWHERE = np.ones((3, 3), dtype=bool)


def without_furniture(
    free: BoolArray, outlines: Iterable[BaseGeometry], grid: GridGeometry
) -> BoolArray:
    """Return free cells without specks, and with them those that objects take.

    An object is unchanged where what is free around it hangs together only through it, as where
    its outline reaches through a wall: so nothing is connected that was not.

    Args:
        free: shape (height, width).
        outlines: of the objects, in the layer's frame.
        grid: geometry of the cells.
    """
    free = _without_specks(free, grid.resolution)
    result = free.copy()
    standing = [outline for outline in outlines if not outline.is_empty]
    count = -1
    while len(standing) != count:  # objects between two others are found once these are removed
        count = len(standing)
        standing = [outline for outline in standing if not _cleared(result, free, outline, grid)]
    return result


def _without_specks(free: BoolArray, side: float) -> BoolArray:
    """Return free cells without small groups, as a camera sees between a cupboard and its wall."""
    groups, _ = scipy.ndimage.label(free)
    is_large = np.bincount(groups.ravel()) * side**2 >= _SPECK
    return free & is_large[groups]


def _cleared(free: BoolArray, seen: BoolArray, outline: BaseGeometry, grid: GridGeometry) -> bool:
    """Make the cells of an object free, if that connects nothing; return whether that is done.

    It must be next to cells that were `seen` to be free: no row of objects leads out of a room.
    """
    rows, cols = grid.cells_in(outline.buffer(_MARGIN * grid.resolution))
    if not len(rows):
        return True
    reach = max(2, round(_AROUND / grid.resolution))
    window = (
        slice(max(rows.min() - reach, 0), rows.max() + reach + 1),
        slice(max(cols.min() - reach, 0), cols.max() + reach + 1),
    )
    inside = np.zeros(free[window].shape, dtype=bool)
    inside[rows - window[0].start, cols - window[1].start] = True
    around = ~inside & ~_leading_on(~free[window] & ~inside)
    parts, _ = scipy.ndimage.label(around)
    beside = scipy.ndimage.binary_dilation(inside, _EVERYWHERE) & around
    if len(np.unique(parts[beside])) != 1 or not seen[window][beside].any():
        return False
    free[window] |= inside
    return True


def _leading_on(blocked: BoolArray) -> BoolArray:
    """Return the groups of blocked cells that reach the border of a window, as walls do."""
    groups, count = scipy.ndimage.label(blocked, _EVERYWHERE)
    leads_on = np.zeros(count + 1, dtype=bool)
    for edge in (groups[0], groups[-1], groups[:, 0], groups[:, -1]):
        leads_on[edge] = True
    return blocked & leads_on[groups]
