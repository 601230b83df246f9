"""From points to their footprint on the floor."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from hypermap._loops import loop
from hypermap.core.arrays import FloatArray, IntArray
from hypermap.perception.outline import outer_xy

DENSE = 16  # cells per point up to which a whole grid is faster than sorting the points


def footprint(points_xyz: FloatArray, voxel_size: float) -> Polygon:
    """Return the convex hull of points on the floor, thinned to one point per cell.

    Args:
        points_xyz: finite points in the map frame [m], shape (N, 3).
        voxel_size: side of the floor's square cells [m].

    Returns:
        Polygon in the map frame [m]; empty if the points are on one line.

    Source: PCL 1.13, `VoxelGrid` and `ConvexHull` of the points projected to the floor.

    >>> corners = np.array([[0, 0, 1], [2, 0, 3], [2, 1, 0], [0, 1, 5], [1, 0.5, 2]])
    >>> footprint(corners, voxel_size=0.01).area
    2.0
    """
    centroids = outer_xy(voxel_centroids(points_xyz[:, :2], voxel_size))
    if len(centroids) < 3:
        return Polygon()
    # A line through the points is built faster than the points one by one.
    hull = shapely.convex_hull(shapely.linestrings(centroids))
    return hull if isinstance(hull, Polygon) else Polygon()


def voxel_centroids(points_xy: FloatArray, voxel_size: float) -> NDArray[np.float64]:
    """Return the centroid of the points in each occupied cell of a square grid.

    Args:
        points_xy: finite points [m], shape (N, 2).
        voxel_size: side of the cells [m]; the grid has a corner at the origin.

    Returns:
        Shape (M, 2), in the order of the cells.

    >>> voxel_centroids(np.array([[0.1, 0.1], [0.3, 0.1], [1.5, 0.0]]), voxel_size=1.0)
    array([[0.2, 0.1],
           [1.5, 0. ]])
    """
    if len(points_xy) == 0:
        return np.empty((0, 2))
    cell, rows = np.empty((2, len(points_xy)), np.int64)
    count = _number_cells(points_xy, points_xy.dtype.type(1 / voxel_size), cell, rows)
    if count > DENSE * len(cell):
        occupied, cell = np.unique(cell, return_inverse=True)
        count = len(occupied)
    most = min(count, len(cell))
    points, centroids = np.zeros(most), np.zeros((most, 2))
    found = _average_cells(points_xy, cell, np.zeros(count, np.int32), points, centroids)
    return centroids[:found]


@loop()
def _number_cells(
    points_xy: FloatArray, per_meter: np.floating[Any], columns: IntArray, rows: IntArray
) -> int:
    """Fill `columns` with the number of each point's cell, column by column.

    Args:
        points_xy: as in `voxel_centroids`.
        per_meter: cells.
        columns: receives these numbers, shape (N,).
        rows: buffer for the rows, shape (N,).

    Returns:
        How many cells there are.
    """
    left, bottom = np.inf, np.inf
    right, top = -np.inf, -np.inf
    for i in range(len(points_xy)):
        column = np.float64(np.floor(points_xy[i, 0] * per_meter))
        row = np.float64(np.floor(points_xy[i, 1] * per_meter))
        left, right = min(left, column), max(right, column)
        bottom, top = min(bottom, row), max(top, row)
        columns[i], rows[i] = column, row
    first_column, first_row, height = int(left), int(bottom), int(top) - int(bottom) + 1
    count = (int(right) - first_column + 1) * height
    for i in range(len(columns)):
        columns[i] = (columns[i] - first_column) * height + rows[i] - first_row
    return count


@loop()
def _average_cells(
    points_xy: FloatArray,
    cell: IntArray,
    slots: NDArray[np.int32],
    points: NDArray[np.float64],
    centroids: NDArray[np.float64],
) -> int:
    """Fill in the centroid of the points in each occupied cell, in the order of the cells.

    Args:
        points_xy: as in `voxel_centroids`.
        cell: number of each point's cell, shape (N,).
        slots: zeros, as many as cells.
        points: zeros, at least as many as occupied cells.
        centroids: zeros, shape (M, 2) for as many points.

    Returns:
        How many cells are occupied.
    """
    for i in range(len(cell)):
        slots[cell[i]] = 1
    found = 0
    for i in range(len(slots)):
        if slots[i] > 0:
            slots[i] = found
            found += 1
    for i in range(len(cell)):
        slot = slots[cell[i]]
        points[slot] += 1
        centroids[slot, 0] += points_xy[i, 0]
        centroids[slot, 1] += points_xy[i, 1]
    for slot in range(found):
        centroids[slot, 0] /= points[slot]
        centroids[slot, 1] /= points[slot]
    return found
