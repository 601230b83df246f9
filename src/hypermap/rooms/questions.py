"""Which room something is in, what is in a room, and which rooms have something."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np

from hypermap.core.arrays import BoolArray, PointsLike, as_points_xy
from hypermap.core.errors import HypermapError, did_you_mean
from hypermap.core.hypermap import FoundObject, Hypermap
from hypermap.rooms.kinds import rooms_of_points
from hypermap.rooms.room_graph import graph
from hypermap.rooms.rooms import Room, Rooms, known_rooms, rooms_on

_NUMBERED = re.compile(r"room\s+(\d+)", re.IGNORECASE)


def rooms_called(rooms: Rooms, what: str) -> list[Room]:
    """Return the rooms with a name or of a kind; of "room 3", if none has that name, that by id.

    A name counts as it is written, or else in any case, as a kind does. A room that people
    have called "room 2", and no other so, is not "room 3" by its id.
    """
    asked = what.lower()
    found = [room for room in rooms if what == room.name or asked == room.kind.lower() != ""]
    found = found or [room for room in rooms if asked == room.name.lower()]
    if not found and (by_id := _NUMBERED.fullmatch(what)) is not None:
        names = Counter(room.name.lower() for room in rooms)
        numbered = {name for name in names if names[name] == 1 and _NUMBERED.fullmatch(name)}
        same_id = [room for room in rooms if room.id == int(by_id[1])]
        found = [room for room in same_id if not (room.is_named and room.name.lower() in numbered)]
    return found


def room_called(rooms: Rooms, what: str) -> Room | None:
    """Return the one room with a name, of a kind, or with an id as "room 3"; None if there is none.

    Raises:
        HypermapError: If there are several; it names their ids.
    """
    found = rooms_called(rooms, what)
    named = [room for room in found if room.name == what] or found
    if len(named) > 1:
        ids = ", ".join(f"'room {room.id}' ({room.name})" for room in named)
        raise HypermapError(f"{len(named)} rooms are {what!r}; ask for one of {ids}")
    return named[0] if named else None


def room_asked(rooms: Rooms, what: str) -> Room:
    """Return the one room with a name, of a kind, or with an id as "room 3".

    Raises:
        HypermapError: If there is none, or there are several.
    """
    room = room_called(rooms, what)
    if room is None:
        raise _no_room(rooms, what)
    return room


def rooms_asked(hypermap: Hypermap, what: str) -> list[Room]:
    """Return the rooms of a map, in its base frame, with a name or of a kind.

    Raises:
        HypermapError: If there are none, the map has no rooms, or several rooms have that name,
            which is not a kind.
    """
    rooms = known_rooms(hypermap)
    found = _all_called(rooms, what)
    if not found:
        raise _no_room(rooms, what)
    return found


def rooms_at(rooms: Rooms, points_xy: PointsLike) -> list[Room | None]:
    """Return the room that each point is in, or up to half a meter away from, as in its wall.

    Args:
        rooms: those of the map.
        points_xy: in their frame [m], shape (N, 2).
    """
    places = rooms_of_points(rooms, as_points_xy(points_xy)).tolist()
    return [None if place < 0 else rooms.rooms[place] for place in places]


def rooms_of_objects(hypermap: Hypermap, objects: Sequence[FoundObject]) -> list[Room | None]:
    """Return the room that each object's centroid is in; None for one in none.

    All are None where the map has no rooms.

    Args:
        hypermap: the map.
        objects: as `Hypermap.objects` returns them.
    """
    rooms = rooms_on(hypermap) if objects else None
    if rooms is None:
        return [None] * len(objects)
    return rooms_at(rooms, [item.point_xy for item in objects])


def room_of(hypermap: Hypermap, what: FoundObject | PointsLike) -> Room | None:
    """Return the room that an object's centroid, or a point of the base frame, is in.

    None where it is in none.

    Raises:
        HypermapError: If the map has no rooms.
    """
    point = what.point_xy if isinstance(what, FoundObject) else what
    return rooms_at(known_rooms(hypermap), point)[0]


def stand_in_rooms(hypermap: Hypermap, what: str, points_xy: PointsLike) -> BoolArray | None:
    """Return which points are in the rooms with a name or of a kind; None if there are none.

    Args:
        hypermap: the map.
        what: a name or a kind.
        points_xy: in the base frame [m], shape (N, 2).

    Raises:
        HypermapError: If several rooms have that name, which is not a kind.
    """
    rooms = rooms_on(hypermap)
    if rooms is None:
        return None
    ids = {room.id for room in _all_called(rooms, what)}
    if not ids:
        return None
    return np.array([room is not None and room.id in ids for room in rooms_at(rooms, points_xy)])


def rooms_with(hypermap: Hypermap, names: str | Iterable[str]) -> list[Room]:
    """Return the rooms in which there is an object of a name, or of one of several.

    Raises:
        HypermapError: If the map has no rooms.
    """
    rooms = known_rooms(hypermap)
    found: Sequence[FoundObject] = hypermap.objects(names)
    there = {room.id for room in rooms_at(rooms, [item.point_xy for item in found]) if room}
    return [room for room in rooms if room.id in there]


def is_reachable(hypermap: Hypermap, start: str, goal: str, robot_radius: float = 0.0) -> bool:
    """Return whether doors that a robot fits through lead from one room to another.

    Furniture does not count: a `Planner` finds paths around it.

    Args:
        hypermap: the map.
        start: a room's name, its kind, or its id as "room 5".
        goal: likewise.
        robot_radius: radius of the robot [m].

    Raises:
        HypermapError: If the map has no rooms, a room is unknown or not the only one that is meant,
            or the radius is negative or not finite.
    """
    if not 0 <= robot_radius < math.inf:
        raise HypermapError(f"a robot's radius is 0 or more meters, got {robot_radius}")
    rooms = known_rooms(hypermap)
    ids = (room_asked(rooms, what).id for what in (start, goal))
    return graph(rooms, robot_radius).is_reachable(*ids)


def _all_called(rooms: Rooms, what: str) -> list[Room]:
    """Return the rooms of a kind, or the one with a name; raises where several have that name."""
    found = rooms_called(rooms, what)
    if found and all(room.kind.lower() != what.lower() for room in found):
        room_called(rooms, what)
    return found


def _no_room(rooms: Rooms, what: str) -> HypermapError:
    known = dict.fromkeys([*(r.name for r in rooms), *(r.kind for r in rooms if r.kind)])
    return HypermapError(f"there is no room or kind of room {what!r}; {did_you_mean(what, known)}")
