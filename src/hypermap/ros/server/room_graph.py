"""The part that publishes doors and the graph of rooms as markers, on `room_graph`."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Mapping

from hypermap.core.hypermap import ROOMS, Hypermap
from hypermap.rooms.rooms import rooms_on
from hypermap.ros.messages.marker_array import empty_marker_array
from hypermap.ros.messages.room_markers import room_markers
from hypermap.ros.port import Port, Publisher, Value
from hypermap.ros.topic_names import ROOM_GRAPH

_ABOVE = 0.1  # m over the markers of layers, so that fills do not hide it


class RoomGraph:
    """Publishes `room_graph` (`visualization_msgs/MarkerArray`, latched) of a map with rooms.

    The outlines and names of the rooms are those of their layer, on `rooms_markers`. Parameters are
    those of `Plans` (`robot_radius`) and `LayerMarkers` (`marker_height`).
    """

    def __init__(self, port: Port) -> None:
        self._port = port
        self._robot_radius = self._height = 0.0
        self._hypermap: Hypermap | None = None
        self._publisher: Publisher | None = None
        self._frame_id = ""
        self._lock = threading.RLock()

    def set(self, values: Mapping[str, Value]) -> None:
        """Take parameters, all or those that changed; what is shown is shown again."""
        with self._lock:
            self._robot_radius = float(str(values.get("robot_radius", self._robot_radius)))
            self._height = float(str(values.get("marker_height", self._height)))
            if self._hypermap is not None and {"robot_radius", "marker_height"} & values.keys():
                self.show(self._hypermap)

    def show(self, hypermap: Hypermap, changed: Iterable[str] | None = None) -> None:
        """Publish the doors and the graph of a map.

        Raises:
            HypermapError: If the doors of a room cannot be read.
        """
        with self._lock:
            self._hypermap = hypermap
            if changed is not None and ROOMS not in changed:
                return
            rooms = rooms_on(hypermap)
            if rooms is None:
                self._remove()
                return
            if self._publisher is None:
                self._publisher = self._port.publisher(
                    ROOM_GRAPH, "visualization_msgs/MarkerArray", latched=True
                )
            self._frame_id = rooms.frame_id
            height = self._height + _ABOVE
            self._publisher.publish(room_markers(rooms, self._robot_radius, height, self._port))

    def close(self) -> None:
        """Publish no more; what was shown vanishes."""
        with self._lock:
            self._hypermap = None
            self._remove()

    def _remove(self) -> None:
        if self._publisher is not None:
            self._publisher.publish(empty_marker_array(self._frame_id, self._port))
            self._publisher.close()
            self._publisher = None
