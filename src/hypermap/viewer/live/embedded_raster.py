"""A raster layer as one picture in the base frame, for a page that has no server."""

from __future__ import annotations

import base64
import io
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.core.layer import Layer, RasterPicture
from hypermap.core.occupancy import UNKNOWN, OccupancyLayer

MAX_PIXELS = 4096 * 4096
"""How many pixels a picture may have; browsers draw larger ones slowly or not at all."""
_STRAIGHT = 1e-9  # rad; a grid that is rotated by less is axis-parallel
_OPAQUE = 255


@dataclass(frozen=True, eq=False)
class EmbeddedRaster:
    """A raster layer as the page draws it.

    Attributes:
        rgba: uint8, shape (height, width, 4), in the base frame; row 0 is the top, as in a picture.
        bounds: xmin, ymin, xmax, ymax [m].
        resolution: side of a pixel [m].
        grid: the cells that are drawn, their origin in the base frame; a turned grid has pixels
            of half a cell, so that the one over a cell's center shows that cell.
        reduced_by: how many cells of the layer, along a side, became one; 1: all are there.
        says: color "rrggbbaa" -> label and value of the cells that have it; empty for layers whose
            colors do not identify the values of cells.
    """

    rgba: NDArray[np.uint8]
    bounds: tuple[float, float, float, float]
    resolution: float
    grid: GridGeometry
    reduced_by: int
    says: dict[str, dict[str, Any]]

    def as_json(self) -> dict[str, Any]:
        """Return its part of the page."""
        grid, origin = self.grid, self.grid.origin
        content = io.BytesIO()
        Image.fromarray(self.rgba).save(content, format="png")
        return {
            "png": base64.b64encode(content.getvalue()).decode("ascii"),
            "bounds": list(self.bounds),
            "resolution": self.resolution,
            "grid": {
                "x": origin.x,
                "y": origin.y,
                "yaw": origin.yaw,
                "resolution": grid.resolution,
                "width": grid.width,
                "height": grid.height,
            },
            "reduced_by": self.reduced_by,
            "says": self.says,
        }


def embed_raster(
    layer: Layer, base_T_layer: Pose2D, max_pixels: int = MAX_PIXELS
) -> EmbeddedRaster | None:
    """Return the picture of a layer; None if it has none, or one of shapes.

    A grid with more cells than the picture may have pixels is reduced. Each pixel of an occupancy
    layer shows the highest of its cells then, so that thin walls stay. A turned grid is drawn with
    pixels of half a cell.

    Args:
        layer: any layer.
        base_T_layer: pose of its frame in the base frame.
        max_pixels: of the picture.
    """
    if isinstance(layer, OccupancyLayer):
        return _embed_occupancy(layer, base_T_layer, max_pixels)
    picture = layer.picture()
    if not isinstance(picture, RasterPicture):
        return None
    factor = _factor(picture.grid, base_T_layer, max_pixels)
    middle = factor // 2
    rows = np.minimum(np.arange(0, picture.grid.height, factor) + middle, picture.grid.height - 1)
    cols = np.minimum(np.arange(0, picture.grid.width, factor) + middle, picture.grid.width - 1)
    return _placed(
        _coarser(picture.grid, factor), picture.rgba[np.ix_(rows, cols)], base_T_layer, factor, {}
    )


def _embed_occupancy(
    layer: OccupancyLayer, base_T_layer: Pose2D, max_pixels: int
) -> EmbeddedRaster | None:
    if layer.grid is None or layer.cells is None:
        return None
    factor = _factor(layer.grid, base_T_layer, max_pixels)
    grid, cells = _coarser(layer.grid, factor), _highest(layer.cells, factor)
    values, counts = np.unique(cells, return_counts=True)
    says = {}
    for value in values[np.argsort(counts, kind="stable")]:  # the commonest of a color stays
        cell = OccupancyLayer("cell", "map", GridGeometry(1, 1, 1.0), np.array([[value]]))
        says[_colors(cell)[0, 0].tobytes().hex()] = {
            "label": str(cell.label_at([0.5, 0.5])[0]),
            "value": int(value),
        }
    rgba = _colors(OccupancyLayer(layer.name, layer.frame_id, grid, cells))
    return _placed(grid, rgba, base_T_layer, factor, says)


def _colors(layer: OccupancyLayer) -> NDArray[np.uint8]:
    """Return the color of each cell; unknown is gray, and only off the grid is there nothing."""
    picture = layer.picture()
    if picture is None:
        return np.zeros((0, 0, 4), dtype=np.uint8)
    picture.rgba[:, :, 3] = _OPAQUE
    return picture.rgba


def _factor(grid: GridGeometry, base_T_layer: Pose2D, max_pixels: int) -> int:
    """Return how many cells along a side must become one, for the picture not to be too large."""
    yaw = (base_T_layer @ grid.origin).yaw
    if abs(yaw) < _STRAIGHT:
        width, height = float(grid.width), float(grid.height)
    else:  # the box around the turned grid, in pixels of half a cell
        c, s = abs(math.cos(yaw)), abs(math.sin(yaw))
        width = 2 * (c * grid.width + s * grid.height)
        height = 2 * (s * grid.width + c * grid.height)
    factor = 1
    while math.ceil(width / factor) * math.ceil(height / factor) > max_pixels:
        factor += 1
    return factor


def _coarser(grid: GridGeometry, factor: int) -> GridGeometry:
    """Return a grid of the same origin with cells so many times as wide; it may reach further."""
    return GridGeometry(
        math.ceil(grid.width / factor),
        math.ceil(grid.height / factor),
        grid.resolution * factor,
        grid.origin,
    )


def _highest(cells: NDArray[Any], factor: int) -> NDArray[Any]:
    """Return the highest value in each square of cells."""
    if factor == 1:
        return cells
    rows, cols = (math.ceil(length / factor) for length in cells.shape)
    highest = np.full((rows, cols), UNKNOWN, dtype=cells.dtype)
    for row in range(factor):
        for col in range(factor):
            part = cells[row::factor, col::factor]
            inside = highest[: part.shape[0], : part.shape[1]]
            np.maximum(inside, part, out=inside)
    return highest


def _placed(
    grid: GridGeometry,
    rgba: NDArray[np.uint8],
    base_T_layer: Pose2D,
    factor: int,
    says: dict[str, dict[str, Any]],
) -> EmbeddedRaster:
    """Return a grid's colors (row 0 at its origin) as a picture along the base frame's axes."""
    base_T_grid = base_T_layer @ grid.origin
    in_base = GridGeometry(grid.width, grid.height, grid.resolution, base_T_grid)
    if abs(base_T_grid.yaw) < _STRAIGHT:
        x, y = base_T_grid.x, base_T_grid.y
        bounds = (x, y, x + grid.width * grid.resolution, y + grid.height * grid.resolution)
        return EmbeddedRaster(
            np.ascontiguousarray(rgba[::-1]), bounds, grid.resolution, in_base, factor, says
        )
    pixel = grid.resolution / 2
    corners = base_T_layer.apply(grid.corners())
    lowest = corners.min(axis=0)
    width, height = np.ceil((corners.max(axis=0) - lowest) / pixel - 1e-6).astype(int)
    turned = np.zeros((height, width, 4), dtype=np.uint8)
    xs = lowest[0] + (np.arange(width) + 0.5) * pixel
    for row in range(height):  # from below; at once, the coordinates of all pixels take gigabytes
        line = np.column_stack([xs, np.full(width, lowest[1] + (row + 0.5) * pixel)])
        rows, cols = grid.cells_at(base_T_layer.inverse().apply(line)).T
        on_grid = grid.contains(rows, cols)
        turned[height - 1 - row, on_grid] = rgba[rows[on_grid], cols[on_grid]]
    x, y = float(lowest[0]), float(lowest[1])
    return EmbeddedRaster(
        turned,
        (x, y, x + float(width) * pixel, y + float(height) * pixel),
        pixel,
        in_base,
        factor,
        says,
    )
