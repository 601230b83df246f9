"""Rooms and doors as messages."""

from __future__ import annotations

from hypermap.core.shapes import repaired
from hypermap.core.tangles import is_sound
from hypermap.rooms.rooms import Door, Room
from hypermap.ros.messages.geometry_messages import Types, point, polygons_of
from hypermap.ros.messages.semantic_messages import polygon_with_holes
from hypermap.ros.port import Message


def room_message(room: Room, types: Types) -> Message:
    """Return a room as `hypermap_msgs/Room`, in the frame that it has."""
    shape = room.outline if is_sound(room.outline) else repaired(room.outline)
    return types.message("hypermap_msgs/Room")(
        id=room.id,
        name=room.name,
        kind=room.kind,
        sure=float(room.sure),
        named_by_hand=room.is_named,
        area=float(shape.area),
        outline=[polygon_with_holes(part, types) for part in polygons_of(room.outline)],
    )


def door_message(door: Door, types: Types) -> Message:
    """Return a door as `hypermap_msgs/Door`, in the frame that it has."""
    begin, end = door.line.coords[0], door.line.coords[-1]
    return types.message("hypermap_msgs/Door")(
        room=door.rooms[0],
        other=door.rooms[1],
        begin=point(begin[0], begin[1], types),
        end=point(end[0], end[1], types),
        width=float(door.width),
    )
