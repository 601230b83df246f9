"""Numbers as colors: from dark blue over green to yellow, readable for the color-blind too."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Five colors of matplotlib's map "viridis", evenly spaced.
_STOPS = np.array([(68, 1, 84), (59, 82, 139), (33, 145, 140), (94, 201, 98), (253, 231, 37)])
_ALPHA = 170  # walls below stay visible


def colored(cells: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return the color of each cell, shape (height, width, 4); transparent where it is NaN."""
    low, high = _range(cells)
    share = (cells.astype(np.float64) - low) / (high - low) if high > low else np.zeros(cells.shape)
    known = ~np.isnan(cells)
    rgba = np.zeros((*cells.shape, 4), dtype=np.uint8)
    rgba[known, :3] = _color(share[known])
    rgba[known, 3] = _ALPHA
    return rgba


def legend(cells: NDArray[np.float32]) -> list[tuple[float, tuple[int, int, int]]]:
    """Return some numbers from the highest to the lowest, and their colors on white ground."""
    if np.isnan(cells).all():
        return []
    low, high = _range(cells)
    shares = np.linspace(1, 0, len(_STOPS)) if high > low else np.zeros(1)
    values = (low + shares * (high - low)).tolist()
    on_white = 255 - (255 - _color(shares).astype(int)) * _ALPHA // 255
    return [(x, (r, g, b)) for x, (r, g, b) in zip(values, on_white.tolist(), strict=True)]


def _range(cells: NDArray[np.float32]) -> tuple[float, float]:
    known = cells[~np.isnan(cells)]
    return (float(known.min()), float(known.max())) if known.size else (0.0, 0.0)


def _color(share: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return colors, shape (N, 3), of shares between 0 and 1, shape (N,)."""
    places = np.linspace(0, 1, len(_STOPS))
    channels = [np.interp(share, places, channel) for channel in _STOPS.T]
    return np.stack(channels, axis=-1).round().astype(np.uint8)
