"""Find the rooms in the cells of a grid."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arguments import check_kind
from hypermap.core.arrays import BoolArray, FloatArray, IntArray
from hypermap.core.cell_outlines import cell_outlines
from hypermap.core.errors import HypermapError
from hypermap.core.grid import GridGeometry
from hypermap.core.occupancy import OCCUPIED, OccupancyLayer
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.rooms.doors import doors_between
from hypermap.rooms.floor import with_unseen, without_obstacles, without_rays
from hypermap.rooms.furniture import without_furniture
from hypermap.rooms.kept import numbered
from hypermap.rooms.kinds import Kinds, guess_kinds, load_kinds
from hypermap.rooms.openings import openings
from hypermap.rooms.pieces import Passage, Pieces
from hypermap.rooms.rooms import Room, Rooms
from hypermap.rooms.sections import across_corridors, gaps_in_walls
from hypermap.rooms.settings import RoomSettings
from hypermap.rooms.watershed import basins, clearance, in_order, spread

_NOISE = 0.15  # [m] how much a straight wall may appear bent
_WALL = 0.5  # [m] shorter walls are not extended as a border of a room
_DOOR = 1.6  # [m] a narrower passage may be a door even without corners of walls next to it
_ALONG = np.linspace(0.15, 0.85, 9)  # where the sides of a line are sampled, from end to end
_BESIDE = np.array([-2.0, -1.0, -0.5, 0.5, 1.0, 2.0])[:, np.newaxis, np.newaxis]
"""Cells from a line to the places on either side of it."""
_STRAIGHT = 1.5  # cells by which outlines are simplified, about


def find_rooms(
    occupancy: OccupancyLayer,
    settings: RoomSettings | None = None,
    *,
    objects: Iterable[SemanticObject] = (),
    kinds: Kinds | None = None,
    previous: SemanticLayer | None = None,
) -> Rooms:
    """Cut free space into rooms and corridors; the same cells give the same rooms.

    Cells from 0 to 49 are free. Everything else is a wall, unless it is small and touches no wall,
    or unknown and mostly surrounded by free cells (`with_unseen`). Space is cut where lines of
    walls continue across it (`openings`) and where it is narrow (`basins`); the pieces are joined
    again unless a door or an open side separates them (`Pieces`).

    Args:
        occupancy: the grid.
        settings: what a room is.
        objects: the objects in the rooms, in the layer's frame: they decide the kinds of rooms, and
            their places are no walls.
        kinds: the table of kinds; None for ours.
        previous: rooms that were found before, in the same frame: where they overlap, ids and names
            given by hand are kept.

    Raises:
        HypermapError: If the layer is empty, or has no free cell.
        TypeError: If it is not an occupancy layer.
    """
    check_kind(occupancy, OccupancyLayer)
    chosen = RoomSettings() if settings is None else settings
    if occupancy.grid is None or occupancy.cells is None:
        raise HypermapError(f"layer {occupancy.name!r} is empty, so there are no rooms to find")
    free = (occupancy.cells >= 0) & (occupancy.cells < OCCUPIED / 2)
    if not free.any():
        raise HypermapError(
            f"layer {occupancy.name!r} has no free cell: rooms are free space between walls"
        )
    grid, objects = occupancy.grid, list(objects)
    free = with_unseen(free, occupancy.cells < 0, grid.resolution)
    free = without_furniture(free, (item.footprint for item in objects), grid)
    found = _Found.of(free, grid.resolution, chosen)
    shapes = _outlines(found.labels, grid)
    rooms = tuple(Room(number, "", shape) for number, shape in enumerate(shapes))
    doors = doors_between(found.labels, found.walls, grid)
    whole = Rooms(occupancy.frame_id, rooms, doors, grid, found.labels - 1)
    table = load_kinds() if kinds is None else kinds
    return guess_kinds(numbered(whole, previous), objects, table)


@dataclass(frozen=True, eq=False)
class _Found:
    """Rooms as labels of cells.

    Attributes:
        labels: int32, shape (height, width), from 1; 0 where there is no room.
        walls: what is not free, without small obstacles, of the same shape.
    """

    labels: NDArray[np.int32]
    walls: BoolArray

    @classmethod
    def of(cls, free: BoolArray, side: float, settings: RoomSettings) -> _Found:
        """Cut free cells into rooms.

        Args:
            free: shape (height, width).
            side: of a cell [m].
            settings: what a room is.
        """
        labels = np.zeros(free.shape, dtype=np.int32)
        walls = np.ones(free.shape, dtype=bool)
        if not free.any():
            return cls(labels, walls)
        rows, cols = np.flatnonzero(free.any(axis=1)), np.flatnonzero(free.any(axis=0))
        window = (slice(rows[0], rows[-1] + 1), slice(cols[0], cols[-1] + 1))
        blocked = without_obstacles(~free[window], side, settings.largest_obstacle)
        inner = np.pad(without_rays(blocked, side), 1, constant_values=True)
        cut = _cut(inner, side, settings)
        labels[window] = cut[1:-1, 1:-1]
        walls[window] = inner[1:-1, 1:-1]
        return cls(labels, walls)


def _cut(walls: BoolArray, side: float, settings: RoomSettings) -> NDArray[np.int32]:
    """Return rooms as labels from 1, by their first cell; 0 where there is none."""
    lines = _lines(walls, side, settings)
    lines = lines[~across_corridors(lines, walls, side)]
    closed = walls.copy()
    for begin, end in lines:
        _draw(closed, begin, end)
    far = clearance(closed)
    parts = basins(far, _DOOR / side)
    count = int(parts.max())
    area = np.bincount(parts.ravel(), minlength=count + 1) * side**2
    perimeter = np.zeros(count + 1)
    shapes, owners = cell_outlines(parts)
    np.add.at(perimeter, owners, shapely.length(shapely.simplify(shapes, _STRAIGHT)) * side)
    clear = np.zeros(count + 1)
    np.maximum.at(clear, parts.ravel(), far.ravel())
    whole = spread(parts, walls)
    # By the spread parts, too: where two lines run side by side, there is no part between them.
    passages = [
        *_passages_of(lines, gaps_in_walls(lines, walls, side), whole, side),
        *_passages_between(parts, far, side),
        *_passages_between(whole, clearance(walls), side),
    ]
    pieces = Pieces(area, perimeter, (clear - 0.5) * side, passages, settings)
    rooms = np.array(pieces.room_of(), dtype=np.int32)[whole]
    large = np.bincount(rooms.ravel()) * side**2 >= settings.least_area
    large[0] = False
    return in_order(np.where(large[rooms], rooms, -1).astype(np.int32))


def _lines(walls: BoolArray, side: float, settings: RoomSettings) -> NDArray[np.float64]:
    """Return the lines at which rooms may end, in units of cells, shape (N, 2, 2)."""
    areas, _ = cell_outlines((~walls).astype(np.int32))
    found = [
        openings(area, _NOISE / side, settings.widest_opening / side, _WALL / side)
        for area in areas
        if area.area * side**2 >= settings.least_area
    ]
    return np.concatenate([np.empty((0, 2, 2)), *found])


def _draw(cells: BoolArray, begin: FloatArray, end: FloatArray) -> None:
    """Set cells along a line, so that none of its sides touches the other but at corners."""
    steps = int(np.ceil(4 * np.abs(end - begin).max())) + 1
    places = begin + np.linspace(0, 1, steps)[:, np.newaxis] * (end - begin)
    cols, rows = np.floor(places).astype(np.int64).T
    cols = np.clip(cols, 0, cells.shape[1] - 1)
    rows = np.clip(rows, 0, cells.shape[0] - 1)
    cells[rows, cols] = True
    cells[rows[1:], cols[:-1]] = True  # where it goes from a cell to one across a corner


def _passages_of(
    lines: FloatArray, in_walls: BoolArray, parts: NDArray[np.int32], side: float
) -> list[Passage]:
    """Return which parts lie on both sides of each line, and how long it is between them."""
    passages = []
    for (begin, end), in_wall in zip(lines, in_walls.tolist(), strict=True):
        length = float(np.hypot(*(end - begin)))
        across = np.array([begin[1] - end[1], end[0] - begin[0]]) / length
        places = begin + _ALONG[:, np.newaxis] * (end - begin)
        beside = _parts_at(parts, places + _BESIDE * across)
        one, other = beside[0], beside[-1]
        is_open = (beside > 0).all(axis=0)  # not at a wall that the line runs along
        between = np.sort(np.column_stack([one, other])[(one != other) & is_open])
        for (low, high), count in Counter(map(tuple, between.tolist())).items():
            # What borders most of a line is divided by all of it.
            share = 1.0 if 2 * count > len(_ALONG) and is_open.all() else count / len(_ALONG)
            passages.append(Passage(low, high, share * length * side, in_wall))
    return passages


def _parts_at(parts: NDArray[np.int32], places: FloatArray) -> NDArray[np.int32]:
    """Return the part at each place, (x, y) in cells, shape (..., 2); 0 for none."""
    cols, rows = np.moveaxis(np.floor(places).astype(np.int64), -1, 0)
    cols = np.clip(cols, 0, parts.shape[1] - 1)
    rows = np.clip(rows, 0, parts.shape[0] - 1)
    found: NDArray[np.int32] = parts[rows, cols]
    return found


def _passages_between(
    parts: NDArray[np.int32], far: NDArray[np.float32], side: float
) -> list[Passage]:
    """Return parts that touch each other, and how wide the way between them is."""
    pairs: list[IntArray] = []
    widths = []
    for here, there in (
        ((slice(None), slice(1, None)), (slice(None), slice(None, -1))),
        ((slice(1, None), slice(None)), (slice(None, -1), slice(None))),
    ):
        one, other = parts[here], parts[there]
        meet = (one != other) & (one > 0) & (other > 0)
        both = np.stack([one[meet], other[meet]], axis=1)
        pairs.append(np.sort(both, axis=1).astype(np.int64))
        widths.append(np.minimum(far[here][meet], far[there][meet]))
    if not sum(map(len, pairs)):
        return []
    found, inverse = np.unique(np.concatenate(pairs), axis=0, return_inverse=True)
    widest = np.zeros(len(found))
    np.maximum.at(widest, inverse.ravel(), np.concatenate(widths))
    return [
        Passage(one, other, 2 * width * side)
        for (one, other), width in zip(found.tolist(), widest.tolist(), strict=True)
    ]


def _outlines(labels: NDArray[np.int32], grid: GridGeometry) -> list[BaseGeometry]:
    """Return the outline of each room in the layer's frame; neighbors share their edges."""
    faces, owners = cell_outlines(labels)
    if not len(faces):
        return []
    simple = shapely.coverage_simplify(faces, _STRAIGHT)
    pose = grid.origin

    def placed(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.round(pose.apply(points * grid.resolution), 6)

    simple = shapely.transform(simple, placed)
    shapes: list[BaseGeometry] = []
    for label in range(1, int(labels.max()) + 1):
        own = simple[owners == label]
        shapes.append(own[0] if len(own) == 1 else shapely.MultiPolygon(list(own)))
    return shapes
