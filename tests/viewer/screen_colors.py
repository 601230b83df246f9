"""What colors a map has on the screen, worked out from the map itself."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.colors import class_colors
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import RasterPicture
from hypermap.core.semantic import SemanticLayer

OUTLINE = 4  # pixels; so near to an outline its color counts


class Expected:
    """The colors of a map without labels, grid lines and marks."""

    def __init__(self, hypermap: Hypermap) -> None:
        base = hypermap.base_frame
        pictures = [(layer.picture(), layer.frame_id) for layer in hypermap]
        self._pictures = [
            (picture, hypermap.frames.lookup(frame_id, base))
            for picture, frame_id in pictures
            if isinstance(picture, RasterPicture)
        ]
        self._shapes: list[tuple[shapely.Geometry, NDArray[np.float64]]] = []
        layers = [layer for layer in hypermap if isinstance(layer, SemanticLayer)]
        colors = class_colors(name for layer in layers for name in layer.names)
        for layer in layers:
            pose = hypermap.frames.lookup(hypermap.base_frame, layer.frame_id)
            table = layer.table
            placed = pose.apply_geometries(table.shapes)
            for row in np.argsort(-table.areas, kind="stable"):
                self._shapes.append((placed[row], 255 * np.array(colors[table.names[row]])))

    def is_plain(self, x: float, y: float, metres_per_pixel: float) -> bool:
        """Return whether all pixels around a point have the color of the point."""
        near = OUTLINE * metres_per_pixel
        point = shapely.Point(x, y)
        if any(shape.boundary.distance(point) < near for shape, _ in self._shapes):
            return False
        areas = np.sort([shape.area for shape, _ in self._shapes if shape.covers(point)])
        if np.isclose(areas[1:], areas[:-1]).any():  # either may lie on top
            return False
        around = [(x + near * i, y + near * j) for i in (-1, 0, 1) for j in (-1, 0, 1)]
        return len({tuple(self._ground(*place)) for place in around}) == 1

    def color(self, x: float, y: float) -> NDArray[np.float64]:
        """Return red, green, blue at a point, shape (3,); NaN off the grids."""
        color = self._ground(x, y)
        point = shapely.Point(x, y)
        for shape, own in self._shapes:
            if shape.covers(point):
                color = own
        return color

    def _ground(self, x: float, y: float) -> NDArray[np.float64]:
        color = np.full(3, np.nan)
        for picture, layer_T_base in self._pictures:
            row, col = picture.grid.cells_at(layer_T_base.apply([x, y]))[0]
            if not picture.grid.contains(row, col):
                continue
            *own, alpha = picture.rgba[row, col]
            color = np.array(own if alpha else picture.legend["Unknown"], dtype=float)
        return color
