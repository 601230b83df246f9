"""Color from raw camera formats: Bayer and YUV."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import FormatError


def demosaic(mosaic: NDArray[np.uint8], pattern: str) -> NDArray[np.uint8]:
    """Return the colors of a Bayer mosaic, RGB, uint8, shape (H, W, 3).

    Missing channels are the mean of the nearest neighbors that measure them, also at the borders.

    Args:
        mosaic: shape (H, W).
        pattern: colors of the upper left 2 x 2 pixels, row by row, as "rggb".

    Raises:
        FormatError: If the image is smaller than the pattern.

    >>> demosaic(np.array([[10, 20], [40, 50]], np.uint8), "rggb")[0, 0]
    array([10, 30, 50], dtype=uint8)
    """
    if min(mosaic.shape) < 2:
        height, width = mosaic.shape
        raise FormatError(f"a Bayer image needs 2 x 2 pixels, found {width} x {height}")
    rgb = np.empty((*mosaic.shape, 3), np.uint8)
    for channel, color in enumerate("rgb"):
        measured = np.zeros(mosaic.shape, np.uint16)
        for i in (i for i in range(4) if pattern[i] == color):
            measured[i // 2 :: 2, i % 2 :: 2] = 1
        total, weight = _sum_around(measured * mosaic), _sum_around(measured)
        rgb[..., channel] = np.where(measured, mosaic, (total + weight // 2) // weight)
    return rgb


def _sum_around(values: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """Return the sum of each pixel's 3 x 3 neighbors, with weights 1 2 1 both ways.

    These are bilinear interpolation's: of the neighbors that measured a color, the nearest ones
    weigh alike.
    """
    for _ in range(2):
        padded = np.pad(values, ((1, 1), (0, 0)))
        values = (padded[:-2] + 2 * padded[1:-1] + padded[2:]).T
    return values


def color_of_yuv422(pixels: NDArray[np.uint8], order: str) -> NDArray[np.uint8]:
    """Return an image of packed YUV 4:2:2, in which pairs of pixels share U and V, as RGB.

    Args:
        pixels: bytes, shape (H, W, 2).
        order: of the bytes of two pixels, "uyvy" or "yuyv".

    Returns:
        uint8, shape (H, W, 3).

    Raises:
        FormatError: If the number of columns is odd.

    Source: ITU-R BT.601, luma 16 .. 235, as OpenCV converts it.
    """
    height, width = pixels.shape[:2]
    if width % 2:
        raise FormatError(f"a YUV 4:2:2 image has an even number of columns, found {width}")
    luma = pixels[..., order.index("y")].astype(np.float32)
    shared = pixels[..., 1 - order.index("y")].reshape(height, -1, 2)
    u, v = np.moveaxis(np.repeat(shared.astype(np.float32) - 128, 2, axis=1), -1, 0)
    y = 1.164 * (np.maximum(luma, 16) - 16)
    rgb = np.stack([y + 1.596 * v, y - 0.813 * v - 0.391 * u, y + 2.018 * u], axis=-1)
    return np.asarray(np.clip(np.rint(rgb), 0, 255).astype(np.uint8))
