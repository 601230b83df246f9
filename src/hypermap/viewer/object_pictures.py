"""Pictures of objects, decoded."""

from __future__ import annotations

import io

from PIL import Image

from hypermap.core.errors import FormatError
from hypermap.core.pictures import ObjectPicture


def image_of(picture: ObjectPicture) -> Image.Image:
    """Return a picture as an RGB image.

    Raises:
        FormatError: If the JPEG file is damaged.
    """
    try:
        with Image.open(io.BytesIO(picture.jpeg), formats=["JPEG"]) as image:
            return image.convert("RGB")
    except (OSError, ValueError, Image.DecompressionBombError) as error:
        raise FormatError(f"the picture cannot be read: {error}") from None
