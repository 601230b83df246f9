"""Why no path leads from one cell to another: where the way is too narrow."""

from __future__ import annotations

import math

import numpy as np
import scipy
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray
from hypermap.paths.free_space import FreeSpace

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
        blocked = blocked | space.unknown
    if not _are_connected(~(blocked | kept_out), ends):
        if _are_connected(~(space.occupied | kept_out), ends):
            return (
                "only unknown cells connect them; a robot may drive through these with "
                "--through-unknown on the command line, unknown_is_free in Python"
            )
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
    return float(steps[low]), _narrow_place(far, float(steps[low]), *np.transpose(ends))


def _narrow_place(
    far: NDArray[np.float64],
    clearance: float,
    first: NDArray[np.int64],
    last: NDArray[np.int64],
) -> NDArray[np.float64]:
    """Return the nearest place that has no more clearance, and beyond which the goal is.

    It borders on what can be reached from the start with more clearance than there.
    """
    wide, _ = scipy.ndimage.label(far > clearance)
    if not wide[tuple(first)]:
        return np.asarray(first[::-1] + 0.5)
    around = wide == wide[tuple(first)]
    beyond, _ = scipy.ndimage.label((far >= clearance) & ~around)
    behind = beyond == beyond[tuple(last)]
    gates = np.argwhere(behind & scipy.ndimage.binary_dilation(around))
    nearest = gates[np.argmin(((gates - first) ** 2).sum(axis=1))]
    return np.asarray(nearest[::-1] + 0.5)


def _are_connected(free: BoolArray, ends: tuple[NDArray[np.int64], NDArray[np.int64]]) -> bool:
    labels, _ = scipy.ndimage.label(free)
    first, last = labels[ends].tolist()
    return bool(first == last != 0)
