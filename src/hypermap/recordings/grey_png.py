"""PNG pictures of 16 bit grey values, which most recordings keep depth in.

Pillow reads them, too, but takes longer to undo the filters than to unpack the data.

Source: Portable Network Graphics specification (third edition), W3C, sections 7, 9 and 10.
"""

from __future__ import annotations

import struct
import zlib

import numpy as np
from numba import njit
from numpy.typing import NDArray

_BEGIN = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR"
_HEADER = struct.Struct(">IIBBBBB")  # width, height, depth, color type, three methods
_GREY_16 = (16, 0, 0, 0, 0)
_NONE, _SUB, _UP, _AVERAGE, _PAETH = range(5)


def decode_grey_png(content: bytes, max_pixels: int) -> NDArray[np.uint16] | None:
    """Return the values of a picture, shape (H, W).

    Returns:
        None for any other picture, and for one that is damaged or too large.
    """
    if not content.startswith(_BEGIN) or len(content) < len(_BEGIN) + _HEADER.size:
        return None
    width, height, *kind = _HEADER.unpack_from(content, len(_BEGIN))
    if tuple(kind) != _GREY_16 or not 0 < width * height <= max_pixels:
        return None
    size = height * (1 + 2 * width)
    unpacker = zlib.decompressobj()
    try:
        unpacked = unpacker.decompress(_packed(content), size + 1)
    except (zlib.error, struct.error):
        return None
    if len(unpacked) != size or not unpacker.eof:
        return None
    values = np.empty((height, width), np.uint16)
    rows = np.frombuffer(unpacked, np.uint8).reshape(height, 1 + 2 * width)
    return values if _undo_filters(rows, values) else None


def _packed(content: bytes) -> bytes:
    """Return the packed data of all chunks."""
    packed, at = [], len(_BEGIN) - 8
    kind = b""
    while kind != b"IEND":
        length, kind = struct.unpack_from(">I4s", content, at)
        if kind == b"IDAT":
            packed.append(content[at + 8 : at + 8 + length])
        at += 12 + length
    return b"".join(packed)


@njit(cache=True)
def _undo_filters(rows, values):  # type: ignore[no-untyped-def]
    """Fill in the values, shape (H, W); return whether all rows have known filters.

    Args:
        rows: the filter of each row and its bytes, shape (H, 1 + 2 W).
        values: changed.
    """
    nothing = np.zeros(values.shape[1], np.uint16)
    for row in range(len(rows)):
        above = values[row - 1] if row else nothing
        kind, filtered = rows[row, 0], rows[row, 1:]
        if kind == _SUB:  # by far the most frequent, in a loop of its own
            high = low = np.uint8(0)
            for col in range(values.shape[1]):
                high = np.uint8(high + filtered[2 * col])
                low = np.uint8(low + filtered[2 * col + 1])
                values[row, col] = np.uint16(high) << 8 | low
        elif kind <= _PAETH:
            left = corner = np.uint16(0)
            for col in range(values.shape[1]):
                up = above[col]
                high = filtered[2 * col] + _guess(kind, left >> 8, up >> 8, corner >> 8)
                low = filtered[2 * col + 1] + _guess(kind, left & 255, up & 255, corner & 255)
                left = np.uint16((high & 255) << 8 | (low & 255))
                values[row, col] = left
                corner = up
        else:
            return False
    return True


@njit(cache=True)
def _guess(kind, left, up, corner):  # type: ignore[no-untyped-def]
    """Return what a filter expects a byte to be, by those before it and above."""
    left, up, corner = np.int64(left), np.int64(up), np.int64(corner)
    if kind == _NONE:
        return np.int64(0)
    if kind == _SUB:
        return left
    if kind == _UP:
        return up
    if kind == _AVERAGE:
        return (left + up) // 2
    to_left, to_up = abs(up - corner), abs(left - corner)
    to_corner = abs(left + up - 2 * corner)
    if to_left <= to_up and to_left <= to_corner:
        return left
    return up if to_up <= to_corner else corner
