"""Images as gray values: any file that Pillow decodes without other programs."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from hypermap.core.errors import FormatError, HypermapError
from hypermap.core.pictures import MOST_SCANS, START_OF_JPEG, scans_of
from hypermap.formats.grid.budget import check_cells

# Not EPS, for which Pillow runs another program, nor formats with several images.
_KINDS = (
    "PNG",
    "PPM",
    "JPEG",
    "BMP",
    "DIB",
    "TGA",
    "GIF",
    "TIFF",
    "WEBP",
    "JPEG2000",
    "PCX",
    "SGI",
)

_WEIGHT_OF_KIND = {"WEBP": 4, "JPEG2000": 4}  # whose decoders take up to 20 bytes for a pixel
_BAND_PIXELS = 1 << 20


@dataclass(frozen=True, eq=False)
class GrayBand:
    """The brightness of some rows of a picture; row 0 is its top.

    Attributes:
        values: sum of the color channels, unsigned, shape (rows, width).
        white: the value of white.
        opaque: whether each pixel is fully opaque; None where all are.
        top: the first of these rows.
        height: of the whole picture.
    """

    values: NDArray[np.unsignedinteger[Any]]
    white: int
    opaque: NDArray[np.bool_] | None
    top: int
    height: int


def decode_gray(content: bytes, path: str) -> Iterator[GrayBand]:
    """Yield a picture's gray values from the top; those of colors are the mean of their channels.

    Most kinds of pictures would take several times the memory if converted as a whole.

    Args:
        content: the picture file.
        path: how messages name it.

    Raises:
        FormatError: If it is not a picture, is damaged, or has too many pixels or scans.
    """
    if content.startswith(START_OF_JPEG) and (scans := scans_of(content)) > MOST_SCANS:
        raise FormatError(f"has {scans} scans; at most {MOST_SCANS} are read", path=path)
    with _as_format_errors(path):
        image = Image.open(io.BytesIO(content), formats=_KINDS)
        _check_size(image, path)
        image.load()
    width, height = image.size
    rows = max(1, _BAND_PIXELS // width)
    for top in range(0, height, rows):
        with _as_format_errors(path):
            values = _gray(image.crop((0, top, width, min(top + rows, height))), path)
        yield GrayBand(*values, top, height)


@contextmanager
def _as_format_errors(path: str) -> Iterator[None]:
    """Raise what Pillow raises as our errors, and keep its warnings quiet."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about size, which is checked, and oddities
            yield
    except HypermapError:
        raise
    except UnidentifiedImageError:
        raise FormatError("is not a picture", path=path) from None
    except Image.DecompressionBombError as error:  # Pillow's bound, which is higher than ours
        raise FormatError(f"has too many cells: {error}", path=path) from None
    except Exception as error:  # the decoders raise nearly anything for damaged files
        raise FormatError(f"is not an intact picture: {error}", path=path) from error


def _check_size(image: Image.Image, path: str) -> None:
    width, height = image.size
    if width < 1 or height < 1:
        raise FormatError("is a picture without pixels", path=path)
    weight = _WEIGHT_OF_KIND.get(str(image.format), 1)
    check_cells(width * height, f"{width} x {height} cells", path, weight)


def _gray(
    image: Image.Image, path: str
) -> tuple[NDArray[np.unsignedinteger[Any]], int, NDArray[np.bool_] | None]:
    """Return the attributes `values`, `white` and `opaque` of a band."""
    if image.mode == "F":
        raise FormatError("is a picture of floating point numbers, not of gray values", path=path)
    if image.mode.startswith("I"):  # 16 bits
        values = np.asarray(image)
        if values.min() < 0 or values.max() > 0xFFFF:
            raise FormatError("is a picture of more than 16 bits", path=path)
        return values.astype(np.uint16, copy=False), 0xFFFF, None
    has_alpha = image.has_transparency_data
    is_gray = image.mode in ("1", "L", "LA", "La")
    mode = ("L" if is_gray else "RGB") + ("A" if has_alpha else "")
    pixels = np.asarray(image if image.mode == mode else image.convert(mode))
    if is_gray and not has_alpha:
        return pixels, 255, None
    opaque = pixels[..., -1] == 255 if has_alpha else None
    if is_gray:
        return pixels[..., 0], 255, opaque
    values = pixels[..., 0].astype(np.uint16)
    values += pixels[..., 1]
    values += pixels[..., 2]
    return values, 3 * 255, opaque
