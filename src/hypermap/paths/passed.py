"""Which rooms and doors a path passes."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.core.arrays import FloatArray
from hypermap.rooms.rooms import Door, Room, Rooms

_OUTSIDE = -1


def passed(
    points_xy: NDArray[np.float64], rooms: Rooms, step: float
) -> tuple[tuple[Room, ...], tuple[Door, ...]]:
    """Return the rooms and the doors that a path passes, in order.

    Args:
        points_xy: the path, in the frame of the rooms [m], shape (N, 2).
        rooms: those of the map.
        step: how far apart the points are at which we look [m].
    """
    line = shapely.LineString(points_xy)
    at = np.linspace(0, line.length, max(2, int(line.length / step) + 1))
    places = shapely.get_coordinates(shapely.line_interpolate_point(line, at))
    which = _rooms_at(places, rooms)
    inside = np.flatnonzero(which != _OUTSIDE)
    if not len(inside):
        return (), ()
    changes = inside[np.flatnonzero(np.diff(which[inside], prepend=_OUTSIDE))]
    doors = []
    for before, after in zip(changes[:-1].tolist(), changes[1:].tolist(), strict=True):
        ids = {rooms.rooms[which[i]].id for i in (before, after)}
        between = [door for door in rooms.doors if ids.issuperset(door.rooms)]
        if between:
            crossing = shapely.Point(places[after])
            doors.append(min(between, key=lambda door: door.line.distance(crossing)))
    return tuple(rooms.rooms[which[i]] for i in changes), tuple(doors)


def _rooms_at(places: FloatArray, rooms: Rooms) -> NDArray[np.int64]:
    """Return the place in `rooms` of the room at each point, (N, 2), or _OUTSIDE."""
    which = np.full(len(places), _OUTSIDE, dtype=np.int64)
    tree = shapely.STRtree([room.outline for room in rooms])
    found, room = tree.query(shapely.points(places), predicate="within")
    which[found] = room
    return which
