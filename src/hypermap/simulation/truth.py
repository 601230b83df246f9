"""The map that perfect mapping would make of a world."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry import Polygon
from shapely.geometry.base import BaseGeometry

from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry, along
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyLayer
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.simulation.parts import Part
from hypermap.simulation.scene import footprint, placed, wall_parts
from hypermap.simulation.world import World

RESOLUTION = 0.05  # meters per cell
BLOCKING = (0.05, 1.8)  # meters above the floor between which a body blocks a robot
_LEAST_ROOM = 1.0  # square meters: less is a gap between a wall and the end of the floor
_MARGIN = 0.5  # meters of the unknown around the world
_STRAIGHT = 0.25  # meters of a wall that stay straight where a map is bent


def ground_truth(world: World, frame_id: str = "map") -> Hypermap:
    """Return the true map: the layer "occupancy", and the layer "semantic" of true footprints."""
    return Hypermap([true_occupancy(world, frame_id), true_objects(world, frame_id)])


def true_objects(world: World, frame_id: str = "map") -> SemanticLayer:
    """Return the world's objects with their exact footprints; ids are places in the world's list.

    The heights of each object are its attributes `z_min` and `z_max` [m].
    """
    layer = SemanticLayer("semantic", frame_id)
    layer.add(_object(i, thing.label, placed(thing)) for i, thing in enumerate(world.objects))
    return layer


def true_occupancy(
    world: World,
    frame_id: str = "map",
    resolution: float = RESOLUTION,
    bend: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None = None,
) -> OccupancyLayer:
    """Return the occupancy that walls and objects cause.

    Cells that a body touches between the heights of `BLOCKING` are occupied, all others on the
    floor free, and the rest is unknown.

    Args:
        world: what there is.
        frame_id: of the map.
        resolution: side of a cell [m].
        bend: moves points, shape (N, 2), as a map does in which places are off; None for none.
    """
    floor = shapely.union_all([shapely.box(*area) for area in world.floor.all_rectangles])
    parts = [part for wall in world.walls for part in wall_parts(wall)]
    parts += [part for thing in world.objects for part in placed(thing)]
    obstacles = footprint(part for part in parts if _blocks(part))
    if bend is not None:
        floor, obstacles = (_bent(area, bend) for area in (floor, obstacles))

    grid = grid_around(shapely.union(floor, obstacles), resolution)
    cells = np.full(grid.shape, UNKNOWN, dtype=np.int8)
    cells[grid.cells_in(floor)] = FREE
    cells[_touched(grid, obstacles)] = OCCUPIED
    return OccupancyLayer("occupancy", frame_id, grid, cells)


def true_rooms(world: World) -> list[Polygon]:
    """Return the outlines of a world's rooms: its floor, divided by walls whose doors are closed.

    What a robot could look over, as a half-high partition, divides no room.
    """
    floor = shapely.union_all([shapely.box(*area) for area in world.floor.all_rectangles])
    walls = [replace(wall, doors=()) for wall in world.walls if wall.height >= BLOCKING[1]]
    rest = floor - footprint(part for wall in walls for part in wall_parts(wall))
    return [part for part in shapely.get_parts(rest) if part.area >= _LEAST_ROOM]


def _object(index: int, name: str, parts: tuple[Part, ...]) -> SemanticObject:
    heights = np.concatenate([part.vertices[:, 2] for part in parts])
    return SemanticObject(
        name,
        footprint(parts),
        id=index,
        attributes={"z_min": float(heights.min()), "z_max": float(heights.max())},
    )


def _blocks(part: Part) -> bool:
    z = part.vertices[:, 2]
    return bool(z.max() > BLOCKING[0] and z.min() < BLOCKING[1])


def grid_around(area: BaseGeometry, resolution: float) -> GridGeometry:
    """Return a grid that covers the area, with its origin on a multiple of the resolution."""
    x0, y0, x1, y1 = area.bounds
    left, bottom = (math.floor((low - _MARGIN) / resolution) for low in (x0, y0))
    right, top = (math.ceil((high + _MARGIN) / resolution) for high in (x1, y1))
    origin = Pose2D(along(left, resolution), along(bottom, resolution))
    return GridGeometry(right - left, top - bottom, resolution, origin)


def _bent(
    area: BaseGeometry, bend: Callable[[NDArray[np.float64]], NDArray[np.float64]]
) -> BaseGeometry:
    """Return an area whose points were moved; what then covers itself counts once."""
    moved = shapely.transform(shapely.segmentize(area, _STRAIGHT), bend)
    return shapely.union_all(shapely.buffer(shapely.get_parts(moved), 0))


def _touched(grid: GridGeometry, area: BaseGeometry) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return rows and columns of the cells that share some area with `area`."""
    half = 0.499 * grid.resolution  # a little less than half, so that a mere touch does not count
    near = area.buffer(half * math.sqrt(2), join_style="mitre")  # a corner may be what touches
    rows, cols = grid.cells_in(near)
    centers = grid.centers(rows, cols)
    squares = shapely.box(*(centers - half).T, *(centers + half).T)
    hit = shapely.intersects(area, squares)
    return rows[hit], cols[hit]
