"""Points of an object with less noise: each is averaged with those beside it on the same surface.

The hull of noisy points is too large, the more so the farther away the thing is: of a thousand
points some lie three standard deviations off.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

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
    rows, columns = np.divmod(pixels, width)
    rows -= rows.min()
    columns -= columns.min()
    disparity = np.zeros((rows.max() + 1, columns.max() + 1), np.float32)
    disparity[rows, columns] = 1 / points_xyz[:, 2]
    means = _means(disparity, rows, columns, config.smoothing, SAME * config.depth_noise)
    return np.asarray(points_xyz * (disparity[rows, columns] / means)[:, np.newaxis])


@njit(cache=True)
def _means(disparity, rows, columns, radius, tolerance):  # type: ignore[no-untyped-def]
    """Return the mean about each pixel of what differs by less than the tolerance, shape (N,)."""
    height, width = disparity.shape
    means = np.empty(len(rows), np.float32)
    for i in range(len(rows)):
        row, col = rows[i], columns[i]
        own = disparity[row, col]
        total, count = 0.0, 0
        for y in range(max(row - radius, 0), min(row + radius + 1, height)):
            for x in range(max(col - radius, 0), min(col + radius + 1, width)):
                d = disparity[y, x]
                if d > 0 and abs(d - own) <= tolerance:
                    total += d
                    count += 1
        means[i] = total / count
    return means
