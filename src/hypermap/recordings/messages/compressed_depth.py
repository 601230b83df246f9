"""Depth from the images of `compressed_depth_image_transport`, and from PNGs of 16 bits.

Source: that package's `codec.cpp`: a header of 12 bytes (format, A, B), then a PNG, or for RVL
the width, the height and the code. Depth of type 32FC1 is kept as a 16 bit inverse depth q, from
which it comes back as A / (q - B).
"""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import FormatError
from hypermap.recordings.messages.images import without_invalid
from hypermap.recordings.pictures import MAX_PIXELS, decode_integers, depth_in_meters

_HEADER = struct.Struct("<iff")
_RVL_SIZE = struct.Struct("<II")


def is_png(message: Any) -> bool:
    """Return whether a compressed image is a PNG alone, as of `compressed_image_transport`."""
    kind = message.format.lower()
    return "png" in kind and "compresseddepth" not in kind


def depth_of_compressed(message: Any, units_per_meter: float) -> NDArray[np.float32]:
    """Return the depth in a `sensor_msgs/CompressedImage`, meters, NaN for no return.

    Args:
        message: an image of format "16UC1; compressedDepth ..." or "32FC1; compressedDepth ...", or
            a PNG of 16 bits.
        units_per_meter: scale of 16UC1.

    Returns:
        Shape (H, W).

    Raises:
        FormatError: If the format is another or the data damaged.
    """
    if is_png(message):
        return depth_in_meters(decode_integers(bytes(message.data)), units_per_meter)
    encoding, _, transport = (word.strip() for word in message.format.partition(";"))
    if encoding not in ("16UC1", "32FC1") or "compressedDepth" not in transport:
        raise FormatError(
            "expected a depth image of format '16UC1; compressedDepth' or "
            f"'32FC1; compressedDepth', or a PNG of 16 bits, found {message.format!r}"
        )
    data = bytes(message.data)
    if len(data) < _HEADER.size:
        raise FormatError(f"a compressedDepth image starts with 12 bytes, found {len(data)} in all")
    _, quant_a, quant_b = _HEADER.unpack_from(data)
    content = data[_HEADER.size :]
    integers = _decode_rvl(content) if "rvl" in transport.lower() else decode_integers(content)
    if encoding == "16UC1":
        return depth_in_meters(integers, units_per_meter)
    quantized = np.where(integers == 0, np.float32("nan"), integers.astype(np.float32))
    with np.errstate(divide="ignore"):
        return without_invalid(np.float32(quant_a) / (quantized - np.float32(quant_b)))


def _decode_rvl(content: bytes) -> NDArray[np.uint16]:
    from hypermap.recordings.messages.rvl import decode  # numba, which is slow to import

    if len(content) < _RVL_SIZE.size:
        raise FormatError("the RVL image ends before its size")
    width, height = _RVL_SIZE.unpack_from(content)
    if not 0 < width * height <= MAX_PIXELS:
        raise FormatError(f"the RVL image claims {width} x {height} pixels")
    code = content[_RVL_SIZE.size :]
    words = np.frombuffer(code + bytes(-len(code) % 4), dtype="<u4").astype(np.uint32)
    pixels = np.zeros(width * height, dtype=np.uint16)
    if not decode(words, pixels):
        raise FormatError("the RVL image is damaged or cut off")
    return pixels.reshape(height, width)
