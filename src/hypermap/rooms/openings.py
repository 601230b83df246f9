"""Gaps in the lines of walls: where a room may end without a door frame."""

from __future__ import annotations

import math

import numpy as np
import scipy
import shapely
from numpy.typing import NDArray
from shapely.geometry import Polygon

from hypermap.core.arrays import ObjectArray

_TURN = math.radians(30)  # a corner that turns less is none
_IN_LINE = math.radians(20)  # a wall that turns less continues across the gap
_SUPPORT = 0.2  # of a line's length is the wall that continues in it at least
_ACROSS = math.radians(75)  # less from a wall runs along that wall and is not a gap


def openings(area: Polygon, tolerance: float, longest: float, wall: float) -> NDArray[np.float64]:
    """Return lines through free space from one corner of walls to another.

    At least one of the two walls continues in the line; the shortest lines come first, and none
    crosses another.

    Args:
        area: the free space, any unit.
        tolerance: what of the walls is noise.
        longest: no line is longer.
        wall: least length of a wall that continues in a line; in a long one, it is a fifth of that.

    Returns:
        Both ends (x, y) of each, shape (N, 2, 2).

    Source: after the observation of Liu and von Wichert (RAS 2014) and of ROSE2 (Luperto et al.,
    2022) that rooms end where the lines of walls go on.
    """
    smooth = shapely.simplify(area, tolerance)
    nothing = np.empty((0, 2, 2))
    if smooth.is_empty:
        return nothing
    corners, walls, lengths = _corners(smooth)
    if len(corners) < 2:
        return nothing
    pairs = scipy.spatial.cKDTree(corners).query_pairs(longest, output_type="ndarray")
    if not len(pairs):
        return nothing
    pairs = np.sort(pairs, axis=1)
    first, second = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))].T
    along = corners[second] - corners[first]
    length = np.hypot(*along.T)
    along /= np.maximum(length, 1e-9)[:, np.newaxis]
    # Cosines of the angles at both ends between the line and both walls, shape (2, N, 2).
    cosines = np.stack(
        [
            np.einsum("nk,nwk->nw", along, walls[first]),
            np.einsum("nk,nwk->nw", -along, walls[second]),
        ]
    )
    least = np.maximum(wall, _SUPPORT * length)[:, np.newaxis]
    stand = np.stack([lengths[first], lengths[second]]) >= least
    good = (length > 0) & (cosines < math.cos(_ACROSS)).all(axis=(0, 2))
    good &= ((cosines < -math.cos(_IN_LINE)) & stand).any(axis=(0, 2))
    first, second, length = first[good], second[good], length[good]
    ends = np.stack([corners[first], corners[second]], axis=1)
    lines: ObjectArray = np.asarray(shapely.linestrings(ends))
    shapely.prepare(smooth)
    free = shapely.covers(smooth, lines)
    ends, lines, length = ends[free], lines[free], length[free]
    # Ties are broken by place.
    middles = ends.mean(axis=1)
    order = np.lexsort((middles[:, 0], middles[:, 1], np.round(length, 6)))
    return ends[_not_crossing(lines, order)]


def _corners(
    area: Polygon,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the corners that reach into an area.

    Returns:
        Places (N, 2), the directions (N, 2, 2) in which the two walls leave each, and the lengths
        (N, 2) of these walls.
    """
    corners, walls, lengths = [], [], []
    oriented = shapely.geometry.polygon.orient(area)  # the area is at the left of each ring
    for ring in (oriented.exterior, *oriented.interiors):
        points = shapely.get_coordinates(ring)[:-1]
        before = np.roll(points, 1, axis=0) - points
        after = np.roll(points, -1, axis=0) - points
        sizes = np.stack([np.hypot(*before.T), np.hypot(*after.T)], axis=1)
        cross = before[:, 1] * after[:, 0] - before[:, 0] * after[:, 1]
        turn = np.arctan2(cross, -(before * after).sum(axis=1))
        reach_in = turn < -_TURN
        units = np.stack([before, after], axis=1) / np.maximum(sizes, 1e-9)[:, :, np.newaxis]
        corners.append(points[reach_in])
        walls.append(units[reach_in])
        lengths.append(sizes[reach_in])
    return np.concatenate(corners), np.concatenate(walls), np.concatenate(lengths)


def _not_crossing(lines: ObjectArray, order: NDArray[np.int64]) -> list[int]:
    """Return lines in an order, without those that cross an earlier one."""
    crossed: dict[int, list[int]] = {}
    pairs = shapely.STRtree(lines).query(lines, predicate="crosses")
    for one, other in pairs.T.tolist():
        crossed.setdefault(one, []).append(other)
    taken: set[int] = set()
    kept = []
    for i in order.tolist():
        if taken.isdisjoint(crossed.get(i, ())):
            taken.add(i)
            kept.append(i)
    return kept
