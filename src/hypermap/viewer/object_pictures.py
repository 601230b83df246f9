"""Pictures of objects, decoded."""

from __future__ import annotations

import io

from PIL import Image

from hypermap.core.arguments import check_kind
from hypermap.core.errors import FormatError
from hypermap.core.pictures import MOST_SCANS, ObjectPicture, scans_of

_MOST_PIXELS = 1 << 24  # of what is a crop of a camera's image


def image_of(picture: ObjectPicture) -> Image.Image:
    """Return a picture as an RGB image.

    Raises:
        FormatError: If the JPEG file is damaged or too large, or has too many scans.
        TypeError: If it is not a picture of an object.
    """
    check_kind(picture, ObjectPicture)
    if (scans := scans_of(picture.jpeg)) > MOST_SCANS:
        raise FormatError(f"the picture has {scans} scans; at most {MOST_SCANS} are read")
    try:
        with Image.open(io.BytesIO(picture.jpeg), formats=["JPEG"]) as image:
            if image.width * image.height > _MOST_PIXELS:
                raise FormatError(f"the picture has {image.width} x {image.height} pixels")
            return image.convert("RGB")
    except (OSError, ValueError, Image.DecompressionBombError) as error:
        raise FormatError(f"the picture cannot be read: {error}") from None
