"""Images as logs hold them: color compressed, depth in whole millimeters."""

from __future__ import annotations

import io

import numpy as np
from numpy.typing import NDArray
from PIL import Image

MILLIMETRES = 1000.0  # in a meter
_QUALITY = 85
_FARTHEST = 65535  # what 16 bits can say [mm]


def jpeg(color: NDArray[np.uint8]) -> bytes:
    """Return an RGB image, uint8, shape (H, W, 3), as JPEG."""
    content = io.BytesIO()
    Image.fromarray(color).save(content, "jpeg", quality=_QUALITY)
    return content.getvalue()


def millimeters(depth: NDArray[np.float32]) -> NDArray[np.uint16]:
    """Return a depth image [m] in millimeters; 0 where there was no return or it was too far.

    >>> millimeters(np.array([[1.2344, np.nan, 70.0]], np.float32)).tolist()
    [[1234, 0, 0]]
    """
    scaled = np.round(np.nan_to_num(depth, nan=0.0, posinf=0.0, neginf=0.0) * MILLIMETRES)
    return np.where((scaled < 0) | (scaled > _FARTHEST), 0, scaled).astype(np.uint16)
