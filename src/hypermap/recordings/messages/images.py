"""Depth and color from `sensor_msgs` images.

Source: REP 118 (depth images: 16UC1 in millimeters, 32FC1 in meters), `sensor_msgs/Image`.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import FormatError
from hypermap.recordings.messages.header import octets
from hypermap.recordings.messages.raw_colors import color_of_yuv422, demosaic
from hypermap.recordings.pictures import decode_color, depth_in_meters

DEPTH_ENCODINGS = ("16UC1", "32FC1")
"""Of images that can only be depth; mono16 may also be infrared."""

_INTEGER_DEPTH = ("16UC1", "mono16")
_CHANNELS = {  # which channels are red, green and blue, and of how many
    "rgb8": ((0, 1, 2), 3),
    "bgr8": ((2, 1, 0), 3),
    "8UC3": ((2, 1, 0), 3),
    "rgba8": ((0, 1, 2), 4),
    "bgra8": ((2, 1, 0), 4),
    "8UC4": ((2, 1, 0), 4),
    "mono8": ((0, 0, 0), 1),
    "8UC1": ((0, 0, 0), 1),
}
_PACKED = {"yuv422": "uyvy", "uyvy": "uyvy", "yuv422_yuy2": "yuyv", "yuyv": "yuyv"}
_BAYER = re.compile("bayer_(rggb|bggr|gbrg|grbg)(8|16)")


def depth_of_image(message: Any, units_per_meter: float) -> NDArray[np.float32]:
    """Return the depth in a `sensor_msgs/Image`, meters, NaN for no return, shape (H, W).

    Args:
        message: an image of encoding 16UC1, mono16 or 32FC1.
        units_per_meter: scale of the integer encodings.

    Raises:
        FormatError: If the encoding is another or the data too short.
    """
    if message.encoding in _INTEGER_DEPTH:
        return depth_in_meters(_pixels(message, np.uint16, 1)[..., 0], units_per_meter)
    if message.encoding == "32FC1":
        return without_invalid(_pixels(message, np.float32, 1)[..., 0])
    raise FormatError(
        f"expected a depth image of encoding 16UC1 or 32FC1, found {message.encoding!r}"
    )


def color_of_image(message: Any) -> NDArray[np.uint8]:
    """Return a `sensor_msgs/Image` as RGB, uint8, shape (H, W, 3).

    Raises:
        FormatError: If the encoding is not a common one, or the data too short.
    """
    encoding = message.encoding
    if encoding in _CHANNELS:
        channels, count = _CHANNELS[encoding]
        return np.ascontiguousarray(_pixels(message, np.uint8, count)[..., channels])
    if encoding in _PACKED:
        return color_of_yuv422(_pixels(message, np.uint8, 2), _PACKED[encoding])
    if encoding == "mono16":
        return np.repeat(_upper_bytes(_pixels(message, np.uint16, 1)), 3, axis=-1)
    if bayer := _BAYER.fullmatch(encoding):
        pattern, bits = bayer.groups()
        if bits == "8":
            return demosaic(_pixels(message, np.uint8, 1)[..., 0], pattern)
        return demosaic(_upper_bytes(_pixels(message, np.uint16, 1))[..., 0], pattern)
    raise FormatError(
        f"color images of encoding {encoding!r} cannot be read, only {', '.join(_CHANNELS)}, "
        f"mono16, {', '.join(_PACKED)} and bayer_*; record a topic that image_proc has converted"
    )


def color_of_compressed(message: Any) -> NDArray[np.uint8]:
    """Return a `sensor_msgs/CompressedImage` (JPEG, PNG) as RGB, uint8, shape (H, W, 3).

    Raises:
        FormatError: If it is not a picture, or damaged.
    """
    return decode_color(bytes(message.data))


def without_invalid(depth: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return depth in meters, float32, (H, W), with NaN wherever it is not a positive number.

    Source: REP 117 (infinite: out of range).
    """
    return np.where(np.isfinite(depth) & (depth > 0), depth, np.float32("nan")).astype(np.float32)


def _upper_bytes(pixels: NDArray[np.uint16]) -> NDArray[np.uint8]:
    return (pixels >> 8).astype(np.uint8)


def _pixels(
    message: Any, kind: type[np.uint8] | type[np.uint16] | type[np.float32], channels: int
) -> NDArray[Any]:
    """Return an image's pixels in the machine's byte order, shape (H, W, channels)."""
    dtype = np.dtype(kind).newbyteorder(">" if message.is_bigendian else "<")
    height, width, step = message.height, message.width, message.step
    row = width * channels * dtype.itemsize
    if height < 1 or width < 1:
        raise FormatError(f"the image has {width} x {height} pixels")
    if step < row or len(message.data) < height * step:
        raise FormatError(
            f"an image of {width} x {height} pixels of {message.encoding} needs rows of {row} "
            f"bytes, found {len(message.data)} bytes in rows of {step}"
        )
    rows = octets(message.data)[: height * step].reshape(height, step)
    pixels = np.ascontiguousarray(rows[:, :row]).view(dtype)
    return pixels.reshape(height, width, channels).astype(kind, copy=False)
