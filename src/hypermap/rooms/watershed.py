"""Watershed of the clearance: free space as basins, with doors where it narrows between two.

Source: the watershed by flooding (Vincent and Soille 1991), on the distance to the nearest wall;
basins are joined while flooding, as in Bormann et al. (ICRA 2016), where the saddle is hardly lower
than the lower of the two peaks.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from hypermap._loops import inner_loop, loop
from hypermap.core.arrays import BoolArray

CONTRACTION = 0.8
"""A door is at most this share as wide as the narrower of the rooms that it joins."""


def clearance(blocked: BoolArray) -> NDArray[np.float32]:
    """Return the distance of each cell's center to the nearest blocked one's, in cells, (H, W)."""
    return scipy.ndimage.distance_transform_edt(~blocked).astype(np.float32)


def basins(far: NDArray[np.float32], widest: float) -> NDArray[np.int32]:
    """Return in which basin of the clearance each cell lies.

    Args:
        far: the clearance, in cells, shape (height, width); 0 where blocked.
        widest: doors are at most so wide, in cells.

    Returns:
        Shape (height, width); 0 where blocked, basins from 1 by their first cell, row by row.
    """
    flat = np.ascontiguousarray(far).ravel()
    cells = np.flatnonzero(flat)
    order = cells[np.argsort(-flat[cells], kind="stable")]
    found = np.full(flat.size, -1, dtype=np.int32)
    parents = np.empty(len(order), dtype=np.int32)
    peaks = np.empty(len(order), dtype=np.float32)
    flood(flat, order, far.shape[1], CONTRACTION, widest / 2, found, parents, peaks)
    return in_order(found.reshape(far.shape))


def in_order(labels: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return labels, (H, W), from 1 on by their first cell, row by row; negative ones become 0."""
    there, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    new = np.zeros(len(there), dtype=np.int32)
    kept = np.flatnonzero(there >= 0)
    new[kept[np.argsort(first[kept])]] = np.arange(1, len(kept) + 1)
    return new[inverse].reshape(labels.shape)


@inner_loop()
def root(parents: NDArray[np.int32], i: int) -> int:
    """Return whom a basin was joined to in the end."""
    while parents[i] != i:
        parents[i] = parents[parents[i]]
        i = parents[i]
    return i


@loop()
def flood(
    far: NDArray[np.float32],
    order: NDArray[np.int64],
    width: int,
    share: float,
    half_widest: float,
    found: NDArray[np.int32],
    parents: NDArray[np.int32],
    peaks: NDArray[np.float32],
) -> int:
    """Fill in the basin of each cell, the highest cells first; return how many there were.

    Args:
        far: the clearance, flat.
        order: cells that are not blocked, by descending clearance.
        width: of the grid.
        share: two basins are one where the saddle is above this share of the lower peak ...
        half_widest: ... or above this.
        found: -1, of the size of `far`; becomes the basin of each cell in `order`.
        parents: one entry per cell in `order`, to be filled.
        peaks: likewise.
    """
    height = far.size // width
    count = 0
    for cell in order:
        row, col = cell // width, cell % width
        value = far[cell]
        best, steepest = -1, np.float32(-1.0)
        for dr in range(-1, 2):
            for dc in range(-1, 2):
                r, c = row + dr, col + dc
                if (dr == 0 and dc == 0) or r < 0 or c < 0 or r >= height or c >= width:
                    continue
                other = r * width + c
                if found[other] >= 0:
                    slope = far[other] - value
                    if dr != 0 and dc != 0:
                        slope *= np.float32(0.70710678)
                    if slope > steepest:
                        best, steepest = other, slope
        if best < 0:
            found[cell] = count
            parents[count] = count
            peaks[count] = value
            count += 1
            continue
        own = root(parents, found[best])
        found[cell] = own
        for side in range(4):
            r = row + (side == 0) - (side == 1)
            c = col + (side == 2) - (side == 3)
            if r < 0 or c < 0 or r >= height or c >= width or found[r * width + c] < 0:
                continue
            theirs = root(parents, found[r * width + c])
            if theirs == own:
                continue
            if value > share * min(peaks[own], peaks[theirs]) or value > half_widest:
                if peaks[theirs] > peaks[own]:
                    parents[own] = theirs
                    own = theirs
                else:
                    parents[theirs] = own
    for cell in order:
        found[cell] = root(parents, found[cell])
    return count


def spread(labels: NDArray[np.int32], blocked: BoolArray) -> NDArray[np.int32]:
    """Return labels in which cells without one, if not blocked, have a neighbor's.

    Args:
        labels: 0 where there is none, shape (height, width).
        blocked: of the same shape; these stay 0.
    """
    result = np.pad(labels, 1)
    flat = result.ravel()
    width = result.shape[1]
    waiting = np.flatnonzero(np.pad((labels == 0) & ~blocked, 1))
    while len(waiting):
        near: Any = np.stack([flat[waiting + step] for step in (-1, 1, -width, width)])
        new = near.max(axis=0)
        if not new.any():
            break
        flat[waiting] = new
        waiting = waiting[new == 0]
    return flat.reshape(result.shape)[1:-1, 1:-1]
