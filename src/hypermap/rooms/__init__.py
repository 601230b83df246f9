"""Finds rooms in an occupancy layer, the doors between them, and the kind of each room."""

from typing import TYPE_CHECKING, Any

from hypermap._lazy import attribute

if TYPE_CHECKING:
    from hypermap.rooms.find import find_rooms
    from hypermap.rooms.kinds import Kinds, guess_kinds, load_kinds
    from hypermap.rooms.on_map import rooms_of_map, with_rooms
    from hypermap.rooms.questions import is_reachable, room_of, rooms_asked, rooms_at, rooms_with
    from hypermap.rooms.room_graph import Graph, graph
    from hypermap.rooms.rooms import Door, Room, Rooms
    from hypermap.rooms.settings import RoomSettings
    from hypermap.rooms.split import split_room

_HOMES = {
    "Door": "hypermap.rooms.rooms",
    "Graph": "hypermap.rooms.room_graph",
    "Kinds": "hypermap.rooms.kinds",
    "Room": "hypermap.rooms.rooms",
    "RoomSettings": "hypermap.rooms.settings",
    "Rooms": "hypermap.rooms.rooms",
    "find_rooms": "hypermap.rooms.find",
    "graph": "hypermap.rooms.room_graph",
    "guess_kinds": "hypermap.rooms.kinds",
    "is_reachable": "hypermap.rooms.questions",
    "load_kinds": "hypermap.rooms.kinds",
    "room_of": "hypermap.rooms.questions",
    "rooms_asked": "hypermap.rooms.questions",
    "rooms_at": "hypermap.rooms.questions",
    "rooms_of_map": "hypermap.rooms.on_map",
    "rooms_with": "hypermap.rooms.questions",
    "split_room": "hypermap.rooms.split",
    "with_rooms": "hypermap.rooms.on_map",
}

__all__ = [
    "Door",
    "Graph",
    "Kinds",
    "Room",
    "RoomSettings",
    "Rooms",
    "find_rooms",
    "graph",
    "guess_kinds",
    "is_reachable",
    "load_kinds",
    "room_of",
    "rooms_asked",
    "rooms_at",
    "rooms_of_map",
    "rooms_with",
    "split_room",
    "with_rooms",
]


def __getattr__(name: str) -> Any:
    return attribute(__name__, name, _HOMES)
