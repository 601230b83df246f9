"""Doors: the lines between two rooms."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray
from shapely.geometry import LineString

from hypermap.core.arrays import BoolArray, FloatArray, IntArray
from hypermap.core.grid import GridGeometry
from hypermap.rooms.rooms import Door

LEAST_WIDTH = 0.3  # [m] nothing fits through less


def doors_between(
    labels: NDArray[np.int32], walls: BoolArray, grid: GridGeometry
) -> tuple[Door, ...]:
    """Return the passages between rooms, each with ids that are labels less one.

    Args:
        labels: shape (height, width), from 1; 0 where there is no room.
        walls: of the same shape.
        grid: geometry of the cells.

    Returns:
        In the order of the ids. A passage is as wide as the widest disc that passes between the
        walls at it, up to half a cell; less than 0.3 m are none.
    """
    rows, cols, pairs, places = [], [], [], []
    for dr, dc in ((0, 1), (1, 0)):
        one, other = labels[: -dr or None, : -dc or None], labels[dr:, dc:]
        meet = (one != other) & (one > 0) & (other > 0)
        r, c = np.nonzero(meet)
        rows.append(r)
        cols.append(c)
        pairs.append(np.sort(np.stack([one[meet], other[meet]], axis=1), axis=1))
        # Both ends of the edge between the two cells, (x, y).
        begin = np.stack([c + dc, r + dr], axis=1)
        places.append(np.stack([begin, begin + np.array([dr, dc])], axis=1))
    row, col = np.concatenate(rows), np.concatenate(cols)
    if not len(row):
        return ()
    far = _distances(row, col, np.pad(walls, 1, constant_values=True))
    border = np.zeros(labels.shape, dtype=bool)
    border[row, col] = True
    groups, _ = scipy.ndimage.label(border, np.ones((3, 3)))
    key = np.column_stack([np.concatenate(pairs), groups[row, col]])
    found, which = np.unique(key, axis=0, return_inverse=True)
    ends = np.concatenate(places).astype(np.float64)
    doors = []
    for number, (low, high, _) in enumerate(found.tolist()):
        here = which.ravel() == number
        line = _straight(ends[here].reshape(-1, 2))
        # The middle of a door of n cells is n / 2 or (n + 1) / 2 away from the nearest blocked one.
        width = (2 * float(far[here].max()) - 0.5) * grid.resolution
        if width < LEAST_WIDTH:
            continue
        meters = np.round(grid.origin.apply(line * grid.resolution), 6)
        doors.append(Door((low - 1, high - 1), LineString(meters), round(width, 6)))
    return tuple(doors)


def _distances(row: IntArray, col: IntArray, walls: BoolArray) -> FloatArray:
    """Return how far some cells are from the nearest wall, in cells.

    Args:
        row: of the cells.
        col: likewise.
        walls: with one more cell on each side.
    """
    borders = walls & scipy.ndimage.binary_dilation(~walls)
    cells = np.column_stack([row, col]) + 1  # as the walls count them
    return np.asarray(scipy.spatial.cKDTree(np.argwhere(borders)).query(cells)[0])


def _straight(points: FloatArray) -> FloatArray:
    """Return the ends of the straight line along points, shape (2, 2)."""
    middle = points.mean(axis=0)
    _, vectors = np.linalg.eigh(np.cov((points - middle).T) if len(points) > 2 else np.eye(2))
    along = (points - middle) @ vectors[:, -1]
    if len(points) <= 2:
        return points
    ends: FloatArray = middle + np.outer([along.min(), along.max()], vectors[:, -1])
    return ends
