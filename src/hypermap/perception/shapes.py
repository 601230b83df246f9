"""From points to their shape on the floor."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from hypermap.core.arrays import FloatArray

DENSE = 16  # cells per point up to which a whole grid is faster than sorting the points


def footprint(points_xyz: FloatArray, voxel_size: float) -> Polygon:
    """Return the convex hull of points on the floor, once thinned to one point per cell.

    Args:
        points_xyz: finite points in the map frame [m], shape (N, 3).
        voxel_size: side of the floor's square cells [m].

    Returns:
        Polygon in the map frame [m]; empty if the points lie on one line.

    Source: PCL 1.13, `VoxelGrid` and `ConvexHull` of the points projected to the floor.

    >>> corners = np.array([[0, 0, 1], [2, 0, 3], [2, 1, 0], [0, 1, 5], [1, 0.5, 2]])
    >>> footprint(corners, voxel_size=0.01).area
    2.0
    """
    centroids = voxel_centroids(points_xyz[:, :2], voxel_size)
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
    per_metre = points_xy.dtype.type(1 / voxel_size)
    columns, rows = (np.floor(along * per_metre).astype(np.int64) for along in points_xy.T)
    columns -= columns.min()
    rows -= rows.min()
    height = rows.max() + 1
    cell = columns * height + rows
    if (columns.max() + 1) * height > DENSE * len(cell):
        cell = np.unique(cell, return_inverse=True)[1]
    count = np.bincount(cell)
    occupied = np.flatnonzero(count)
    sums = [np.bincount(cell, along)[occupied] for along in points_xy.T]
    return np.stack(sums, axis=1) / count[occupied, np.newaxis]
