"""The RVL code for depth images: runs of zeros, and differences of variable length.

Source: Wilson, "Fast Lossless Depth Image Compression", ISS 2017.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hypermap._loops import loop


@loop()
def decode(words: NDArray[np.uint32], pixels: NDArray[np.uint16]) -> bool:
    """Fill `pixels`, shape (N,), from a code; return whether the code was long enough.

    The code is a row of nibbles, eight to a word with the first one on top. A number takes
    one nibble for each three of its bits, low ones first; a nibble's top bit says "more follows".
    """
    nibble = 0
    at, previous = 0, 0
    while at < len(pixels):
        zeros, nibble = _number(words, nibble)
        if zeros < 0 or at + zeros > len(pixels):
            return False
        at += zeros  # already zero
        nonzeros, nibble = _number(words, nibble)
        if nonzeros < 0 or at + nonzeros > len(pixels) or zeros + nonzeros == 0:
            return False
        for _ in range(nonzeros):
            difference, nibble = _number(words, nibble)
            if difference < 0:
                return False
            previous += (difference >> 1) ^ -(difference & 1)
            pixels[at] = previous
            at += 1
    return True


@loop()
def _number(words: NDArray[np.uint32], nibble: int) -> tuple[int, int]:
    """Return the number that starts at a nibble and the nibble after it; -1 past the end."""
    number, shift = 0, 0
    while nibble < 8 * len(words) and shift < 33:
        bits = (int(words[nibble // 8]) >> (28 - 4 * (nibble % 8))) & 0xF
        number |= (bits & 0x7) << shift
        shift += 3
        nibble += 1
        if bits < 8:
            return number, nibble
    return -1, nibble
