"""Masks: the cells of a grid near objects of a class, as input for a planner's costmap."""

from __future__ import annotations

import operator
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.core.arrays import ObjectArray, as_objects
from hypermap.core.errors import HypermapError
from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry, along, check_resolution
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OCCUPIED, UNKNOWN, OccupancyLayer
from hypermap.core.semantic import SemanticLayer

DEFAULT_RESOLUTION = 0.05
"""Side of a cell [m] if the map has no occupancy layer."""

MAX_CELLS = 1 << 28
MAX_MARGIN = 1e9  # meters; objects are not farther out

_EXACT = 1e-6  # of a cell; shorter lengths are ignored, as in GridGeometry
_ARC = 64  # corners of a quarter circle: at most 0.01 % of the margin inside the true one


@dataclass(frozen=True)
class Zone:
    """The area around all objects of a class.

    Attributes:
        name: the objects' name, such as "desk".
        margin: how far the zone extends beyond the objects' footprints [m].
        value: the value of its cells, 0 .. 100.

    Raises:
        ValueError: If the margin is negative or above 1e9 m, or the value is out of range.
        TypeError: If the value is not an integer.
    """

    name: str
    margin: float = 0.0
    value: int = OCCUPIED

    def __post_init__(self) -> None:
        if not 0 <= self.margin <= MAX_MARGIN:
            raise ValueError(f"a margin must be from 0 to {MAX_MARGIN:g} m, got {self.margin}")
        if not 0 <= operator.index(self.value) <= OCCUPIED:
            raise ValueError(f"a mask's value must be between 0 and {OCCUPIED}, got {self.value}")


def draw_mask(
    hypermap: Hypermap,
    zones: Iterable[Zone],
    *,
    outside: int = UNKNOWN,
    resolution: float | None = None,
    name: str = "mask",
) -> OccupancyLayer:
    """Return a layer in which the cells of zones are marked.

    A cell is marked if its center is within the margin of an object with the zone's name, in any
    semantic layer. Where zones overlap, the last one counts.

    The grid is that of the first occupancy layer that has cells, so that a costmap need not be
    resized. If it is rotated, which costmaps ignore, the mask has the upright grid around it.

    Args:
        hypermap: the map; it is not changed.
        zones: what to mark.
        outside: value of all other cells, 0 .. 100; -1 leaves a costmap unchanged there.
        resolution: side of a cell [m] of a separate grid over the zones; None for the grid of
            the occupancy layer or, if there is none, for 0.05 m.
        name: name of the returned layer.

    Raises:
        FrameError: If a layer with such objects is not connected to the occupancy layer.
        HypermapError: If the mask would have more than 2^28 cells.
        ValueError: If the resolution is not within `RESOLUTIONS`, or `outside` is out of range.
        TypeError: If `outside` is not an integer.

    >>> from hypermap.core.semantic import SemanticObject
    >>> desk = SemanticObject("desk", shapely.box(1, 1, 2, 2))
    >>> layer = SemanticLayer("semantic", "map", [desk])
    >>> mask = draw_mask(Hypermap([layer]), [Zone("desk", margin=0.5)], resolution=0.25)
    >>> mask.value_at([[1.5, 1.5], [0.6, 1.5], [0.6, 0.6]])
    array([100, 100, -1], dtype=int32)
    """
    if resolution is not None:
        check_resolution(resolution)
    if not UNKNOWN <= operator.index(outside) <= OCCUPIED:
        raise ValueError(f"outside must be between {UNKNOWN} and {OCCUPIED}, got {outside}")
    chosen = list(zones)
    floor = _occupancy_with_cells(hypermap)
    frame_id = hypermap.base_frame if floor is None else floor.frame_id
    shapes = [_shapes(hypermap, zone.name, frame_id) for zone in chosen]
    if floor is not None and floor.grid is not None and resolution is None:
        grid = _upright(floor.grid)
    else:
        side = DEFAULT_RESOLUTION if resolution is None else resolution
        grid = _grid_around(chosen, shapes, side)
    _check_size(grid)
    cells = np.full(grid.shape, outside, dtype=np.int8)
    for zone, of_zone in zip(chosen, shapes, strict=True):
        for area in _within_margin(of_zone, zone.margin, _EXACT * grid.resolution):
            window = grid.window_in(area)
            cells[window.slices][window.inside] = zone.value
    return OccupancyLayer(name, frame_id, grid, cells)


def _occupancy_with_cells(hypermap: Hypermap) -> OccupancyLayer | None:
    layers = (layer for layer in hypermap if isinstance(layer, OccupancyLayer))
    return next((layer for layer in layers if layer.grid is not None), None)


def _shapes(hypermap: Hypermap, name: str, frame_id: str) -> ObjectArray:
    """Return the shapes of all objects of a name, in a frame, shape (N,)."""
    found = [as_objects([])]
    for layer in hypermap:
        if isinstance(layer, SemanticLayer):
            table = layer.table
            rows = table.rows_of(name)
            if len(rows):
                pose = hypermap.frames.lookup(frame_id, layer.frame_id)
                found.append(pose.apply_geometries(table.shapes[rows]))
    return np.concatenate(found)


def _within_margin(shapes: ObjectArray, margin: float, least: float) -> ObjectArray:
    """Return shapes, (N,), extended by a margin; a margin below `least` is ignored."""
    # Buffering drops shapes without area, and a tiny buffer may fill holes.
    return shapes if margin < least else shapely.buffer(shapes, margin, quad_segs=_ARC)


def _upright(grid: GridGeometry) -> GridGeometry:
    """Return the grid or, if it is rotated, the axis-aligned one around it."""
    if grid.origin.yaw == 0:
        return grid
    return _grid_over(grid.corners().min(axis=0), grid.corners().max(axis=0), grid.resolution)


def _grid_around(
    zones: Sequence[Zone], shapes: Sequence[ObjectArray], resolution: float
) -> GridGeometry:
    """Return a grid that covers all zones; one cell if there are none."""
    bounds = [
        shapely.total_bounds(of_zone) + np.array([-1, -1, 1, 1]) * zone.margin
        for zone, of_zone in zip(zones, shapes, strict=True)
        if len(of_zone)
    ]
    corners = np.reshape(bounds, (-1, 2)) if bounds else np.zeros((1, 2))
    return _grid_over(corners.min(axis=0), corners.max(axis=0), resolution)


def _grid_over(
    lowest: NDArray[np.float64], highest: NDArray[np.float64], resolution: float
) -> GridGeometry:
    """Return a grid over a rectangle, aligned to multiples of the resolution."""
    first = np.floor(lowest / resolution + _EXACT)
    count = np.maximum(np.ceil(highest / resolution - _EXACT) - first, 1)
    pose = Pose2D(along(first[0], resolution), along(first[1], resolution))
    return GridGeometry(int(count[0]), int(count[1]), resolution, pose)


def _check_size(grid: GridGeometry) -> None:
    if grid.width * grid.height > MAX_CELLS:
        raise HypermapError(
            f"a mask of {grid.width} x {grid.height} cells is too large; "
            "give it a larger resolution, or use an occupancy layer's grid"
        )
