"""What a camera has covered of an area that is to be mapped, as the layer `mapped_grid`.

Source: `automap` of the first Hypermap program (2019).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import BoolArray
from hypermap.core.cell_outlines import cell_outlines
from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.core.occupancy import OCCUPIED, UNKNOWN, OccupancyLayer

LAYER = "mapped_grid"

_THICK = 0.75  # cells from the border's line within which cells are occupied


@dataclass(frozen=True, eq=False)
class Coverage:
    """How much of an area is covered.

    Attributes:
        area: all of it, in the base frame.
        share: of its cells that are known by now, 0..1.
        rest: the cells that are not, in the base frame; may be empty.
    """

    area: BaseGeometry
    share: float
    rest: BaseGeometry


@dataclass(frozen=True, eq=False)
class AreaToMap:
    """An area that a camera is to cover.

    The layer `mapped_grid` has the geometry of an occupancy layer. Its cells at the area's border
    are occupied, and all others unknown until they are covered, so that a program that drives to
    frontiers of it drives to where the camera has not looked yet.

    Attributes:
        area: in the base frame.
        source: name of the occupancy layer.
        inside: its cells in the area, without those at the border, shape (height, width).
    """

    area: BaseGeometry
    source: str
    inside: BoolArray

    @classmethod
    def begun(cls, hypermap: Hypermap, area: BaseGeometry) -> tuple[AreaToMap, OccupancyLayer]:
        """Return an area of a map, and the layer in which nothing of it is covered yet.

        Args:
            hypermap: the map.
            area: in the base frame.

        Raises:
            HypermapError: If the map has no occupancy layer, or no cell of it is in the area.
        """
        source = _first_grid(hypermap)
        grid = source.grid
        assert grid is not None  # it has cells
        local = hypermap.frames.lookup(source.frame_id, hypermap.base_frame).apply_geometry(area)
        border = grid.cells_in(local.boundary.buffer(_THICK * grid.resolution))
        inside = np.zeros(grid.shape, dtype=bool)
        inside[grid.cells_in(local)] = True
        inside[border] = False
        if not inside.any():
            raise HypermapError(f"the area covers no cell of layer {source.name!r}")
        cells = np.full(grid.shape, UNKNOWN, dtype=np.int8)
        cells[border] = OCCUPIED
        return cls(area, source.name, inside), OccupancyLayer(LAYER, source.frame_id, grid, cells)

    def covered(self, seen: BaseGeometry, hypermap: Hypermap, layer: Layer) -> Layer:
        """Return the layer with the cells that a camera has seen, copied from the source.

        Args:
            seen: what it has seen, in the base frame.
            hypermap: the map.
            layer: `mapped_grid` so far.
        """
        source = hypermap.occupancy(self.source)
        if not isinstance(layer, OccupancyLayer) or layer.grid is None or layer.cells is None:
            return layer
        local = hypermap.frames.lookup(layer.frame_id, hypermap.base_frame).apply_geometry(seen)
        rows, cols = layer.grid.cells_in(local)
        if layer.cells.shape == self.inside.shape:
            inside = self.inside[rows, cols]
            rows, cols = rows[inside], cols[inside]
        cells = layer.cells.copy()
        # By place, as a map that another node makes may have grown meanwhile.
        cells[rows, cols] = source.value_at(layer.grid.centers(rows, cols))
        return OccupancyLayer(layer.name, layer.frame_id, layer.grid, cells, layer.settings)

    def coverage(self, hypermap: Hypermap) -> Coverage | None:
        """Return how much is covered by now; None if the map has no such layer any more."""
        layer = next((each for each in hypermap if each.name == LAYER), None)
        if not isinstance(layer, OccupancyLayer) or layer.grid is None or layer.cells is None:
            return None
        grid = layer.grid
        if layer.cells.shape != self.inside.shape:
            return None
        missing = self.inside & (layer.cells == UNKNOWN)
        share = 1 - np.count_nonzero(missing) / np.count_nonzero(self.inside)
        outlines, _ = cell_outlines(missing.astype(np.int32))
        cells = shapely.MultiPolygon(list(outlines))
        local = shapely.transform(cells, lambda xy: xy * grid.resolution)
        pose = hypermap.frames.lookup(hypermap.base_frame, layer.frame_id) @ grid.origin
        return Coverage(self.area, float(share), pose.apply_geometry(local))


def _first_grid(hypermap: Hypermap) -> OccupancyLayer:
    """Return the first occupancy layer that holds something.

    Raises:
        HypermapError: If there is none, or the name of ours is taken.
    """
    if LAYER in hypermap and not isinstance(hypermap[LAYER], OccupancyLayer):
        raise HypermapError(f"layer {LAYER!r} is not an occupancy layer; rename it")
    for layer in hypermap:
        if isinstance(layer, OccupancyLayer) and layer.name != LAYER and layer.cells is not None:
            return layer
    raise HypermapError("the map has no occupancy layer yet")
