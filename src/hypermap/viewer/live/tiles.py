"""Tiles: grids as square pictures in the base frame, at every zoom level."""

from __future__ import annotations

import functools
import io
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from hypermap.core.errors import HypermapError
from hypermap.core.frames import Pose2D
from hypermap.viewer.live.pyramid import Pyramid

SIDE = 256
"""Pixels along a side of a tile."""
FINEST = 0.01
"""Side of a pixel at zoom 0 [m]; each zoom doubles it, and negative ones halve it."""

_ZOOMS = range(-8, 25)
_FARTHEST = 2**40  # tiles from the origin; within it, floats distinguish pixels


@dataclass(frozen=True)
class Tile:
    """One tile: columns grow along x and rows along y, from the origin of the base frame.

    Raises:
        HypermapError: If there is no such zoom level, or the tile is too far away.

    >>> Tile(zoom=0, column=-1, row=0).bounds
    (-2.56, 0.0, 0.0, 2.56)
    """

    zoom: int
    column: int
    row: int

    def __post_init__(self) -> None:
        if self.zoom not in _ZOOMS:
            raise HypermapError(
                f"there is no zoom {self.zoom}, only {_ZOOMS.start} to {_ZOOMS.stop - 1}"
            )
        if max(abs(self.column), abs(self.row)) > _FARTHEST:
            raise HypermapError(f"tile {self.column}, {self.row} is too far away")

    @property
    def pixel(self) -> float:
        """Side of a pixel [m]."""
        return math.ldexp(FINEST, self.zoom)

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Its extent: xmin, ymin, xmax, ymax [m]."""
        side = SIDE * self.pixel
        x, y = self.column * side, self.row * side
        return x, y, x + side, y + side

    def centers(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return x of the pixels from left to right and y from bottom to top [m], (SIDE,) both."""
        steps = np.arange(0.5, SIDE, dtype=np.float64)
        return (
            (self.column * SIDE + steps) * self.pixel,
            (self.row * SIDE + steps) * self.pixel,
        )


def draw_tile(pyramid: Pyramid, tile: Tile, base_T_layer: Pose2D) -> bytes:
    """Return a tile of a layer as PNG; transparent off the grid."""
    if not _meets(pyramid, tile, base_T_layer):
        return _nothing()
    xs, ys = tile.centers()
    pixels = pyramid.draw(xs, ys, tile.pixel, base_T_layer)[::-1]  # row 0 of a picture is its top
    palette = pyramid.paint.palette
    if palette is None:
        return _png(Image.fromarray(np.ascontiguousarray(pixels)))
    numbers = (pixels.astype(np.int16) - int(pyramid.paint.outside)).astype(np.uint8)
    image = Image.fromarray(numbers).convert("P")
    image.putpalette(palette[:, :3].tobytes())
    return _png(image, transparency=palette[:, 3].tobytes())


def _meets(pyramid: Pyramid, tile: Tile, base_T_layer: Pose2D) -> bool:
    """Return whether the box around the grid meets the tile."""
    corners = base_T_layer.apply(pyramid.grid.corners())
    xmin, ymin, xmax, ymax = tile.bounds
    low, high = corners.min(axis=0), corners.max(axis=0)
    return bool(low[0] <= xmax and low[1] <= ymax and high[0] >= xmin and high[1] >= ymin)


@functools.cache
def _nothing() -> bytes:
    return _png(Image.new("P", (SIDE, SIDE)), transparency=b"\0")


def _png(image: Image.Image, transparency: bytes | None = None) -> bytes:
    content = io.BytesIO()
    options = {} if transparency is None else {"transparency": transparency}
    image.save(content, format="png", compress_level=1, **options)
    return content.getvalue()
