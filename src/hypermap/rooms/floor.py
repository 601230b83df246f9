"""The floor of rooms: free cells, without what merely stands or shines in them."""

from __future__ import annotations

import numpy as np
import scipy

from hypermap.core.arrays import BoolArray

_RAY = 0.3  # [m] free strips thinner than this and longer than wide come from single rays
_CORNER = 0.3  # [m] so far from wider places it is a corner of these
_LARGEST_FURNITURE = 2.5  # [m]; what is larger away from walls may be a place of its own
_THICK = 0.6  # [m]; furniture may be; a wall between two doors is thinner
_SHADOW = 0.8  # [m] at most is the width of a strip that nobody saw between free cells
_POCKET = 2.0  # [m^2] at most is what nobody saw in a room, behind furniture or a door
_HOLE = 0.3  # [m] at most is a hole in a wall through which such a pocket does not go on
_WALLED = 0.2  # of the border of free cells is occupied at least, or unknown cells are walls
_SURROUNDED = 0.3  # of the outline of such a pocket is next to free cells at least

_ALL, _FIRST, _LAST = slice(None), slice(None, -1), slice(1, None)
# Cells and those next to them, in the four directions.
_NEIGHBORS = (
    ((_FIRST, _ALL), (_LAST, _ALL)),
    ((_LAST, _ALL), (_FIRST, _ALL)),
    ((_ALL, _FIRST), (_ALL, _LAST)),
    ((_ALL, _LAST), (_ALL, _FIRST)),
)


def with_unseen(free: BoolArray, unknown: BoolArray, side: float) -> BoolArray:
    """Return free cells, and with them those that nobody saw in rooms.

    A camera leaves many: the shadows of door posts and furniture. These are narrow strips between
    free cells, or small and mostly surrounded by free cells. Where hardly anything is occupied,
    unknown cells stay: there, they are the walls.

    Args:
        free: shape (height, width).
        unknown: of the same shape.
        side: of a cell [m].
    """
    outline = sum(int((free[a] & ~free[b]).sum()) for a, b in _NEIGHBORS)
    unseen = sum(int((free[a] & unknown[b]).sum()) for a, b in _NEIGHBORS)
    if not unseen or outline - unseen < _WALLED * outline:
        return free
    wide = 2 * round(_SHADOW / 2 / side) + 1
    reach = np.pad(~without_rays(~free, side), wide)
    reach = scipy.ndimage.maximum_filter(reach, wide)
    shadows = scipy.ndimage.minimum_filter(reach, wide)[wide:-wide, wide:-wide]
    return free | (unknown & (shadows | _pockets(free, unknown, side)))


def _pockets(free: BoolArray, unknown: BoolArray, side: float) -> BoolArray:
    """Return small groups of unknown cells, and cells near these, that free ones surround."""
    hole = 2 * round(_HOLE / 2 / side) + 1
    walls = scipy.ndimage.maximum_filter(~free & ~unknown, hole)
    groups, count = scipy.ndimage.label(unknown & ~walls)
    outline, free_outline = np.zeros(count + 1), np.zeros(count + 1)
    for here, there in _NEIGHBORS:
        group = groups[here]
        edge = (group > 0) & (group != groups[there])
        outline += np.bincount(group[edge], minlength=count + 1)
        free_outline += np.bincount(group[edge & free[there]], minlength=count + 1)
    is_pocket = np.bincount(groups.ravel(), minlength=count + 1) * side**2 <= _POCKET
    is_pocket &= free_outline >= _SURROUNDED * outline
    is_pocket[0] = False
    pockets: BoolArray = scipy.ndimage.maximum_filter(is_pocket[groups], hole)
    return pockets


def without_obstacles(blocked: BoolArray, side: float, largest: float) -> BoolArray:
    """Return blocked cells without the groups that touch no border and are small, or furniture.

    Args:
        blocked: shape (height, width).
        side: of a cell [m].
        largest: size of a group that is removed whatever its form [m].
    """
    groups, _ = scipy.ndimage.label(blocked, np.ones((3, 3)))
    boxes = scipy.ndimage.find_objects(groups)
    is_obstacle = np.zeros(len(boxes) + 1, dtype=bool)
    height, width = blocked.shape
    for number, (rows, cols) in enumerate(boxes, start=1):
        if rows.start > 0 and cols.start > 0 and rows.stop < height and cols.stop < width:
            size = max(rows.stop - rows.start, cols.stop - cols.start) * side
            is_obstacle[number] = size < largest or (
                size < _LARGEST_FURNITURE and _is_thick(groups[rows, cols] == number, side)
            )
    return blocked & ~is_obstacle[groups]


def _is_thick(group: BoolArray, side: float) -> bool:
    """Return whether a square of the size of `_THICK` fits into a group of cells."""
    cells = round(_THICK / side)
    fits = scipy.ndimage.minimum_filter(group, cells, mode="constant", cval=0)
    return bool(fits.any())


def without_rays(blocked: BoolArray, side: float) -> BoolArray:
    """Return blocked cells, and with them what only rays of a sensor reach, as through a window.

    Args:
        blocked: shape (height, width).
        side: of a cell [m].
    """
    thick = 2 * round(_RAY / 2 / side) + 1
    corner = 2 * round(_CORNER / side)
    wide = scipy.ndimage.minimum_filter(~blocked, thick, mode="constant", cval=0)
    return blocked | ~scipy.ndimage.maximum_filter(wide, thick + corner, mode="constant", cval=0)
