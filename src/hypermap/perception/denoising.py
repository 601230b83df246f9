"""Smooths an object's points: averages each with its neighbors on the same surface.

The hull of noisy points is too large, and more so for distant objects: of a thousand
points, some are three standard deviations off.
"""

from __future__ import annotations

import numpy as np
from numba import uint64
from numpy.typing import NDArray

from hypermap._loops import inner_loop, loop
from hypermap.core.arrays import IntArray
from hypermap.perception.config import PerceptionConfig

SAME = 4.0  # standard deviations of noise between points of one surface, at most


def smoothed(
    points_xyz: NDArray[np.float32], pixels: IntArray, width: int, config: PerceptionConfig
) -> NDArray[np.float32]:
    """Return an object's points, moved along their rays to the mean disparity of their neighbors.

    Neighbors are points of the same object, up to `config.smoothing` pixels to each side,
    whose disparity differs by no more than noise.

    Args:
        points_xyz: the object's points in the optical frame [m], shape (N, 3).
        pixels: their row-major indices in the image, shape (N,).
        width: columns of the image.
        config: noise and distance.

    Returns:
        Shape (N, 3).
    """
    if len(pixels) == 0 or config.smoothing == 0:
        return points_xyz
    radius = config.smoothing
    rows = pixels // width
    columns = pixels - rows * width
    top, left = rows.min() - radius, columns.min() - radius
    rows -= top
    columns -= left
    shape = int(rows.max()) + 1 + radius, int(columns.max()) + 1 + radius
    disparity, means = np.zeros(shape, np.float32), np.empty(shape, np.float32)
    totals, counts = np.empty(shape[1], np.float32), np.empty(shape[1], np.float32)
    moved = np.empty_like(points_xyz)
    across, tolerance = (0,) * (2 * radius + 1), SAME * config.depth_noise
    _smooth(points_xyz, rows, columns, across, tolerance, disparity, means, totals, counts, moved)
    return moved


@loop()
def _smooth(points_xyz, rows, columns, across, tolerance, disparity, means, totals, counts, moved):  # type: ignore[no-untyped-def]
    """Do the work of `smoothed`, row by row of the part of the image that contains the object.

    Args:
        points_xyz: as in `smoothed`.
        rows: of these points in the part of the image, shape (N,).
        columns: likewise.
        across: has as many items as pixels of a row are averaged; the compiler unrolls loops over
            a tuple, since it knows the length.
        tolerance: largest difference between disparities of one surface [1/m].
        disparity: zeros, the size of the part of the image, shape (h, w).
        means: buffer for the mean disparities, shape (h, w).
        totals: buffer for the sums of a row, shape (w,).
        counts: buffer for the number of terms of each sum, shape (w,).
        moved: receives the points, shape (N, 3).
    """
    radius = len(across) // 2
    for i in range(len(rows)):
        disparity[rows[i], columns[i]] = np.float32(1) / points_xyz[i, 2]
    for row in range(radius, len(disparity) - radius):
        _average(disparity, means, row, across, tolerance, totals, counts)
    for i in range(len(rows)):
        share = disparity[rows[i], columns[i]] / means[rows[i], columns[i]]
        for axis in range(3):
            moved[i, axis] = points_xyz[i, axis] * share


@inner_loop()
def _average(disparity, means, row, across, tolerance, totals, counts):  # type: ignore[no-untyped-def]
    """Fill a row with the means around its pixels, of values within the tolerance."""
    width, radius = disparity.shape[1], len(across) // 2
    begin, end, middle = uint64(radius), uint64(width - radius), uint64(row)
    most, none, one = np.float32(tolerance), np.float32(0), np.float32(1)
    for col in range(width):
        totals[col] = counts[col] = none
    for y in range(uint64(row - radius), uint64(row + radius + 1)):
        for col in range(begin, end):  # without branches
            total, count, own = totals[col], counts[col], disparity[middle, col]
            for shift in range(len(across)):
                d = disparity[y, col + uint64(shift) - begin]
                more = d - own  # so that float32 loses no digits
                is_same = (d > 0) & (abs(more) <= most)
                total += more if is_same else none
                count += one if is_same else none
            totals[col], counts[col] = total, count
    for col in range(begin, end):
        means[middle, col] = disparity[middle, col] + totals[col] / counts[col]
