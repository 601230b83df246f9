"""What a box cuts out of a surface that runs on past it: cups that touch, a mouse at a chair.

What lies on no plane is held together by small jumps in depth, and the noise hides those between
neighbours. Small things so become part of one large surface that no box encloses.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hypermap._loops import loop
from hypermap.core.arrays import BoolArray, IntArray
from hypermap.perception.config import PerceptionConfig
from hypermap.perception.frame import Camera
from hypermap.perception.surfaces import Surfaces

MIN_FIT = 0.7  # intersection over union of a piece's extent and its box
FILLED = 0.8  # share of the points in a box that lie on one surface, which then is the object
SAME_DEPTH = 4.0  # standard deviations of the depth beyond `max_offset`


def cut_piece(
    surfaces: Surfaces,
    label: int,
    pixels: IntArray,
    fit: float,
    box: NDArray[np.float32],
    camera: Camera,
    config: PerceptionConfig,
) -> IntArray:
    """Return the part of a surface that a box cuts out, if that can be the detected object.

    It can if it fits the box and ends there for the most part, or if the box shows hardly
    anything else. Of background that is seen past an object neither is true.

    Args:
        surfaces: those of the image.
        label: the surface.
        pixels: row-major indices of the valid pixels in the box or mask.
        fit: intersection over union of the box and the surface's extent in it.
        box: xmin, ymin, xmax, ymax [pixels], shape (4,).
        camera: intrinsics.
        config: noise and thresholds.

    Returns:
        Increasing indices out of `pixels`, all at about the same depth; empty if it cannot be.
    """
    piece = pixels[surfaces.labels.ravel()[pixels] == label]
    if len(piece) < FILLED * len(pixels):
        cut, outline = _cut_edges(surfaces.labels, piece, _mask(pixels, surfaces.labels.shape))
        if fit < MIN_FIT or cut > config.max_cut * outline:
            return np.empty(0, dtype=np.int64)
    depths = 1 / surfaces.disparity.ravel()[piece]
    depth = np.median(depths)
    width, height = (box[2] - box[0]) / camera.K[0, 0], (box[3] - box[1]) / camera.K[1, 1]
    max_offset = config.max_offset * max(width, height) * depth
    noise = SAME_DEPTH * config.depth_noise * depth**2
    return np.asarray(piece[np.abs(depths - depth) <= max_offset + noise])


def _mask(pixels: IntArray, shape: tuple[int, ...]) -> BoolArray:
    inside = np.zeros(shape, dtype=bool)
    inside.ravel()[pixels] = True
    return inside


@loop()
def _cut_edges(labels: NDArray[np.int32], piece: IntArray, inside: BoolArray) -> tuple[int, int]:
    """Return at how many edges of its pixels a piece was cut off, and how long its outline is.

    It was cut off where the same surface goes on outside. The outline is that of its extent.
    """
    height, width = labels.shape
    count = 0
    left, top, right, bottom = width, height, 0, 0
    for pixel in piece:
        row, col = pixel // width, pixel % width
        left, top, right, bottom = min(left, col), min(top, row), max(right, col), max(bottom, row)
        for step in range(4):
            y, x = row + (step == 0) - (step == 1), col + (step == 2) - (step == 3)
            if 0 <= y < height and 0 <= x < width and not inside[y, x]:
                count += labels[y, x] == labels[row, col]
    return count, 2 * (right - left + bottom - top + 2)
