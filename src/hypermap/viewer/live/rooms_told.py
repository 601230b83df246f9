"""In which rooms objects are, as the page tells it."""

from __future__ import annotations

from hypermap.core.arrays import PointsLike
from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.rooms.questions import rooms_at, rooms_called
from hypermap.rooms.rooms import Rooms, rooms_on


def names_of_rooms(hypermap: Hypermap, points_xy: PointsLike) -> list[str | None]:
    """Return the name of the room that each point of the base frame is in; None if in none."""
    rooms = _rooms(hypermap)
    if rooms is None:
        return [None for _ in points_xy]
    return [None if room is None else room.name for room in rooms_at(rooms, points_xy)]


def means_rooms(hypermap: Hypermap, what: str) -> bool:
    """Return whether a text is the name or the kind of rooms, or an id as "room 3"."""
    rooms = _rooms(hypermap)
    return rooms is not None and bool(rooms_called(rooms, what))


def _rooms(hypermap: Hypermap) -> Rooms | None:
    """Return the rooms of a map; None if it has none that can be read, of which the page tells."""
    try:
        return rooms_on(hypermap)
    except HypermapError:
        return None
