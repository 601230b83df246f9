"""The services about rooms; see the files in hypermap_msgs/srv."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hypermap import rooms
from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import ROOMS, Hypermap
from hypermap.paths.places import Places
from hypermap.rooms.rooms import Room, rooms_on
from hypermap.ros.messages.room_messages import door_message, room_message
from hypermap.ros.port import Message, Port
from hypermap.ros.server.current_map import CurrentMap

_MSGS = "hypermap_msgs"


class RoomQueries:
    """Answers about rooms, in the base frame; all raise HypermapError."""

    def __init__(self, port: Port, current: CurrentMap) -> None:
        self._port = port
        self._current = current

    def find_rooms(self, request: Message) -> Message:
        """Answer `hypermap_msgs/FindRooms`: the rooms become a layer of the map."""
        settings = _settings(request)
        before = self._current.hypermap
        found = rooms.rooms_of_map(before, settings, occupancy=request.layer or None)
        if not len(found):
            raise HypermapError("no place is as large as least_area")
        self._current.put(lambda hypermap: rooms.with_rooms(hypermap, found)[ROOMS])
        hypermap = self._current.hypermap
        layer = rooms_on(hypermap)
        doors = [] if layer is None else layer.doors
        return self._answer(
            "FindRooms",
            hypermap,
            [] if layer is None else layer.rooms,
            doors=[door_message(door, self._port) for door in doors],
        )

    def room_of(self, request: Message) -> Message:
        """Answer `hypermap_msgs/GetRoomOf`."""
        hypermap = self._current.hypermap
        what = str(request.object).strip()
        item = Places(hypermap).object(int(what) if what.isdecimal() else what)
        room = rooms.room_of(hypermap, item)
        return self._answer("GetRoomOf", hypermap, [] if room is None else [room])

    def rooms_with(self, request: Message) -> Message:
        """Answer `hypermap_msgs/GetRoomsWith`."""
        hypermap = self._current.hypermap
        return self._answer("GetRoomsWith", hypermap, rooms.rooms_with(hypermap, str(request.name)))

    def is_reachable(self, request: Message) -> Message:
        """Answer `hypermap_msgs/IsRoomReachable`."""
        start, goal, radius = str(request.start), str(request.goal), float(request.robot_radius)
        reachable = rooms.is_reachable(self._current.hypermap, start, goal, radius)
        response = self._port.response(f"{_MSGS}/IsRoomReachable")
        return response(success=True, message="", reachable=reachable)

    def _answer(
        self, service: str, hypermap: Hypermap, rooms: Sequence[Room], **others: Any
    ) -> Message:
        return self._port.response(f"{_MSGS}/{service}")(
            success=True,
            message="",
            frame_id=hypermap.base_frame,
            rooms=[room_message(room, self._port) for room in rooms],
            **others,
        )


def _settings(request: Message) -> rooms.RoomSettings:
    """Return the settings of a request; what is 0 is the default.

    Raises:
        HypermapError: If one is negative or not finite.
    """
    names = ("least_area", "widest_door", "widest_opening")
    given = {name: float(value) for name in names if (value := getattr(request, name)) != 0}
    try:
        return rooms.RoomSettings(**given)
    except ValueError as error:
        raise HypermapError(str(error)) from None
