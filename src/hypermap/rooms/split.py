"""Splits a room along a line drawn by hand."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
import shapely
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry
from shapely.ops import split

from hypermap.core.arrays import as_objects
from hypermap.core.errors import HypermapError
from hypermap.core.shapes import valid_copies
from hypermap.rooms.doors import LEAST_WIDTH
from hypermap.rooms.rooms import Door, Room, Rooms, door_order

_REACH = 0.5  # [m] how far a line that ends in the room is extended, to reach the wall
_STEP = 0.02  # [m] between the points of a cut at which its width is measured
_SAME = 1e-6  # [m] a point that is nearer to an edge is on it


def split_room(rooms: Rooms, number: int, line: LineString, new_id: int) -> Rooms:
    """Return rooms of which one is divided in two by a line, without cells.

    The larger part keeps id and name. The other one has the same kind and the name with the next
    free number; that name counts as given by hand if the room's name was. Each door belongs to the
    part that its middle touches. The border of the parts becomes a new door, unless it is less than
    0.3 m wide. Rooms at the ends of the line get a corner there, so that edges stay shared.

    Args:
        rooms: all of them.
        number: id of the room to split.
        line: across it, in the frame of the rooms [m]. An end in the room is extended by half a
            meter.
        new_id: of the smaller part.

    Raises:
        HypermapError: If there is no such room, or the line does not cut it into two parts.
    """
    room = rooms[number]
    larger, smaller = _parts(room, line)
    new_name = _next_name(room.name, {each.name for each in rooms})
    divided = [replace(each, outline=larger) if each is room else each for each in rooms]
    divided.append(replace(room, id=new_id, name=new_name, outline=smaller))

    doors = [
        replace(door, rooms=_renamed(door.rooms, number, new_id))
        if number in door.rooms and _is_nearer(door, smaller, larger)
        else door
        for door in rooms.doors
    ]
    cut = _shared_edge(larger, smaller)
    both = min(number, new_id), max(number, new_id)
    doors += [replace(door, rooms=both) for door in _doors_along(cut, room.outline)]

    divided = sorted(_with_corners(divided, cut), key=lambda each: each.id)
    return Rooms(rooms.frame_id, tuple(divided), tuple(sorted(doors, key=door_order)))


def _parts(room: Room, line: LineString) -> tuple[BaseGeometry, BaseGeometry]:
    """Return the larger and the smaller part of a room."""
    (outline,) = valid_copies(as_objects([room.outline]))
    drawn = _extended(line, outline)
    pieces = [list(split(part, drawn).geoms) for part in shapely.get_parts(outline)]
    cuts = sum(len(parts) - 1 for parts in pieces)
    if cuts == 0:
        raise HypermapError(
            f"the line does not divide {room.name!r}; draw it from one wall to another"
        )
    if cuts > 1:
        raise HypermapError(
            f"the line cuts {room.name!r} into more than two parts; draw one that crosses it once"
        )
    (two,) = (parts for parts in pieces if len(parts) == 2)
    smaller, larger = sorted(two, key=lambda part: float(part.area))
    whole = [parts[0] for parts in pieces if len(parts) == 1]
    rest: BaseGeometry = shapely.union_all([larger, *whole]) if whole else larger
    return rest, smaller


def _extended(line: LineString, outline: BaseGeometry) -> LineString:
    """Return a line whose ends are extended while they are inside an outline."""
    points = shapely.get_coordinates(shapely.remove_repeated_points(line))
    if line.length == 0:
        return line
    for end, before in ((0, 1), (-1, -2)):
        along = points[end] - points[before]
        if outline.contains(shapely.Point(points[end])):
            points[end] += _REACH * along / np.hypot(*along)
    return LineString(points)


def _shared_edge(one: BaseGeometry, other: BaseGeometry) -> list[LineString]:
    """Return where two parts meet: several lines if there is a column between them."""
    edges = [part for part in shapely.get_parts(one.intersection(other)) if part.length > 0]
    return list(shapely.get_parts(shapely.line_merge(shapely.MultiLineString(edges))))


def _doors_along(cut: Iterable[LineString], outline: BaseGeometry) -> Iterator[Door]:
    """Yield the doors at which two parts meet; the caller fills in which rooms they join."""
    for line in cut:
        places = shapely.get_coordinates(shapely.segmentize(line, _STEP))
        far = np.asarray(shapely.distance(shapely.points(places), outline.boundary))
        width = 2 * float(far.max())
        if width >= LEAST_WIDTH:
            yield Door((0, 0), LineString(places[[0, -1]]), round(width, 6))


def _is_nearer(door: Door, one: BaseGeometry, other: BaseGeometry) -> bool:
    """Return whether a door is nearer to one part of its room than to the other."""
    middle = shapely.Point(door.place_xy)
    return bool(middle.distance(one) < middle.distance(other))


def _renamed(ids: tuple[int, int], old: int, new: int) -> tuple[int, int]:
    low, high = sorted(new if number == old else number for number in ids)
    return low, high


def _with_corners(rooms: Iterable[Room], cut: Iterable[LineString]) -> Iterator[Room]:
    """Yield rooms that have a corner at each end of a cut that touches them."""
    ends = [shapely.Point(line.coords[end]) for line in cut for end in (0, -1)]
    for room in rooms:
        touching = [end for end in ends if end.distance(room.outline) < _SAME]
        if touching:
            corners = shapely.MultiPoint(touching)
            yield replace(room, outline=shapely.snap(room.outline, corners, _SAME))
        else:
            yield room


def _next_name(name: str, taken: set[str]) -> str:
    """Return a name with the next free number: after "office", "office 2"."""
    base, _, last = name.rpartition(" ")
    if not (base and last.isdecimal()):
        base, last = name, "1"
    number = int(last) + 1
    while f"{base} {number}" in taken:
        number += 1
    return f"{base} {number}"
