from __future__ import annotations

import io
import struct
import zlib

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from hypermap.core.errors import FormatError
from hypermap.recordings.grey_png import decode_grey_png
from hypermap.recordings.pictures import decode_integers

LIMIT = 1_000_000
VALUES = np.random.default_rng(6).integers(0, 2**16, (12, 9)).astype(np.uint16)
VALUES[3:6] = 700  # what filters are good at


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def picture(rows: bytes, width: int = 9, height: int = 12, interlaced: int = 0) -> bytes:
    """Return a PNG file of filtered rows, in two chunks."""
    header = struct.pack(">IIBBBBB", width, height, 16, 0, 0, 0, interlaced)
    packed = zlib.compress(rows)
    half = len(packed) // 2
    chunks = [(b"IHDR", header), (b"tEXt", b"a\0b"), (b"IDAT", packed[:half])]
    chunks += [(b"IDAT", packed[half:]), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunk(*one) for one in chunks)


def filtered(values: NDArray[np.uint16], kinds: list[int]) -> bytes:
    """Return the rows as the specification filters them, byte by byte."""
    size = 2 * values.shape[1]
    above = [0] * (size + 2)
    rows = b""
    for row, kind in zip(values, kinds, strict=True):
        own = [0, 0, *row.astype(">u2").tobytes()]
        rows += bytes([kind])
        for i in range(2, size + 2):
            a, b, c = own[i - 2], above[i], above[i - 2]
            paeth = min((abs(b - c), 0, a), (abs(a - c), 1, b), (abs(a + b - 2 * c), 2, c))[2]
            rows += bytes([(own[i] - (0, a, b, (a + b) // 2, paeth)[kind]) % 256])
        above = own
    return rows


@pytest.mark.parametrize("kinds", [[kind] * 12 for kind in range(5)] + [[0, 1, 2, 3, 4, 4] * 2])
def test_all_filters_are_undone(kinds: list[int]) -> None:
    content = picture(filtered(VALUES, kinds))
    np.testing.assert_array_equal(decode_grey_png(content, LIMIT), VALUES)
    np.testing.assert_array_equal(np.asarray(Image.open(io.BytesIO(content))), VALUES)
    np.testing.assert_array_equal(decode_integers(content), VALUES)


def test_other_pictures_are_left_to_pillow() -> None:
    rows = filtered(VALUES, [1] * 12)
    assert decode_grey_png(picture(rows), max_pixels=107) is None
    assert decode_grey_png(picture(rows, interlaced=1), LIMIT) is None
    for mode in ("L", "RGB"):
        file = io.BytesIO()
        Image.new(mode, (9, 12)).save(file, "PNG")
        assert decode_grey_png(file.getvalue(), LIMIT) is None
    assert decode_grey_png(b"", LIMIT) is None


@pytest.mark.parametrize(
    "content",
    [
        picture(filtered(VALUES, [1] * 12))[:-40],
        picture(filtered(VALUES, [1] * 12)[:-1]),
        picture(filtered(VALUES, [1] * 12)).replace(b"IEND", b"JEND"),
        picture(b"\5" + filtered(VALUES, [1] * 12)[1:]),
        picture(filtered(VALUES, [1] * 12), width=0),
    ],
    ids=["cut off", "a byte too few", "no end", "an unknown filter", "no columns"],
)
def test_damaged_pictures_are_left_to_pillow(content: bytes) -> None:
    assert decode_grey_png(content, LIMIT) is None


def test_a_changed_byte_is_noticed() -> None:
    content = bytearray(picture(filtered(VALUES, [1] * 12)))
    content[100] ^= 4
    assert decode_grey_png(bytes(content), LIMIT) is None
    with pytest.raises(FormatError, match="damaged"):
        decode_integers(bytes(content))
