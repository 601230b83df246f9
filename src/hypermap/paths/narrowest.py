"""Why no path leads from one cell to another: where the way is too narrow."""

from __future__ import annotations

import itertools
import math

import numpy as np
import scipy
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray
from hypermap.paths.free_space import FreeSpace
from hypermap.paths.segments import line_cost
from hypermap.paths.weighted import cheapest_cells

_GAP = 1e4  # times the cost of another cell has one where the way is narrowest
_ROUNDING = 1e-6  # [m]
_STEP = 0.01  # [m] of a radius that is told


def why_no_path(space: FreeSpace, first: int, last: int) -> str:
    """Return what a smaller robot could do, and where the way is narrowest.

    Args:
        space: where the robot can be; no path leads through it.
        first: number of the first cell.
        last: number of the last cell.
    """
    ends = np.divmod([first, last], space.grid.width)
    kept_out = np.False_ if space.kept_out is None else space.kept_out
    blocked = space.occupied
    if not space.settings.unknown_is_free:
        known, free = (~(cells | kept_out) for cells in (blocked | space.unknown, blocked))
        if not _are_connected(known, ends) and _are_connected(free, ends):
            return (
                "only unknown cells connect them; a robot may drive through these with "
                "--through-unknown on the command line, unknown_is_free in Python"
            )
        blocked = blocked | space.unknown
    if not _are_connected(~(blocked | kept_out), ends):
        keepout = "" if space.kept_out is None else " or keepout zones"
        return f"walls{keepout} separate them"
    far = scipy.ndimage.distance_transform_edt(~blocked) * space.grid.resolution
    far[kept_out] = 0  # to robots of any size, as only their centers stay out
    widest, place = _narrowest(far, ends, space.settings.robot_radius)
    x, y = space.grid.origin.apply(place * space.grid.resolution)[0]
    radius = math.floor((widest - _ROUNDING) / _STEP) * _STEP
    return f"the widest way lets {radius:.2f} m pass and is narrowest at ({x:.2f}, {y:.2f})"


def _narrowest(
    far: NDArray[np.float64], ends: tuple[NDArray[np.int64], NDArray[np.int64]], radius: float
) -> tuple[float, NDArray[np.float64]]:
    """Return the clearance of the widest way [m], and where it has no more: (x, y) in cells."""
    steps = np.unique(far[(far > 0) & (far <= radius + _ROUNDING)])
    low, high = 0, len(steps)  # where only cells of the clearance `steps[low]` and more are left
    while high - low > 1:
        middle = (low + high) // 2
        if _are_connected(far >= steps[middle], ends):
            low = middle
        else:
            high = middle
    cost = np.where(far == steps[low], np.float32(_GAP), np.float32(1))
    cost[far < steps[low]] = np.inf
    first, last = (int(row) * far.shape[1] + int(col) for row, col in np.transpose(ends))
    way = cheapest_cells(cost, first, last)
    assert way is not None  # they are connected
    points = np.column_stack(np.divmod(way, far.shape[1]))[:, ::-1] + 0.5
    costs = [line_cost(cost, *one, *other) for one, other in itertools.pairwise(points)]
    narrow = np.flatnonzero(np.array(costs) > _GAP / 10)
    middle = narrow[len(narrow) // 2]
    return float(steps[low]), points[middle : middle + 2].mean(axis=0)


def _are_connected(free: BoolArray, ends: tuple[NDArray[np.int64], NDArray[np.int64]]) -> bool:
    labels, _ = scipy.ndimage.label(free)
    first, last = labels[ends].tolist()
    return bool(first == last != 0)
