"""An image pyramid: a grid and coarser copies of it, to be drawn at every zoom level."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.core.layer import RasterPicture
from hypermap.core.occupancy import COLORS, OCCUPIED, UNKNOWN, OccupancyLayer, cell_colors

Pixels: TypeAlias = NDArray[Any]
Merge: TypeAlias = Callable[[Pixels, Pixels], Pixels]

_OFF_GRID = UNKNOWN - 1
_MAGNIFIED = 1 - 1e-6  # of a cell; centers a whole cell apart may step over one by rounding


@dataclass(frozen=True, eq=False)
class Paint:
    """How pixels are merged and colored.

    Attributes:
        merge: makes one pixel of two neighbors.
        outside: the pixel off the grid.
        palette: for pixels that are numbers, the color (r, g, b, opacity) of each from `outside`
            on, uint8, shape (N, 4); None for pixels that are colors themselves.
    """

    merge: Merge
    outside: Any
    palette: NDArray[np.uint8] | None = None


class Pyramid:
    """A grid's pixels, and copies in which each pixel stands for 2 x 2, 4 x 4, ... of them.

    Occupancy keeps the highest value, so that a wall of one cell never disappears; colors of
    other layers are averaged. Copies are made when they are first needed; together they take a
    third of what the grid takes. May be asked from several threads.

    Attributes:
        grid: geometry of the pixels of the finest level.
        paint: how they are merged and colored.
    """

    def __init__(self, grid: GridGeometry, pixels: Pixels, paint: Paint) -> None:
        self.grid = grid
        self.paint = paint
        self._levels = [pixels]
        self._making = threading.Lock()

    @classmethod
    def of(cls, layer: OccupancyLayer) -> Pyramid | None:
        """Return the pyramid of a layer; None while it is empty."""
        if layer.grid is None or layer.cells is None:
            return None
        cells = layer.cells
        if cells.dtype != np.int8 or cells.max() > OCCUPIED:  # a raw map: above 100 is as 100
            cells = np.minimum(cells, OCCUPIED).astype(np.int8)
        return cls(layer.grid, cells, Paint(np.maximum, np.int8(_OFF_GRID), _palette()))

    @classmethod
    def of_picture(cls, picture: RasterPicture) -> Pyramid:
        """Return the pyramid of what a layer of another kind shows of itself."""
        return cls(picture.grid, picture.rgba, Paint(_mean_color, np.zeros(4, np.uint8)))

    def level(self, number: int) -> Pixels:
        """Return the pixels of which each stands for 2^number x 2^number of the grid's.

        The last one, a single pixel, also answers for all that would follow.
        """
        with self._making:
            while len(self._levels) <= number and max(self._levels[-1].shape[:2]) > 1:
                halved = _halved(self._levels[-1], self.paint.merge)
                turned = _halved(halved.swapaxes(0, 1), self.paint.merge)
                self._levels.append(np.ascontiguousarray(turned.swapaxes(0, 1)))
            return self._levels[min(number, len(self._levels) - 1)]

    def draw(
        self, xs: NDArray[np.float64], ys: NDArray[np.float64], pixel: float, base_T_layer: Pose2D
    ) -> Pixels:
        """Resample the grid at points of a raster in the base frame.

        Where a pixel is smaller than a cell, it shows the cell at its center. Where it is
        not, no cell is left out: each is part of one pixel at least.

        Args:
            xs: of the pixels' centers [m], shape (W,).
            ys: likewise, shape (H,).
            pixel: the distance between two centers, along both axes [m].
            base_T_layer: pose of the layer's frame.

        Returns:
            Shape (H, W), or (H, W, 4) for colors.
        """
        yaw = (base_T_layer @ self.grid.origin).yaw
        # A pixel's square, turned as the grid is, reaches over so many cells along a side.
        turn = abs(math.cos(yaw)) + abs(math.sin(yaw))
        reach = pixel / self.grid.resolution * turn
        if reach < _MAGNIFIED:
            return self._sample(xs, ys, 0, base_T_layer)
        # Four samples per pixel on a level fine enough that no cell of it lies between samples.
        number = max(0, math.ceil(math.log2(reach / _MAGNIFIED / 2)))
        quarter = np.array([-pixel / 4, pixel / 4])
        fine = self._sample(
            (xs[:, np.newaxis] + quarter).ravel(),
            (ys[:, np.newaxis] + quarter).ravel(),
            number,
            base_T_layer,
        )
        merge = self.paint.merge
        rows = merge(fine[0::2], fine[1::2])
        return merge(rows[:, 0::2], rows[:, 1::2])

    def _sample(
        self, xs: NDArray[np.float64], ys: NDArray[np.float64], number: int, base_T_layer: Pose2D
    ) -> Pixels:
        rows, cols = self._cells(xs, ys, base_T_layer.inverse())
        rows, cols = rows >> number, cols >> number
        level = self.level(number)
        height, width = level.shape[:2]
        on_grid = (rows >= 0) & (rows < height) & (cols >= 0) & (cols < width)
        pixels: Pixels = level[np.clip(rows, 0, height - 1), np.clip(cols, 0, width - 1)]
        pixels[~on_grid] = self.paint.outside
        return pixels

    def _cells(
        self, xs: NDArray[np.float64], ys: NDArray[np.float64], layer_T_base: Pose2D
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the cells at all pairs of x and y, in shapes that broadcast to (H, W)."""
        if layer_T_base.yaw == 0 and self.grid.origin.yaw == 0:
            along_x = np.column_stack([xs, np.full(len(xs), ys[0])])
            along_y = np.column_stack([np.full(len(ys), xs[0]), ys])
            cols = self.grid.cells_at(layer_T_base.apply(along_x))[:, 1]
            rows = self.grid.cells_at(layer_T_base.apply(along_y))[:, 0]
            return rows[:, np.newaxis], cols[np.newaxis, :]
        points = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
        cells = self.grid.cells_at(layer_T_base.apply(points)).reshape(len(ys), len(xs), 2)
        return cells[..., 0], cells[..., 1]


def _palette() -> NDArray[np.uint8]:
    """Return the colors of what is off the grid, of unknown cells, and of 0 to 100."""
    colors = cell_colors()
    off_grid, unknown = (0, 0, 0, 0), (*COLORS["Unknown"], 255)
    return np.array([off_grid, unknown, *colors[: OCCUPIED + 1]], dtype=np.uint8)


def _halved(pixels: Pixels, merge: Merge) -> Pixels:
    """Return pixels with each two rows merged; an odd last one stays."""
    first, second = pixels[0::2], pixels[1::2]
    if len(first) == len(second):
        return merge(first, second)
    return np.concatenate([merge(first[:-1], second), first[-1:]])


def _mean_color(first: Pixels, second: Pixels) -> Pixels:
    """Return the mean of two colors, each counting as much as it is opaque."""
    a, b = first[..., 3:].astype(np.uint16), second[..., 3:].astype(np.uint16)
    total = a + b
    weighted = first[..., :3].astype(np.uint32) * a + second[..., :3].astype(np.uint32) * b
    mean = (weighted + total // 2) // np.maximum(total, 1)
    return np.concatenate([mean, (total + 1) // 2], axis=-1).astype(np.uint8)
