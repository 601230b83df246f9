from __future__ import annotations

import struct
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from hypermap.core.errors import FormatError
from hypermap.recordings.messages.compressed_depth import depth_of_compressed
from hypermap.recordings.messages.images import color_of_compressed, color_of_image, depth_of_image

from .bag_builder import picture

NAN = float("nan")


def message(pixels: NDArray[Any], encoding: str, **changes: Any) -> SimpleNamespace:
    """A sensor_msgs/Image of an array, with some fields changed."""
    fields = {
        "height": pixels.shape[0],
        "width": pixels.shape[1],
        "encoding": encoding,
        "is_bigendian": 0,
        "step": pixels[0].nbytes,
        "data": np.frombuffer(pixels.tobytes(), np.uint8),
    }
    return SimpleNamespace(**(fields | changes))


def compressed(data: bytes, kind: str) -> SimpleNamespace:
    return SimpleNamespace(format=kind, data=np.frombuffer(data, np.uint8))


@pytest.mark.parametrize(
    ("pixels", "encoding", "meters"),
    [
        ([[0, 1, 1500]], "16UC1", [[NAN, 0.001, 1.5]]),
        ([[0, 1, 1500]], "mono16", [[NAN, 0.001, 1.5]]),
        ([[0.0, 0.5, 2.0]], "32FC1", [[NAN, 0.5, 2.0]]),
        ([[np.inf, -np.inf, NAN, -1.0]], "32FC1", [[NAN, NAN, NAN, NAN]]),
    ],
)
@pytest.mark.parametrize("order", ["<", ">"])
def test_depth_is_in_metres_with_nan_for_no_return(
    pixels: list[list[float]], encoding: str, meters: list[list[float]], order: str
) -> None:
    kind = np.dtype(np.float32 if encoding == "32FC1" else np.uint16).newbyteorder(order)
    image = message(np.array(pixels, kind), encoding, is_bigendian=int(order == ">"))
    depth = depth_of_image(image, 1000)
    assert depth.dtype == np.float32
    np.testing.assert_array_equal(depth, np.array(meters, np.float32))


@pytest.mark.parametrize(
    ("encoding", "bytes_", "rgb"),
    [
        ("rgb8", [10, 20, 30], [10, 20, 30]),
        ("bgr8", [10, 20, 30], [30, 20, 10]),
        ("8UC3", [10, 20, 30], [30, 20, 10]),
        ("rgba8", [10, 20, 30, 40], [10, 20, 30]),
        ("bgra8", [10, 20, 30, 40], [30, 20, 10]),
        ("mono8", [10], [10, 10, 10]),
    ],
)
def test_color_is_rgb(encoding: str, bytes_: list[int], rgb: list[int]) -> None:
    pixels = np.array([[bytes_, bytes_]] * 3, np.uint8)
    color = color_of_image(message(pixels, encoding))
    np.testing.assert_array_equal(color, np.array([[rgb, rgb]] * 3, np.uint8))


@pytest.mark.parametrize(
    ("yuv", "rgb"),
    [  # the primaries, from the table of BT.601 at 75 .. 100 %
        ((16, 128, 128), (0, 0, 0)),
        ((235, 128, 128), (255, 255, 255)),
        ((81, 90, 240), (255, 0, 0)),
        ((145, 54, 34), (0, 255, 0)),
        ((41, 240, 110), (0, 0, 255)),
        ((0, 128, 128), (0, 0, 0)),
    ],
)
@pytest.mark.parametrize(
    ("encoding", "order"),
    [("yuv422", "uyvy"), ("uyvy", "uyvy"), ("yuv422_yuy2", "yuyv"), ("yuyv", "yuyv")],
)
def test_packed_yuv_is_rgb(
    yuv: tuple[int, int, int], rgb: tuple[int, int, int], encoding: str, order: str
) -> None:
    y, u, v = yuv
    pair = [u, y, v, y] if order == "uyvy" else [y, u, y, v]
    pixels = np.array([pair * 2] * 2, np.uint8).reshape(2, 4, 2)
    color = color_of_image(message(pixels, encoding))
    assert color.shape == (2, 4, 3)
    assert np.abs(color.astype(int) - rgb).max() <= 2


def test_the_two_pixels_of_a_yuv_pair_have_their_own_brightness() -> None:
    pixels = np.array([[[128, 16], [128, 235]]], np.uint8)
    color = color_of_image(message(pixels, "yuv422"))
    assert color.tolist() == [[[0] * 3, [255] * 3]]


PATTERNS = ["rggb", "bggr", "gbrg", "grbg"]


def bilinear(mosaic: NDArray[np.uint8], pattern: str, row: int, col: int, color: str) -> float:
    """A pixel's color as the textbook has it: measured, or the mean of the nearest that are."""

    def measures(r: int, c: int) -> bool:
        on_image = 0 <= r < mosaic.shape[0] and 0 <= c < mosaic.shape[1]
        return on_image and pattern[2 * (r % 2) + c % 2] == color

    beside = [(row, col - 1), (row, col + 1), (row - 1, col), (row + 1, col)]
    corners = [(row + i, col + j) for i in (-1, 1) for j in (-1, 1)]
    for ring in ([(row, col)], beside, corners):
        found = [float(mosaic[at]) for at in ring if measures(*at)]
        if found:
            return sum(found) / len(found)
    raise AssertionError("every 3 x 3 neighborhood has all colors")


@given(
    hnp.arrays(np.uint8, st.tuples(st.integers(2, 6), st.integers(2, 6))),
    st.sampled_from(PATTERNS),
)
def test_bayer_mosaics_are_interpolated_from_the_nearest_pixels(
    mosaic: NDArray[np.uint8], pattern: str
) -> None:
    color = color_of_image(message(mosaic, f"bayer_{pattern}8"))
    for row, col in np.ndindex(mosaic.shape):
        expected = [bilinear(mosaic, pattern, row, col, channel) for channel in "rgb"]
        np.testing.assert_allclose(color[row, col], expected, atol=0.5)
    deep = color_of_image(message(mosaic.astype(np.uint16) * 256 + 99, f"bayer_{pattern}16"))
    np.testing.assert_array_equal(deep, color)


def test_gray_of_16_bits_keeps_its_upper_byte() -> None:
    color = color_of_image(message(np.array([[0x1234, 0xFFFF]], np.uint16), "mono16"))
    assert color.tolist() == [[[0x12] * 3, [0xFF] * 3]]


@given(
    hnp.arrays(np.uint16, st.tuples(st.integers(1, 5), st.integers(1, 5))),
    st.integers(0, 7),
    st.booleans(),
)
def test_padding_and_byte_order_change_nothing(
    pixels: NDArray[np.uint16], padding: int, is_bigendian: bool
) -> None:
    ordered = pixels.astype(">u2" if is_bigendian else "<u2")
    rows = ordered.view(np.uint8).reshape(len(pixels), -1)
    padded = np.pad(rows, ((0, 0), (0, padding)), constant_values=255)
    image = message(
        pixels, "16UC1", is_bigendian=int(is_bigendian), step=padded.shape[1], data=padded.ravel()
    )
    expected = depth_of_image(message(pixels, "16UC1"), 1000)
    np.testing.assert_array_equal(depth_of_image(image, 1000), expected)


GRAY = np.zeros((2, 3), np.uint16)


@pytest.mark.parametrize(
    ("image", "text"),
    [
        (
            message(GRAY, "8UC1"),
            "expected a depth image of encoding 16UC1 or 32FC1, found '8UC1'",
        ),
        (message(GRAY, "16UC1", width=0), "the image has 0 x 2 pixels"),
        (
            message(GRAY, "16UC1", data=np.zeros(11, np.uint8)),
            "an image of 3 x 2 pixels of 16UC1 needs rows of 6 bytes, found 11 bytes in rows of 6",
        ),
        (
            message(GRAY, "16UC1", step=5),
            "an image of 3 x 2 pixels of 16UC1 needs rows of 6 bytes, found 12 bytes in rows of 5",
        ),
        (
            message(GRAY, "32FC1", width=4_000_000_000),
            "an image of 4000000000 x 2 pixels of 32FC1 needs rows of 16000000000 bytes, found 12 "
            "bytes in rows of 6",
        ),
    ],
)
def test_depth_that_cannot_be_read_is_an_error(image: SimpleNamespace, text: str) -> None:
    with pytest.raises(FormatError) as caught:
        depth_of_image(image, 1000)
    assert str(caught.value) == text


def test_color_of_another_encoding_is_an_error_with_a_remedy() -> None:
    with pytest.raises(FormatError) as caught:
        color_of_image(message(GRAY, "nv21"))
    assert str(caught.value) == (
        "color images of encoding 'nv21' cannot be read, only rgb8, bgr8, 8UC3, rgba8, bgra8, "
        "8UC4, mono8, 8UC1, mono16, yuv422, uyvy, yuv422_yuy2, yuyv and bayer_*; record a topic "
        "that image_proc has converted"
    )


@pytest.mark.parametrize(
    ("image", "text"),
    [
        (
            message(np.zeros((2, 3, 2), np.uint8), "yuyv"),
            "a YUV 4:2:2 image has an even number of columns, found 3",
        ),
        (
            message(np.zeros((1, 3), np.uint8), "bayer_grbg8"),
            "a Bayer image needs 2 x 2 pixels, found 3 x 1",
        ),
    ],
)
def test_raw_color_of_impossible_size_is_an_error(image: Any, text: str) -> None:
    with pytest.raises(FormatError) as caught:
        color_of_image(image)
    assert str(caught.value) == text


def test_compressed_color_is_what_the_picture_shows() -> None:
    pixels = np.arange(36, dtype=np.uint8).reshape(3, 4, 3)
    np.testing.assert_array_equal(color_of_compressed(compressed(picture(pixels), "png")), pixels)


def test_quantised_depth_comes_back_by_the_transports_formula() -> None:
    # The transport's own defaults: depth_quantization 100 and depth_max 10 give
    # A = 100 * 101 and B = 1 - A / 10; depth 2 m is kept as A / 2 + B = 4041.
    quantized = np.array([[0, 4041, 9091]], np.uint16)
    data = struct.pack("<iff", 0, 10100, -1009) + picture(quantized)
    depth = depth_of_compressed(compressed(data, "32FC1; compressedDepth"), 1000)
    np.testing.assert_array_equal(depth, np.float32([[NAN, 2.0, 1.0]]))


@pytest.mark.parametrize("kind", ["16UC1; png compressed ", "png"])
def test_a_png_of_depth_is_read(kind: str) -> None:
    depth = depth_of_compressed(compressed(picture(np.array([[0, 1500]], np.uint16)), kind), 1000)
    np.testing.assert_array_equal(depth, np.float32([[NAN, 1.5]]))
    with pytest.raises(FormatError, match="expected a depth image of 16 bits, found a picture of"):
        depth_of_compressed(compressed(picture(np.array([[0, 150]], np.uint8)), kind), 1000)


def rvl(pixels: NDArray[np.uint16]) -> bytes:
    """Encode as Wilson's paper lists it, but by collecting nibbles."""
    nibbles: list[int] = []

    def put(number: int) -> None:
        while True:
            number, low = number >> 3, number & 7
            nibbles.append(low | (8 if number else 0))
            if not number:
                return

    flat, at, previous = pixels.ravel().astype(int), 0, 0
    while at < len(flat):
        end = at
        while end < len(flat) and flat[end] == 0:
            end += 1
        put(end - at)
        at = end
        while end < len(flat) and flat[end] != 0:
            end += 1
        put(end - at)
        for value in flat[at:end]:
            difference = int(value) - previous
            put(2 * difference if difference >= 0 else -2 * difference - 1)
            previous = int(value)
        at = end
    nibbles += [0] * (-len(nibbles) % 8)
    words = [
        sum(nibble << (28 - 4 * k) for k, nibble in enumerate(nibbles[i : i + 8]))
        for i in range(0, len(nibbles), 8)
    ]
    return struct.pack(f"<{len(words)}I", *words)


def rvl_message(code: bytes, width: int, height: int) -> SimpleNamespace:
    data = struct.pack("<iffII", 0, 0, 0, width, height) + code
    return compressed(data, "16UC1; compressedDepth rvl")


def test_an_rvl_code_worked_out_by_hand() -> None:
    # Two zeros (2), three others (3), differences +1 -> 2, +4 -> 8 (two nibbles: 8, 1), 0 -> 0.
    code = struct.pack("<I", 0x23281000)
    depth = depth_of_compressed(rvl_message(code, 5, 1), 1000)
    np.testing.assert_array_equal(depth, np.float32([[NAN, NAN, 0.001, 0.005, 0.005]]))


@given(
    hnp.arrays(
        np.uint16,
        st.tuples(st.integers(1, 6), st.integers(1, 6)),
        elements=st.one_of(st.just(0), st.integers(0, 65535)),
    )
)
def test_rvl_is_lossless(pixels: NDArray[np.uint16]) -> None:
    height, width = pixels.shape
    depth = depth_of_compressed(rvl_message(rvl(pixels), width, height), 1)
    is_none = (pixels == 0) | (pixels == 65535)  # nothing came back, or from too far away
    np.testing.assert_array_equal(depth, np.where(is_none, np.nan, pixels).astype(np.float32))


RANDOM = np.random.default_rng(1).integers(0, 65535, (4, 4), dtype=np.uint16)


@pytest.mark.parametrize(
    ("image", "text"),
    [
        (
            compressed(picture(GRAY), "jpeg"),
            "expected a depth image of format '16UC1; compressedDepth' or "
            "'32FC1; compressedDepth', or a PNG of 16 bits, found 'jpeg'",
        ),
        (
            compressed(b"short", "16UC1; compressedDepth"),
            "a compressedDepth image starts with 12 bytes, found 5 in all",
        ),
        (
            compressed(bytes(12) + picture(np.zeros((2, 2), np.uint8)), "16UC1; compressedDepth"),
            "expected a depth image of 16 bits, found a picture of mode L (8 bits)",
        ),
        (
            compressed(bytes(30), "16UC1; compressedDepth png"),
            "this is not a picture that can be read",
        ),
        (
            compressed(bytes(15), "16UC1; compressedDepth rvl"),
            "the RVL image ends before its size",
        ),
        (rvl_message(b"", 0, 4), "the RVL image claims 0 x 4 pixels"),
        (
            rvl_message(b"", 2**32 - 1, 2**32 - 1),
            "the RVL image claims 4294967295 x 4294967295 pixels",
        ),
        (rvl_message(rvl(RANDOM)[:-8], 4, 4), "the RVL image is damaged or cut off"),
        (rvl_message(rvl(RANDOM), 3, 4), "the RVL image is damaged or cut off"),
        (rvl_message(bytes(400), 4, 4), "the RVL image is damaged or cut off"),
        (rvl_message(b"\xff" * 40, 4, 4), "the RVL image is damaged or cut off"),
    ],
)
def test_compressed_depth_that_cannot_be_read_is_an_error(
    image: SimpleNamespace, text: str
) -> None:
    with pytest.raises(FormatError) as caught:
        depth_of_compressed(image, 1000)
    assert str(caught.value) == text
