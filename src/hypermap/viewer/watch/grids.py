"""Pictures of the growing grid, as often as they cost little."""

from __future__ import annotations

import io
import time
from collections.abc import Callable
from dataclasses import dataclass

from PIL import Image

from hypermap.core.frames import Pose2D
from hypermap.core.occupancy import OccupancyLayer
from hypermap.viewer.live.embedded_raster import embed_raster

_MOST_PIXELS = 1_000_000
_SHARE = 0.1  # of the time that may go into pictures


@dataclass(frozen=True, eq=False)
class GridPicture:
    """A grid as it was at one time.

    Attributes:
        content: PNG, straight in the map frame, row 0 at the top.
        extent: xmin, ymin, xmax, ymax [m].
    """

    content: bytes
    extent: tuple[float, float, float, float]


class GridPictures:
    """Makes pictures of a grid that changes, but spends no more than a tenth of the time on them.

    A small grid is drawn after every frame; a large one, now and then.
    """

    def __init__(self) -> None:
        self._started = time.monotonic()
        self._spent = 0.0
        self._last: OccupancyLayer | None = None

    def due(
        self, layer: Callable[[], OccupancyLayer], *, at_once: bool = False
    ) -> OccupancyLayer | None:
        """Return the grid that is to be drawn now; None if it is too soon, or nothing has changed.

        Args:
            layer: returns the present grid.
            at_once: whether it is drawn whatever it costs.
        """
        began = time.monotonic()
        if not at_once and self._spent > _SHARE * (began - self._started):
            return None
        grid = layer()
        self._spent += time.monotonic() - began
        if grid is self._last:
            return None
        self._last = grid
        return grid

    def draw(self, grid: OccupancyLayer) -> GridPicture | None:
        """Return the picture of a grid; None while it is empty."""
        began = time.monotonic()
        picture = _picture_of(grid)
        self._spent += time.monotonic() - began
        return picture


def _picture_of(layer: OccupancyLayer) -> GridPicture | None:
    raster = embed_raster(layer, Pose2D(), _MOST_PIXELS)
    if raster is None:
        return None
    content = io.BytesIO()
    Image.fromarray(raster.rgba).save(content, format="png", compress_level=1)
    return GridPicture(content.getvalue(), raster.bounds)
