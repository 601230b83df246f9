"""Masks as run lengths, in COCO's uncompressed form."""

from __future__ import annotations

import numpy as np

from hypermap.core.arrays import BoolArray


def encode(mask: BoolArray) -> list[int]:
    """Return the run lengths outside, inside, outside, ... a mask (H, W), column by column.

    Source: COCO's "counts"; see its mask API.

    >>> encode(np.array([[True, False], [True, True]]))
    [0, 2, 1, 1]
    """
    pixels = np.concatenate([[False], mask.ravel(order="F")])
    changes = np.flatnonzero(pixels[1:] != pixels[:-1])
    return [int(count) for count in np.diff([0, *changes, mask.size])]


def decode(counts: list[int], height: int, width: int) -> BoolArray:
    """Return the mask (H, W) of run lengths, which add up to its pixels.

    >>> decode([0, 2, 1, 1], 2, 2)
    array([[ True, False],
           [ True,  True]])
    """
    is_inside = np.arange(len(counts)) % 2 == 1
    return np.repeat(is_inside, counts).reshape((height, width), order="F")
