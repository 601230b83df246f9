"""Rooms and doors, and the semantic layer that keeps them."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely.geometry import LineString
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import FloatArray
from hypermap.core.errors import HypermapError, did_you_mean
from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import ROOMS, Hypermap
from hypermap.core.semantic import SemanticLayer, SemanticObject

_GIVEN = "automatic_name"  # which a room had from us; another name was given by hand
DOORS = "doors"
"""The attribute of a room that holds its doors."""
NO_ROOMS = "the map has no rooms; `hypermap rooms MAP -o OUT` finds them"


@dataclass(frozen=True, eq=False)
class Room:
    """A room.

    Attributes:
        id: stays the same when rooms are found again.
        name: its name; unique among the rooms that are found together.
        outline: Polygon or MultiPolygon in the frame of the rooms [m].
        kind: such as "kitchen"; empty if unknown.
        sure: confidence of the kind, 0..1.
        is_named: whether the name was given by hand.
        attributes: other attributes.
    """

    id: int
    name: str
    outline: BaseGeometry
    kind: str = ""
    sure: float = 0.0
    is_named: bool = False
    attributes: Mapping[str, Any] = field(default_factory=dict)

    @property
    def area(self) -> float:
        """Its area [m^2]."""
        return float(self.outline.area)


@dataclass(frozen=True, eq=False)
class Door:
    """A passage between two rooms.

    Attributes:
        rooms: ids of both, the lower one first.
        line: the border between the rooms: a straight LineString [m].
        width: diameter of the widest disc that fits between the walls there [m].
    """

    rooms: tuple[int, int]
    line: LineString
    width: float

    @property
    def place_xy(self) -> FloatArray:
        """Its middle, shape (2,) [m]."""
        middle = self.line.interpolate(0.5, normalized=True)
        return np.array([middle.x, middle.y])

    def lets_pass(self, robot_radius: float) -> bool:
        """Return whether a robot of a radius [m] fits through."""
        return self.width >= 2 * robot_radius


@dataclass(frozen=True, eq=False)
class Rooms:
    """All rooms of a map and the doors between them.

    Attributes:
        frame_id: of all coordinates.
        rooms: in the order of their ids.
        doors: in the order of the ids of their rooms.
        grid: the geometry of the cells; None for rooms that were read from a layer.
        cells: index in `rooms` of the room of each cell, or -1: int32, shape (height, width); None
            for rooms that were read from a layer.
    """

    frame_id: str
    rooms: tuple[Room, ...]
    doors: tuple[Door, ...]
    grid: GridGeometry | None = None
    cells: NDArray[np.int32] | None = None

    def __len__(self) -> int:
        return len(self.rooms)

    def __iter__(self) -> Iterator[Room]:
        return iter(self.rooms)

    def __getitem__(self, what: int | str) -> Room:
        """Return the room with an id or a name.

        Raises:
            HypermapError: If there is none, or there are several of that name.
        """
        found = [room for room in self.rooms if what in (room.id, room.name)]
        if len(found) == 1:
            return found[0]
        if found:
            ids = " or ".join(str(room.id) for room in found)
            raise HypermapError(f"{len(found)} rooms are called {what!r}; ask by id: {ids}")
        if isinstance(what, str):
            hint = did_you_mean(what, [room.name for room in self.rooms])
            raise HypermapError(f"there is no room {what!r}; {hint}")
        raise HypermapError(f"there is no room with the id {what}")

    def layer(self, name: str = ROOMS) -> SemanticLayer:
        """Return the rooms as a semantic layer, whose objects have the rooms' ids and names.

        A room's kind is its tag, with its confidence. Doors are stored with the room of the lower
        id, as an attribute.
        """
        return SemanticLayer(name, self.frame_id, [self._as_object(room) for room in self.rooms])

    def _as_object(self, room: Room) -> SemanticObject:
        attributes = dict(room.attributes)
        if not room.is_named:
            attributes[_GIVEN] = room.name
        doors = [
            {
                "to": door.rooms[1],
                "line": [list(map(float, point)) for point in door.line.coords],
                "width": float(door.width),
            }
            for door in self.doors
            if door.rooms[0] == room.id
        ]
        if doors:
            attributes[DOORS] = doors
        return SemanticObject(
            room.name,
            room.outline,
            room.id,
            (room.kind,) if room.kind else (),
            (room.sure,) if room.kind else (),
            attributes=attributes,
        )

    @classmethod
    def of_layer(cls, layer: SemanticLayer) -> Rooms:
        """Return the rooms in a layer; every object is a room.

        Doors to missing rooms are left out.

        Raises:
            HypermapError: If the doors of a room cannot be read.
        """
        rooms, doors = [], []
        for item in layer:
            attributes = dict(item.attributes)
            given = attributes.pop(_GIVEN, None)
            kind = item.tags[0] if item.tags else ""
            sure = item.confidence[0] if item.confidence else 0.0
            kept = attributes.pop(DOORS, [])
            assert item.id is not None
            is_named = given != item.name
            rooms.append(Room(item.id, item.name, item.footprint, kind, sure, is_named, attributes))
            doors += _doors_of(item.id, kept, layer)
        ids = {room.id for room in rooms}
        rooms.sort(key=lambda room: room.id)
        doors = [door for door in doors if ids.issuperset(door.rooms)]
        return cls(layer.frame_id, tuple(rooms), tuple(sorted(doors, key=door_order)))

    def moved(self, pose: Pose2D, frame_id: str) -> Rooms:
        """Return the same rooms and doors in another frame, without cells.

        Args:
            pose: of the rooms' frame in that frame.
            frame_id: of that frame.
        """
        if pose.is_identity:
            return replace(self, frame_id=frame_id)
        rooms = [replace(room, outline=pose.apply_geometry(room.outline)) for room in self.rooms]
        doors = [
            replace(door, line=LineString(pose.apply(np.array(door.line.coords))))
            for door in self.doors
        ]
        return Rooms(frame_id, tuple(rooms), tuple(doors))

    def joined(self, kept: int, others: Collection[int]) -> Rooms:
        """Return the rooms after some were merged into another, without cells.

        The other room gets their doors; doors between them are removed. Outlines stay.

        Args:
            kept: id of the room that they become parts of.
            others: ids of the rooms that are merged into it.
        """
        doors = []
        for door in self.doors:
            low, high = sorted(kept if number in others else number for number in door.rooms)
            if low != high:
                doors.append(replace(door, rooms=(low, high)))
        rooms = tuple(room for room in self.rooms if room.id not in others)
        return Rooms(self.frame_id, rooms, tuple(sorted(doors, key=door_order)))

    def replaced(self, rooms: list[Room]) -> Rooms:
        """Return the same with these rooms replaced; doors go along.

        The ids may differ; they determine the order.
        """
        new_id = {old.id: new.id for old, new in zip(self.rooms, rooms, strict=True)}
        order = sorted(range(len(rooms)), key=lambda place: rooms[place].id)
        doors = []
        for door in self.doors:
            low, high = sorted(new_id[number] for number in door.rooms)
            doors.append(replace(door, rooms=(low, high)))
        cells = self.cells
        if cells is not None:
            place = np.full(len(rooms) + 1, -1, dtype=np.int32)  # the last is that of no room
            place[order] = np.arange(len(rooms), dtype=np.int32)
            cells = place[cells]
        return replace(
            self,
            rooms=tuple(rooms[place] for place in order),
            doors=tuple(sorted(doors, key=door_order)),
            cells=cells,
        )


def rooms_on(hypermap: Hypermap) -> Rooms | None:
    """Return the rooms in the layer `rooms` of a map, in its base frame; None where it has none.

    Raises:
        HypermapError: If the doors of a room cannot be read.
    """
    if ROOMS not in hypermap or not isinstance(hypermap[ROOMS], SemanticLayer):
        return None
    layer = hypermap.semantic(ROOMS)
    pose = hypermap.frames.lookup(hypermap.base_frame, layer.frame_id)
    return Rooms.of_layer(layer).moved(pose, hypermap.base_frame)


def known_rooms(hypermap: Hypermap) -> Rooms:
    """Return the same as `rooms_on`, for what needs rooms.

    Raises:
        HypermapError: If the map has none, or the doors of a room cannot be read.
    """
    rooms = rooms_on(hypermap)
    if rooms is None:
        raise HypermapError(NO_ROOMS)
    return rooms


def door_order(door: Door) -> tuple[tuple[int, int], tuple[float, ...]]:
    """Return what doors are sorted by: the ids of their rooms, then where they are."""
    return door.rooms, tuple(np.ravel(door.line.coords).tolist())


def _doors_of(room: int, kept: Any, layer: SemanticLayer) -> list[Door]:
    """Return the doors that are kept with a room."""
    doors = []
    try:
        for entry in kept:
            low, high = sorted([room, int(entry["to"])])
            doors.append(Door((low, high), LineString(entry["line"]), float(entry["width"])))
    except Exception as error:
        raise HypermapError(
            f"layer {layer.name!r}, object {room}: its doors cannot be read; find the rooms again "
            f"({type(error).__name__})"
        ) from error
    return doors
