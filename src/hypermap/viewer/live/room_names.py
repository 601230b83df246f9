"""Names of the rooms that objects are in, for the page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from hypermap.core.arrays import FloatArray
from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.rooms.questions import rooms_at, rooms_called
from hypermap.rooms.rooms import Rooms, rooms_on


def names_of_rooms(hypermap: Hypermap, points_xy: Sequence[FloatArray]) -> list[str | None]:
    """Return the name of the room that each point of the base frame is in; None if in none."""
    rooms = _rooms(hypermap)
    if rooms is None:
        return [None] * len(points_xy)
    return [
        None if room is None else room.name
        for room in rooms_at(rooms, np.reshape(points_xy, (-1, 2)))
    ]


def doors_of_room(hypermap: Hypermap, number: int) -> list[dict[str, Any]]:
    """Return the name of the room behind each door of a room, and the door's width [m]."""
    rooms = _rooms(hypermap)
    if rooms is None:
        return []
    names = {room.id: room.name for room in rooms}
    found = []
    for door in rooms.doors:
        if number in door.rooms:
            other = door.rooms[door.rooms[0] == number]
            found.append({"to": names.get(other, f"room {other}"), "width": door.width})
    return found


def means_rooms(hypermap: Hypermap, what: str) -> bool:
    """Return whether a text is the name or the kind of rooms, or an id as "room 3"."""
    rooms = _rooms(hypermap)
    return rooms is not None and bool(rooms_called(rooms, what))


def _rooms(hypermap: Hypermap) -> Rooms | None:
    """Return the rooms of a map; None if it has none that can be read."""
    try:
        return rooms_on(hypermap)
    except HypermapError:
        return None
