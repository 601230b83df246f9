"""Masks as run lengths, in both of COCO's forms."""

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


def from_text(text: str) -> list[int]:
    """Return the run lengths in COCO's compressed form.

    A character holds five bits of a number, the lowest first, and whether more follow. From the
    fourth on, a number is the difference from the one two places before.

    Source: `rleFrString` of COCO's mask API.

    Raises:
        ValueError: If it is not such a text.

    >>> from_text("021O")
    [0, 2, 1, 1]
    """
    counts: list[int] = []
    number = shift = 0
    for character in text:
        bits = ord(character) - ord("0")
        if not 0 <= bits < 64 or shift > 30:
            raise ValueError("expected counts as COCO's mask API writes them, a list or a text")
        number |= (bits & 0x1F) << shift
        shift += 5
        if bits & 0x20:
            continue
        if bits & 0x10:  # negative, in two's complement
            number -= 1 << shift
        counts.append(number + (counts[-2] if len(counts) > 2 else 0))
        number = shift = 0
    if shift:
        raise ValueError("the text of a mask's counts is cut off")
    return counts
