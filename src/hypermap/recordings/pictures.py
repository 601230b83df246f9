"""Decodes images into arrays: PNG depth, and color in any common format."""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageFile, UnidentifiedImageError

from hypermap.core.errors import FileMissing, FormatError
from hypermap.core.pictures import MOST_SCANS, START_OF_JPEG, scans_of
from hypermap.formats.atomic import is_folder
from hypermap.formats.store import open_file
from hypermap.perception.frame import Camera

MAX_PIXELS = 50_000_000
MAX_BYTES = 8 * MAX_PIXELS  # of a picture's file
_MOST_INTEGER = np.iinfo(np.uint16).max
_DAMAGE = (
    OSError,
    SyntaxError,
    ValueError,
    EOFError,
    struct.error,
    zlib.error,
    Image.DecompressionBombError,
    Image.DecompressionBombWarning,
)


def read_file(path: Path) -> bytes:
    """Return the content of a picture file.

    Raises:
        FileMissing: If there is no such file.
        FormatError: If it is a device, or too large.
        HypermapError: If it cannot be read.
    """
    if is_folder(path):
        raise FileMissing(f"{path}: there is no such file")
    with open_file(path, MAX_BYTES) as file:
        return file.read()


def picture_size(content: bytes) -> tuple[int, int]:
    """Return columns and rows of an encoded picture.

    Raises:
        FormatError: If it is not a picture.
    """
    with _opened(content) as image:
        return image.size


def decode_color(content: bytes) -> NDArray[np.uint8]:
    """Return an encoded picture as RGB, uint8, shape (H, W, 3).

    Raises:
        FormatError: If it is not a picture, damaged, or not of 8 bits per channel.
    """
    with _opened(content) as image:
        if image.mode.startswith(("I", "F")):
            raise FormatError(f"expected a color picture of 8 bits, found mode {image.mode}")
        return np.asarray(image.convert("RGB"))


def decode_integers(content: bytes) -> NDArray[np.uint16]:
    """Return an encoded picture of 16 bit gray values, shape (H, W).

    Raises:
        FormatError: If it is not a picture, damaged, or its numbers are of another kind.
    """
    with _opened(content) as image:
        if not image.mode.startswith("I"):
            found = "floating-point numbers" if image.mode == "F" else f"mode {image.mode} (8 bits)"
            raise FormatError(f"expected a depth image of 16 bits, found a picture of {found}")
        if image.format == "PPM" and image.tile[0][0] != "raw":
            raise FormatError(
                "a depth image in PGM must be binary with a largest value of 65535: by another one "
                "its numbers are scaled; write 16-bit PNG"
            )
        integers = np.asarray(image)
        if integers.max() > _MOST_INTEGER or integers.min() < 0:
            raise FormatError(
                f"expected a depth image of 16 bits, found numbers from {integers.min()} to "
                f"{integers.max()}"
            )
        return integers.astype(np.uint16)


def depth_in_meters(integers: NDArray[np.uint16], units_per_meter: float) -> NDArray[np.float32]:
    """Return integer depth as meters, float32, (H, W); NaN for 0 and the largest number."""
    depth = np.divide(integers, np.float32(units_per_meter), dtype=np.float32)
    for value in (0, _MOST_INTEGER):
        np.copyto(depth, np.nan, where=integers == value)
    return depth


def seen_by(
    color: NDArray[np.uint8], color_K: NDArray[np.float64], camera: Camera
) -> NDArray[np.uint8]:
    """Return a picture as a camera in the same place sees it: RGB, shape (H, W, 3); black outside.

    Args:
        color: RGB, shape (h, w, 3).
        color_K: pinhole matrix of its camera [pixels], shape (3, 3).
        camera: the other one.
    """
    to_color = color_K @ np.linalg.inv(camera.K)  # of pixels, whose centers are whole numbers
    # Pillow's coordinates have the centers of pixels at one half.
    to_color[:2, 2] += 0.5 - to_color[:2, :2].sum(axis=1) / 2
    size, numbers = (camera.width, camera.height), tuple(to_color[:2].ravel().tolist())
    with Image.fromarray(color) as image:
        affine, bilinear = Image.Transform.AFFINE, Image.Resampling.BILINEAR
        return np.asarray(image.transform(size, affine, numbers, bilinear))


@contextmanager
def _opened(content: bytes) -> Iterator[ImageFile.ImageFile]:
    """Yield an image of limited size; any damage becomes a FormatError."""
    if content.startswith(START_OF_JPEG) and (scans := scans_of(content)) > MOST_SCANS:
        raise FormatError(f"the picture has {scans} scans; at most {MOST_SCANS} are read")
    try:
        with Image.open(io.BytesIO(content)) as image:
            if image.width * image.height > MAX_PIXELS:
                raise FormatError(
                    f"the picture has {image.width} x {image.height} pixels, "
                    f"more than {MAX_PIXELS // 1_000_000} million"
                )
            yield image
    except UnidentifiedImageError:
        raise FormatError("this is not a picture that can be read") from None
    except _DAMAGE as error:
        raise FormatError(f"the picture is damaged: {error}") from None
