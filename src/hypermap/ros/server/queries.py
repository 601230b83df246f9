"""The services of the first Hypermap: what is at a point, in an area, and where something is.

Each method takes a request and returns the response. Source: INTERFACES, sections 2 and 3.
"""

from __future__ import annotations

from hypermap.core.errors import HypermapError
from hypermap.core.occupancy import OccupancyLayer
from hypermap.ros.messages.replies import (
    as_int32,
    ints_reply,
    locations_reply,
    map_reply,
    objects_reply,
    strings_reply,
)
from hypermap.ros.port import Message, Port
from hypermap.ros.server.current_map import CurrentMap
from hypermap.ros.server.requests import Requests

_MSGS = "hypermap_msgs"


class Queries:
    """Answers from the map now, in its base frame.

    All raise HypermapError: for an unknown layer or frame, and a malformed point or area.
    """

    def __init__(self, port: Port, current: CurrentMap, requests: Requests) -> None:
        self._port = port
        self._current = current
        self._requests = requests

    def string_at_point(self, request: Message) -> Message:
        """Answer `hypermap_msgs/GetStringAtPoint`."""
        hypermap = self._current.hypermap
        labels = hypermap.label_at(request.layer, self._requests.point(hypermap, request.location))
        return self._port.response(f"{_MSGS}/GetStringAtPoint")(name=str(labels[0]))

    def int_at_point(self, request: Message) -> Message:
        """Answer `hypermap_msgs/GetIntAtPoint`."""
        hypermap = self._current.hypermap
        values = hypermap.value_at(request.layer, self._requests.point(hypermap, request.location))
        return self._port.response(f"{_MSGS}/GetIntAtPoint")(value=int(as_int32(values)[0]))

    def strings_by_area(self, request: Message) -> Message:
        """Answer `hypermap_msgs/GetStringsByArea`."""
        hypermap = self._current.hypermap
        area = self._requests.area(hypermap, request.area)
        return strings_reply(self._port, hypermap.labels_in(request.layer, area))

    def ints_by_area(self, request: Message) -> Message:
        """Answer `hypermap_msgs/GetIntsByArea`."""
        hypermap = self._current.hypermap
        area = self._requests.area(hypermap, request.area)
        return ints_reply(self._port, hypermap.values_in(request.layer, area))

    def locations_by_string(self, request: Message) -> Message:
        """Answer `hypermap_msgs/GetLocationsByString`."""
        return self._locations(request, str(request.name), "GetLocationsByString")

    def locations_by_int(self, request: Message) -> Message:
        """Answer `hypermap_msgs/GetLocationsByInt`."""
        return self._locations(request, int(request.value), "GetLocationsByInt")

    def _locations(self, request: Message, what: str | int, service: str) -> Message:
        hypermap = self._current.hypermap
        area = self._requests.area_or_all(hypermap, request.area)
        found = hypermap.find(request.layer, what, area)
        return locations_reply(self._port, f"{_MSGS}/{service}", found)

    def semantic_by_area(self, request: Message) -> Message:
        """Answer `hypermap_msgs/GetSemanticByArea`."""
        hypermap = self._current.hypermap
        found = hypermap.objects(area=self._requests.area(hypermap, request.area))
        return objects_reply(self._port, f"{_MSGS}/GetSemanticByArea", found)

    def semantic_by_string(self, request: Message) -> Message:
        """Answer `hypermap_msgs/GetSemanticByString`."""
        found = self._current.hypermap.objects(str(request.name))
        return objects_reply(self._port, f"{_MSGS}/GetSemanticByString", found)

    def static_map(self, name: str) -> Message:
        """Answer `nav_msgs/GetMap` for a layer."""
        layer = self._current.hypermap[name]
        if not isinstance(layer, OccupancyLayer):
            raise HypermapError(f"layer {name!r} is a {layer.class_name}, which has no cells")
        if layer.cells is None:
            raise HypermapError(f"layer {name!r} is still empty")
        return map_reply(self._port, layer, self._port.now())
