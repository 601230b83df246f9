"""The camera's image, small enough to keep for every frame."""

from __future__ import annotations

import io
import logging
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from hypermap.core.errors import HypermapError
from hypermap.perception.frame import RgbdFrame

_log = logging.getLogger(__name__)

WIDEST = 640
"""Columns of a picture at most."""

_QUALITY = 80  # of JPEG
_NEAREST, _FARTHEST = 0.4, 10.0  # depths at the two ends of the grays [m]
_DARKEST = 45  # gray of what is far; black is no return


@dataclass(frozen=True, eq=False)
class CameraPicture:
    """A picture of a frame.

    Attributes:
        content: JPEG.
        width: columns.
        height: rows.
        kind: the color image, or the depth image in grays where there is no other.
        reduced_by: how many rows and columns of the image became one.
    """

    content: bytes
    width: int
    height: int
    kind: Literal["color", "depth"]
    reduced_by: int


def picture_of(frame: RgbdFrame) -> CameraPicture:
    """Return the picture of a frame; depth goes from white, near, to dark gray, far."""
    step = -(-frame.camera.width // WIDEST)
    color = _color_of(frame)
    if color is not None:
        image = Image.fromarray(color)
        image = image.reduce(step) if step > 1 else image
    else:
        image = Image.fromarray(_greys(frame.depth[::step, ::step])).convert("RGB")
    content = io.BytesIO()
    image.save(content, format="jpeg", quality=_QUALITY)
    kind: Literal["color", "depth"] = "depth" if color is None else "color"
    return CameraPicture(content.getvalue(), image.width, image.height, kind, step)


def _color_of(frame: RgbdFrame) -> NDArray[np.uint8] | None:
    """Return the color image; None if there is none, or it cannot be read.

    Who maps with recorded detections needs no color images, and so may have broken ones.
    """
    try:
        return frame.color
    except (HypermapError, OSError) as error:
        _log.warning("frame %.6f: its color image cannot be shown: %s", frame.stamp, error)
        return None


def _greys(depth: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return a gray for each depth; what is twice as far is darker by one step."""
    with np.errstate(invalid="ignore", divide="ignore"):
        nearness = np.log(_FARTHEST / depth) / np.log(_FARTHEST / _NEAREST)
    grays = _DARKEST + (255 - _DARKEST) * np.clip(nearness, 0, 1)
    return np.asarray(np.where(depth > 0, grays, 0), dtype=np.uint8)
