"""Frontiers: borders between free and unknown space.

Source: Yamauchi, "A frontier-based approach for autonomous exploration", CIRA 1997.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray, IntArray
from hypermap.core.frames import Pose2D
from hypermap.exploration.sensor import Sensor
from hypermap.exploration.visibility import CLEAR, UNKNOWN, WALL, Visibility
from hypermap.paths import FreeSpace

_AS_GOOD = 0.97  # share of the best heading's gain; of such headings, center the frontier in view
_TRIES = 3  # cells of a frontier for which we look for a viewpoint


@dataclass(frozen=True, eq=False)
class Frontier:
    """A frontier that the robot can reach, in the base frame of the map.

    Attributes:
        points_xy: centers of its cells, which are free and touch unknown ones [m], shape (N, 2).
        size: its length: the number of its cells times the cell size [m].
        place_xy: a cell near its middle that is visible from `pose` [m], shape (2,).
        pose: the viewpoint: where the robot can stand, facing the frontier.
        distance: length of the shortest path to the viewpoint [m].
        gain: unknown area that would be seen from there if nothing were in the way [m2].
    """

    points_xy: NDArray[np.float64]
    size: float
    place_xy: NDArray[np.float64]
    pose: Pose2D
    distance: float
    gain: float


def find_frontiers(
    space: FreeSpace, meters: NDArray[np.float32], sensor: Sensor, least_size: float
) -> Iterator[Frontier]:
    """Yield the frontiers that a robot can reach and see.

    Args:
        space: the free space of the robot.
        meters: length of the path to each cell, shape (height, width).
        sensor: its range and field of view.
        least_size: minimum length of a frontier [m].
    """
    grid = space.grid
    cells = np.full(grid.shape, CLEAR, dtype=np.uint8)
    cells[space.unknown] = UNKNOWN
    cells[space.occupied] = WALL
    visibility = Visibility(grid, cells, sensor.max_range, sensor.min_range)
    allowed = cells == CLEAR
    if space.kept_out is not None:
        allowed &= ~space.kept_out
    least = max(1, round(least_size / grid.resolution))
    longest = sensor.max_range / grid.resolution
    for piece in pieces(frontier_cells(allowed, space.unknown), least, longest):
        seen = _seen_from(visibility, meters, piece, sensor.min_range / grid.resolution)
        if seen is None:
            continue
        middle, stand = seen
        heading, count = _best_heading(visibility, stand, middle, sensor.fov)
        place, (x, y) = grid.centers(*np.array(seen).T)
        yield Frontier(
            points_xy=grid.centers(*piece.T),
            size=len(piece) * grid.resolution,
            place_xy=place,
            pose=Pose2D(float(x), float(y), math.remainder(grid.origin.yaw + heading, math.tau)),
            distance=float(meters[tuple(stand)]),
            gain=count * grid.resolution**2,
        )


def frontier_cells(free: BoolArray, unknown: BoolArray) -> BoolArray:
    """Return which free cells touch unknown ones, shape (height, width).

    Everything off the grid is unknown.
    """
    touching = np.zeros_like(unknown)
    touching[1:] |= unknown[:-1]
    touching[:-1] |= unknown[1:]
    touching[:, 1:] |= unknown[:, :-1]
    touching[:, :-1] |= unknown[:, 1:]
    touching[[0, -1]] = True
    touching[:, [0, -1]] = True
    return free & touching


def pieces(cells: BoolArray, least: int, longest: float) -> Iterator[IntArray]:
    """Yield the connected components (8 neighbors) of cells as (row, col), shape (N, 2).

    A long frontier is halved along its main axis until each piece fits into view from one place.

    Args:
        cells: shape (height, width).
        least: minimum number of cells of a piece.
        longest: maximum extent of a piece [cells].

    Source: halving along the main axis is that of Zhou, Zhang, Chen, Shen, "FUEL: Fast UAV
    exploration using incremental frontier structure and hierarchical planning", RA-L 2021.
    """
    labels, _ = scipy.ndimage.label(cells, np.ones((3, 3)))
    rows, cols = np.nonzero(cells)
    owners = labels[rows, cols]
    large = np.bincount(owners)[owners] >= least
    order = np.argsort(owners[large], kind="stable")
    places = np.column_stack([rows[large], cols[large]])[order]
    waiting = np.split(places, np.flatnonzero(np.diff(owners[large][order])) + 1)
    while waiting:
        piece = waiting.pop()
        if len(piece) < least:
            continue
        offsets = piece - piece.mean(axis=0)
        _, axes = np.linalg.eigh(offsets.T @ offsets)
        along = offsets @ axes[:, -1]
        if np.ptp(along) <= longest:
            yield piece
        else:
            waiting += [piece[along < 0], piece[along >= 0]]


def _seen_from(
    visibility: Visibility, meters: NDArray[np.float32], piece: IntArray, nearest: float
) -> tuple[IntArray, IntArray] | None:
    """Return a cell near the middle of a frontier, and one that sees it; None if there is none."""
    from_middle = piece[np.argsort(np.hypot(*(piece - piece.mean(axis=0)).T), kind="stable")]
    for middle in from_middle[:: max(1, len(piece) // _TRIES)][:_TRIES]:
        stand = _stand(visibility, meters, middle, nearest)
        if stand is not None:
            return middle, stand
    return None


def _stand(
    visibility: Visibility, meters: NDArray[np.float32], middle: IntArray, nearest: float
) -> IntArray | None:
    """Return the nearest cell that the robot can reach and from which it sees a frontier cell.

    Args:
        visibility: of the grid.
        meters: length of the path to each cell.
        middle: the frontier cell, (row, col).
        nearest: minimum distance from it [cells].
    """
    row, col = middle.tolist()
    seen = visibility.of(row, col, through_unknown=False)
    rows, cols = seen.clear_on(meters.shape)
    far = (rows - middle[0]) ** 2 + (cols - middle[1]) ** 2
    possible = np.flatnonzero(np.isfinite(meters[rows, cols]) & (far >= nearest**2))
    if not len(possible):
        return None
    best = possible[far[possible] == far[possible].min()]
    best = best[np.argmin(meters[rows[best], cols[best]])]
    return np.array([rows[best], cols[best]])


def _best_heading(
    visibility: Visibility, stand: IntArray, middle: IntArray, fov: float
) -> tuple[float, int]:
    """Return the heading that shows the most unknown cells, with the frontier in view.

    Of the headings that show nearly as many, the one that centers the frontier is chosen.

    Returns:
        The direction from the grid's x axis [rad], and how many unknown cells are seen.
    """
    counts = visibility.of(*stand.tolist()).unknown
    up, right = (middle - stand).tolist()
    toward = math.atan2(up, right)
    n = len(counts)
    width = max(1, round(fov / math.tau * n))
    if width >= n:
        return toward, int(counts.sum())
    first = round(toward / math.tau * n) - width + 1  # the frontier is at its end
    sums = np.cumsum(counts[np.arange(first - 1, first + 2 * width - 1) % n])
    seen = sums[width:] - sums[:-width]
    off_center = np.abs(np.arange(width) - (width - 1) / 2)
    best = int(np.argmin(np.where(seen >= _AS_GOOD * seen.max(), off_center, np.inf)))
    return math.tau / n * (first + best + (width - 1) / 2), int(seen[best])
