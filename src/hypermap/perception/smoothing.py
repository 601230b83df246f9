"""Points of an object with less noise: each is averaged with those beside it on the same surface.

The hull of noisy points is too large, the more so the farther away the thing is: of a thousand
points some lie three standard deviations off.
"""

from __future__ import annotations

import numpy as np
from numba import uint64
from numpy.typing import NDArray

from hypermap._loops import inner_loop, loop
from hypermap.core.arrays import IntArray
from hypermap.perception.config import PerceptionConfig

SAME = 4.0  # standard deviations of the noise by which points of one surface differ at most


def smoothed(
    points_xyz: NDArray[np.float32], pixels: IntArray, width: int, config: PerceptionConfig
) -> NDArray[np.float32]:
    """Return an object's points, moved along their rays to the mean disparity of their neighbours.

    Neighbours are those of the same object, up to `config.smoothing` pixels away to each side,
    whose disparity differs by no more than noise does.

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
    across = (0,) * (2 * config.smoothing + 1)
    tolerance = SAME * config.depth_noise
    return np.asarray(_smoothed(points_xyz, pixels, width, across, tolerance))


@loop()
def _smoothed(  # type: ignore[no-untyped-def]
    points_xyz: NDArray[np.float32], pixels: IntArray, width: int, across, tolerance: float
) -> NDArray[np.float32]:
    """Do what `smoothed` says, row by row of the part of the image that holds the object.

    Args:
        points_xyz: as there.
        pixels: as there.
        width: as there.
        across: as many items as pixels of a row are averaged; loops over a tuple, whose length is
            known, are unrolled.
        tolerance: by which disparities of one surface differ at most [1/m].
    """
    radius = len(across) // 2
    rows, columns = np.empty(len(pixels), np.int64), np.empty(len(pixels), np.int64)
    top = bottom = pixels[0] // width
    left = right = pixels[0] % width
    for i in range(len(pixels)):
        row = pixels[i] // width
        col = pixels[i] - row * width
        top, left = min(top, row), min(left, col)
        bottom, right = max(bottom, row), max(right, col)
        rows[i], columns[i] = row, col
    top, left = top - radius, left - radius
    height, width = bottom - top + 1 + radius, right - left + 1 + radius
    disparity = np.zeros((height, width), np.float32)
    for i in range(len(pixels)):
        disparity[rows[i] - top, columns[i] - left] = np.float32(1) / points_xyz[i, 2]
    means = np.empty((height, width), np.float32)
    for row in range(radius, height - radius):
        _average(disparity, means, row, across, tolerance)
    moved = np.empty((len(pixels), 3), np.float32)
    for i in range(len(pixels)):
        row, col = rows[i] - top, columns[i] - left
        share = disparity[row, col] / means[row, col]
        for axis in range(3):
            moved[i, axis] = points_xyz[i, axis] * share
    return moved


@inner_loop()
def _average(disparity, means, row, across, tolerance):  # type: ignore[no-untyped-def]
    """Fill a row with the means about its pixels of what differs by no more than the tolerance."""
    width, radius = disparity.shape[1], len(across) // 2
    totals, counts = np.zeros(width, np.float32), np.zeros(width, np.float32)
    begin, end, middle = uint64(radius), uint64(width - radius), uint64(row)
    most, none, one = np.float32(tolerance), np.float32(0), np.float32(1)
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
