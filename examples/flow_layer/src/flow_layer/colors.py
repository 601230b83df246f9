"""Directions as colors: once around the circle of hues, so that close directions look alike."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_ALPHA = 170  # walls below stay visible


def colored(headings: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return the color of each heading [rad], shape (..., 4); transparent where it is NaN."""
    known = ~np.isnan(headings)
    rgba = np.zeros((*headings.shape, 4), dtype=np.uint8)
    # Three waves, a third of a turn apart.
    angles = headings[known].astype(np.float64)[:, np.newaxis] - np.radians([0, 120, 240])
    rgba[known, :3] = np.round(127.5 + 105 * np.cos(angles))
    rgba[known, 3] = _ALPHA
    return rgba


def on_white(rgba: NDArray[np.uint8]) -> tuple[int, int, int]:
    """Return what a color looks like on white ground."""
    *color, alpha = rgba.astype(int).tolist()
    red, green, blue = (255 - (255 - part) * alpha // 255 for part in color)
    return red, green, blue
