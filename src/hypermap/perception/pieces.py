"""Cuts an object out of a surface that continues past its box: cups that touch, a mouse at a chair.

Surfaces other than planes end at jumps in depth, and noise hides small jumps between
neighbors. So small objects become part of one large surface that no box encloses.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import IntArray
from hypermap.perception.config import PerceptionConfig
from hypermap.perception.frame import Camera
from hypermap.perception.surfaces import Surfaces

MIN_FIT = 0.7  # intersection over union of a piece's extent and its box
FILLED = 0.8  # a surface with this share of the points in a box is the object
SAME_DEPTH = 4.0  # standard deviations of the depth beyond `max_offset`


def cut_piece(
    surfaces: Surfaces,
    label: int,
    pixels: IntArray,
    farther: int,
    fit: float,
    box: NDArray[np.float32],
    camera: Camera,
    config: PerceptionConfig,
) -> IntArray:
    """Return the part of a surface that a box cuts out, if it can be the detected object.

    It can if it fits the box and mostly ends there, or if the box shows hardly
    anything else. Neither is true of background seen past an object.

    Args:
        surfaces: those of the image.
        label: the surface.
        pixels: row-major indices of the valid pixels in the box or mask.
        farther: how many of its other pixels are measured beyond `max_depth`.
        fit: intersection over union of the box and the surface's extent in it.
        box: xmin, ymin, xmax, ymax [pixels], shape (4,).
        camera: intrinsics.
        config: noise and thresholds.

    Returns:
        Increasing indices from `pixels`, all at about the same depth; empty if it cannot.
    """
    piece = pixels[surfaces.labels.ravel()[pixels] == label]
    if len(piece) < FILLED * (len(pixels) + farther):
        cut, outline = _cut_edges(surfaces.labels, piece, pixels)
        if fit < MIN_FIT or cut > config.max_cut * outline:
            return np.empty(0, dtype=np.int64)
    depths = 1 / surfaces.disparity.ravel()[piece]
    depth = np.median(depths)
    width, height = (box[2] - box[0]) / camera.K[0, 0], (box[3] - box[1]) / camera.K[1, 1]
    max_offset = config.max_offset * max(width, height) * depth
    noise = SAME_DEPTH * config.depth_noise * depth**2
    return np.asarray(piece[np.abs(depths - depth) <= max_offset + noise])


def _cut_edges(labels: NDArray[np.int32], piece: IntArray, pixels: IntArray) -> tuple[int, int]:
    """Return the number of pixel edges where a piece was cut off, and the length of its outline.

    It was cut off where the same surface continues outside. The outline is that of its extent.

    Args:
        labels: the surface of each pixel, shape (H, W).
        piece: row-major indices of its pixels, all of one surface and at least one.
        pixels: those of the box or mask.
    """
    width = labels.shape[1]
    rows, cols = np.divmod(piece, width)
    top, bottom, left, right = rows.min(), rows.max(), cols.min(), cols.max()
    # Include the border, where the same surface may continue.
    goes_on = labels == labels[rows[0], cols[0]]
    goes_on.ravel()[pixels] = False
    around = np.zeros((bottom - top + 3, right - left + 3), dtype=bool)
    low, first = max(top - 1, 0), max(left - 1, 0)
    seen = goes_on[low : bottom + 2, first : right + 2]
    row, col = low - top + 1, first - left + 1
    around[row : row + seen.shape[0], col : col + seen.shape[1]] = seen
    y, x = rows - top + 1, cols - left + 1
    steps = ((0, 1), (0, -1), (1, 0), (-1, 0))
    count = sum(int(np.count_nonzero(around[y + dy, x + dx])) for dy, dx in steps)
    return count, int(2 * (right - left + bottom - top + 2))
