"""Layers and objects as they are easiest to write in a test."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import shapely

from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.core.objects import SemanticObject
from hypermap.core.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyLayer
from hypermap.core.pictures import ObjectPicture

_VALUES = {".": FREE, "#": OCCUPIED, "?": UNKNOWN}


def square(name: str, x: float, y: float, side: float = 1.0, **others: Any) -> SemanticObject:
    """Return an object with a square footprint around a point [m].

    >>> square("chair", 2, 0).footprint.bounds
    (1.5, -0.5, 2.5, 0.5)
    """
    half = side / 2
    return SemanticObject(name, shapely.box(x - half, y - half, x + half, y + half), **others)


def jpeg_picture(
    color: str = "gray",
    azimuth: float = 0.0,
    quality: float = 0.5,
    size: tuple[int, int] = (48, 36),
) -> ObjectPicture:
    """Return a picture of an object in one color; needs Pillow.

    >>> jpeg_picture("red", quality=0.9).quality
    0.9
    """
    from PIL import Image

    file = io.BytesIO()
    Image.new("RGB", size, color).save(file, "JPEG")
    return ObjectPicture(file.getvalue(), 0.0, azimuth, quality, sharpness=0.0)


def occupancy_from_text(
    text: str,
    resolution: float = 1.0,
    origin: Pose2D | None = None,
    name: str = "occupancy",
    frame_id: str = "map",
) -> OccupancyLayer:
    """Return an occupancy layer drawn with "." free, "#" occupied and "?" unknown.

    The last line is row 0, so the text is the map as seen from above.

    >>> layer = occupancy_from_text('''
    ... ##?
    ... ..#
    ... ''')
    >>> layer.label_at([[0.5, 0.5], [0.5, 1.5], [2.5, 1.5]])
    array(['Free', 'Occupied', 'Unknown'], dtype=object)

    Raises:
        ValueError: If the lines differ in length, or hold another character.
    """
    lines = text.split()
    if len({len(line) for line in lines}) != 1 or set("".join(lines)) - set(_VALUES):
        raise ValueError(f"lines of equal length of {' '.join(_VALUES)} are expected:\n{text}")
    cells = np.array([[_VALUES[sign] for sign in line] for line in reversed(lines)], dtype=np.int8)
    grid = GridGeometry(cells.shape[1], cells.shape[0], resolution, origin or Pose2D())
    return OccupancyLayer(name, frame_id, grid, cells)
