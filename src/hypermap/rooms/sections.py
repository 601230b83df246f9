"""Cross-sections of free space next to lines: where both walls continue, a line divides nothing."""

from __future__ import annotations

import numpy as np

from hypermap._loops import inner_loop, loop
from hypermap.core.arrays import BoolArray, FloatArray

_REACH = 2.0  # [m] distance of sections to either side of a line, or its length
_ALIKE = 0.15  # of a line's length; tolerance for a wall that continues straight
_SLANTS = np.tan(np.radians([0.0, -15.0, 15.0, -30.0, 30.0]))  # of a corridor to a line across it
_GOES_ON = 0.5  # [m] of wall next to a gap in it
_SECTIONS = 10  # to each side
_STEP = 0.5  # cells from place to place in a section


def across_corridors(lines: FloatArray, walls: BoolArray, side: float) -> BoolArray:
    """Return which lines cross a place whose walls continue on both sides, such as a corridor.

    Beside each end of such a line, and to both sides of it, a wall is where it would be if it went
    straight on, in at least half of the cross-sections: doors of a corridor may take the rest.
    Beside a door, or where a room opens to a corridor, there is no wall on one side at least.

    Args:
        lines: both ends (x, y) in cells, shape (N, 2, 2).
        walls: shape (height, width).
        side: of a cell [m].
    """
    found = np.zeros(len(lines), dtype=bool)
    look(np.ascontiguousarray(lines), walls, _REACH / side, _SLANTS, found)
    return found


def gaps_in_walls(lines: FloatArray, walls: BoolArray, side: float) -> BoolArray:
    """Return which lines fill a gap in a wall: it continues at both ends for at least half a meter.

    Arguments are those of `across_corridors`.
    """
    along = lines[:, 1] - lines[:, 0]
    along /= np.maximum(np.hypot(*along.T), 1e-9)[:, np.newaxis]
    across = np.column_stack([-along[:, 1], along[:, 0]])
    beyond = np.arange(1.5, _GOES_ON / side)[:, np.newaxis]
    found = np.ones(len(lines), dtype=bool)
    for end, direction in ((0, -1), (1, 1)):
        places = lines[:, end, np.newaxis] + direction * beyond * along[:, np.newaxis]
        there = np.zeros(places.shape[:2], dtype=bool)
        for off in (-1, 0, 1):  # cells: a line ends at a corner, so its wall is next to it
            cols, rows = np.floor(places + off * across[:, np.newaxis]).astype(np.int64).T
            cols, rows = np.clip(cols, 0, walls.shape[1] - 1), np.clip(rows, 0, walls.shape[0] - 1)
            there |= walls[rows, cols].T
        found &= there.all(axis=1)
    return found


@loop()
def look(
    lines: FloatArray,
    walls: BoolArray,
    reach: float,
    slants: FloatArray,
    found: BoolArray,
) -> int:
    """Fill in which lines cross a corridor; return how many there are.

    Args:
        lines: both ends (x, y) in cells, shape (N, 2, 2).
        walls: shape (height, width).
        reach: least distance of sections to either side of a line [cells].
        slants: tangents of the angles, against the right one, at which a corridor may be crossed.
        found: shape (N,), to be filled.
    """
    count = 0
    for i in range(len(lines)):
        for slant in slants:
            if goes_on(lines[i], walls, reach, slant, 1.0) and goes_on(
                lines[i], walls, reach, slant, -1.0
            ):
                found[i] = True
                count += 1
                break
    return count


@inner_loop()
def goes_on(
    line: FloatArray, walls: BoolArray, reach: float, slant: float, direction: float
) -> bool:
    """Return whether both walls at the ends of a line go on to one side of it."""
    dx, dy = line[1, 0] - line[0, 0], line[1, 1] - line[0, 1]
    length = np.sqrt(dx * dx + dy * dy)
    dx, dy = dx / length, dy / length
    height, width = walls.shape
    apart = direction * max(reach, length) / _SECTIONS
    for end in (1.0, -1.0):
        there = 0
        for section in range(1, _SECTIONS + 1):
            away = apart * section
            x = (line[0, 0] + line[1, 0]) / 2 + away * (slant * dx - dy)
            y = (line[0, 1] + line[1, 1]) / 2 + away * (slant * dy + dx)
            run = 0.0
            while run <= (0.5 + _ALIKE) * length:
                col, row = int(np.floor(x + end * run * dx)), int(np.floor(y + end * run * dy))
                if row < 0 or col < 0 or row >= height or col >= width or walls[row, col]:
                    break
                run += _STEP
            if abs(run - length / 2) <= _ALIKE * length:
                there += 1
        if 2 * there < _SECTIONS:
            return False
    return True
