"""Pictures of objects: crops of the camera images that showed them best."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

START_OF_JPEG = b"\xff\xd8\xff"
"""The first bytes of all JPEG files."""

MOST_SCANS = 200
"""How many scans a JPEG file may have: programs write a dozen, and each passes over all pixels."""

MOST_PICTURES = 3
"""How many pictures are kept for an object."""

_SAME_SIDE = math.radians(45)


@dataclass(frozen=True)
class ObjectPicture:
    """A picture of an object.

    Attributes:
        jpeg: the file.
        stamp: when it was taken [s].
        azimuth: direction from the object to the camera, in the layer's frame [rad].
        quality: the larger, the better; comparable for pictures of one object.
        sharpness: variance of the Laplacian of its gray values.

    Raises:
        ValueError: If a number is not finite, or it is not a JPEG file.
    """

    jpeg: bytes
    stamp: float
    azimuth: float
    quality: float
    sharpness: float

    def __post_init__(self) -> None:
        numbers = self.stamp, self.azimuth, self.quality, self.sharpness
        if not all(map(math.isfinite, numbers)):
            raise ValueError("the numbers of a picture must be finite")
        if not self.jpeg.startswith(START_OF_JPEG):
            raise ValueError("a picture must be a JPEG file")

    def _repr_jpeg_(self) -> bytes:
        """Return what a notebook shows."""
        return self.jpeg

    def is_from_side(self, azimuth: float) -> bool:
        """Return whether it was taken from about that direction [rad]: within 45 degrees."""
        return abs((self.azimuth - azimuth + math.pi) % math.tau - math.pi) < _SAME_SIDE


def scans_of(jpeg: bytes) -> int:
    """Return how many scans a JPEG file, or a piece of one, has.

    Thirty bytes are a scan of sixteen million pixels, so a small file can take minutes to decode.
    """
    return jpeg.count(b"\xff\xda")


def best_pictures(pictures: Iterable[ObjectPicture]) -> tuple[ObjectPicture, ...]:
    """Return the best pictures of an object, each from another side, best first; at most 3."""
    found: list[ObjectPicture] = []
    for picture in sorted(pictures, key=_rank):
        is_new = not any(each.is_from_side(picture.azimuth) for each in found)
        if is_new and len(found) < MOST_PICTURES:
            found.append(picture)
    return tuple(found)


def _rank(picture: ObjectPicture) -> tuple[float, float, bytes, float, float]:
    quality = -picture.quality
    return quality, picture.stamp, picture.jpeg, picture.azimuth, picture.sharpness
