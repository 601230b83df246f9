"""The color of an object in one frame."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import IntArray

Rgb: TypeAlias = tuple[int, int, int]
"""A color in sRGB, 0..255 each."""

_SAME_PAINT = 0.06  # difference in the share of a channel
_UNIFORM = 0.75  # share of an object's pixels that must be of one paint
_MOST = 256  # pixels; more of them change the median by less than the noise of a camera


def some_of(pixels: IntArray) -> IntArray:
    """Return some pixels of an object, which are enough for its color.

    Args:
        pixels: row-major indices, increasing, shape (N,).
    """
    return pixels[:: max(1, -(-len(pixels) // _MOST))].copy()


def median_color(color: NDArray[np.uint8], pixels: IntArray) -> Rgb | None:
    """Return the median of each channel over some pixels; None if they are of several colors.

    The median of a plant may be that of its pot in one view, and that of its leaves in another.

    Args:
        color: RGB, shape (H, W, 3).
        pixels: row-major indices, at least one, shape (N,).
    """
    some = color.reshape(-1, 3)[pixels]
    median = np.sort(some, axis=0)[len(some) // 2]
    is_alike = np.abs(_chromaticity(some) - _chromaticity(median)).max(axis=-1) < _SAME_PAINT
    if is_alike.mean() < _UNIFORM:
        return None
    red, green, blue = median.tolist()
    return red, green, blue


def _chromaticity(rgb: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Return the share of each channel, whatever the brightness, shape (..., 3)."""
    levels = rgb.astype(np.float64) + 1.0
    return np.asarray(levels / levels.sum(axis=-1, keepdims=True))
