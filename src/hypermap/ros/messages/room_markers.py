"""Doors and the graph of rooms as markers: `visualization_msgs/MarkerArray`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hypermap.rooms.room_graph import graph
from hypermap.rooms.rooms import Door, Rooms
from hypermap.ros.messages.geometry_messages import Types
from hypermap.ros.messages.markers import INK, LINE_LIST, MarkerMaker
from hypermap.ros.port import Message

_GREEN, _RED = (0.10, 0.55, 0.25, 1.0), (0.80, 0.15, 0.10, 1.0)
_DOOR, _LINK = 0.08, 0.02  # widths of lines [m]


def room_markers(rooms: Rooms, robot_radius: float, height: float, types: Types) -> Message:
    """Return the doors and the graph of rooms as a `visualization_msgs/MarkerArray`.

    The first marker deletes all earlier ones. Lines lie at the doors, in the namespace `doors`, or
    `narrow doors` where a robot does not fit through. In the namespace `graph`, lines lead from
    each room to the doors that it fits through.

    Args:
        rooms: in the frame of the markers.
        robot_radius: of the robot [m].
        height: of the markers over the floor [m].
        types: the classes of messages.
    """
    make = MarkerMaker(types, rooms.frame_id)
    passing = [door for door in rooms.doors if door.lets_pass(robot_radius)]
    narrow = [door for door in rooms.doors if not door.lets_pass(robot_radius)]
    net = graph(rooms, robot_radius)
    links = np.stack([net.places_xy[net.edges], np.repeat(net.doors_xy[:, None], 2, axis=1)], 2)
    markers = [make.delete_all()]
    for namespace, color, width, points in (
        ("doors", _GREEN, _DOOR, _ends(passing)),
        ("narrow doors", _RED, _DOOR, _ends(narrow)),
        ("graph", INK, _LINK, links.reshape(-1, 2)),
    ):
        if len(points):
            marker = make.marker(namespace, 0, LINE_LIST, color=color)
            make.draw(marker, np.column_stack([points, np.full(len(points), height)]), width)
            markers.append(marker)
    return make.array(markers)


def _ends(doors: list[Door]) -> NDArray[np.float64]:
    """Return both ends of each door, shape (2 N, 2)."""
    return np.array([np.array(door.line.coords)[[0, -1]] for door in doors]).reshape(-1, 2)
