from __future__ import annotations

import contextlib
import io
import struct
import zlib
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from numpy.typing import NDArray
from PIL import Image

from hypermap.formats.grid import png
from hypermap.formats.grid.png import (
    decode_gray_alpha,
    encode_drawn,
    encode_gray_alpha,
    gray_alpha_size,
)

pictures = npst.arrays(np.uint8, st.tuples(st.integers(1, 9), st.integers(1, 5), st.just(2)))


def in_bands(picture: NDArray[np.uint8], rows: int) -> bytes:
    height, width, _ = picture.shape
    bands = [picture[top : top + rows] for top in range(0, height, rows)]
    return encode_gray_alpha(width, height, bands)


def decoded(content: bytes) -> NDArray[np.uint8]:
    size = gray_alpha_size(content)
    assert size is not None
    return np.concatenate(list(decode_gray_alpha(content, *size)))


@given(pictures, st.integers(1, 4))
def test_pillow_reads_what_we_write(picture: NDArray[np.uint8], rows: int) -> None:
    with Image.open(io.BytesIO(in_bands(picture, rows))) as image:
        assert image.mode == "LA"
        assert np.array_equal(np.asarray(image), picture)


@given(pictures, st.integers(1, 4), st.sampled_from([1, 20, 1 << 20]))
def test_we_read_what_we_write_in_whatever_bands(
    picture: NDArray[np.uint8], rows: int, band_bytes: int
) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(png, "_BAND_BYTES", band_bytes)
        assert np.array_equal(decoded(in_bands(picture, rows)), picture)


def with_filters(picture: NDArray[np.uint8], filters: list[int]) -> bytes:
    """A picture of one band, whose rows say that they have these filters."""
    intact = in_bands(picture, len(picture))
    header, data = intact[:33], bytearray(zlib.decompress(b"".join(png._data(intact))))
    rows = np.frombuffer(data, np.uint8).reshape(len(picture), -1).copy()
    rows[:, 0] = filters
    plain = np.array(filters) == 0
    rows[plain, 1:] = picture.reshape(len(picture), -1)[plain]
    packed = zlib.compress(rows.tobytes())
    chunk = struct.pack(">I", len(packed)) + b"IDAT" + packed
    return header + chunk + struct.pack(">I", zlib.crc32(b"IDAT" + packed)) + intact[-12:]


@given(
    st.lists(st.sampled_from([0, 2]), min_size=1, max_size=9),
    st.sampled_from([8, 1 << 20]),
    st.sampled_from([3, 600]),
)
def test_rows_may_be_filtered_or_not(filters: list[int], band_bytes: int, width: int) -> None:
    rng = np.random.default_rng(len(filters))
    picture = rng.integers(0, 256, (len(filters), width, 2), dtype=np.uint8)
    with pytest.MonkeyPatch.context() as patch:
        content = with_filters(picture, filters)
        patch.setattr(png, "_BAND_BYTES", band_bytes)
        assert np.array_equal(decoded(content), picture)


def test_other_filters_are_left_to_pillow() -> None:
    picture = np.zeros((3, 3, 2), np.uint8)
    with pytest.raises(ValueError, match="unsupported filters"):
        decoded(with_filters(picture, [2, 4, 0]))


@pytest.mark.parametrize("mode", ["L", "RGBA", "P", "1"])
def test_other_kinds_are_left_to_pillow(mode: str) -> None:
    file = io.BytesIO()
    Image.new(mode, (4, 4)).save(file, "PNG")
    assert gray_alpha_size(file.getvalue()) is None
    assert gray_alpha_size(b"BM" + bytes(100)) is None


INTACT = in_bands(np.random.default_rng(0).integers(0, 256, (9, 9, 2), dtype=np.uint8), 4)


@given(st.data())
def test_damage_is_one_of_two_errors(data: Any) -> None:
    content = bytearray(INTACT)
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    cut = bytes(content[: len(content) - data.draw(st.sampled_from([0, 1, 13, 60]))])
    size = gray_alpha_size(cut)
    if size is not None and size[0] * size[1] < 10_000:
        with contextlib.suppress(ValueError, zlib.error):
            list(decode_gray_alpha(cut, *size))


@pytest.mark.parametrize(("shape", "dtype"), [((5, 7, 3), np.uint8), ((6, 4), np.uint16)])
def test_pillow_reads_a_drawn_image_as_it_was(shape: tuple[int, ...], dtype: Any) -> None:
    pixels = np.random.default_rng(1).integers(0, np.iinfo(dtype).max, shape, dtype, endpoint=True)
    for image in (pixels, pixels[::2, ::-1]):
        with Image.open(io.BytesIO(encode_drawn(image))) as read:
            assert np.array_equal(np.asarray(read), image)
