"""The services that the first Hypermap did not have; see the files in hypermap_msgs/srv."""

from __future__ import annotations

from typing import Any

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import FoundObject, Hypermap
from hypermap.core.layer import Layer
from hypermap.core.opaque import OpaqueLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.ros.messages.replies import area_hits, as_int32, hits_reply
from hypermap.ros.messages.to_messages import object_states
from hypermap.ros.port import Message, Port
from hypermap.ros.server.current_map import CurrentMap
from hypermap.ros.server.requests import Requests

_MSGS = "hypermap_msgs"


class ObjectQueries:
    """Answers about objects and about several layers or areas at once, in the base frame.

    All raise HypermapError: for an unknown layer or frame, and a malformed point or area.
    """

    def __init__(self, port: Port, current: CurrentMap, requests: Requests) -> None:
        self._port = port
        self._current = current
        self._requests = requests

    def layers_at_point(self, request: Message) -> Message:
        """Answer `hypermap_msgs/GetLayersAtPoint`; unreadable layers have no answer."""
        hypermap = self._current.hypermap
        xy = self._requests.point(hypermap, request.location)
        placed = hypermap.placed_layers()
        asked = [layer for layer in placed if not isinstance(layer, OpaqueLayer)]
        return self._port.response(f"{_MSGS}/GetLayersAtPoint")(
            success=True,
            message="",
            frame_id=hypermap.base_frame,
            layers=[self._value(hypermap, layer, xy) for layer in asked],
        )

    def _value(self, hypermap: Hypermap, layer: Layer, xy: Any) -> Message:
        found: list[FoundObject] = []
        if isinstance(layer, SemanticLayer):
            found = hypermap.objects_at(xy[0], layer.name)
        return self._port.message(f"{_MSGS}/LayerValue")(
            layer=layer.name,
            class_name=layer.class_name,
            label=str(hypermap.label_at(layer.name, xy)[0]),
            value=int(as_int32(hypermap.value_at(layer.name, xy))[0]),
            objects=object_states(found, self._port),
        )

    def hits_in_areas(self, request: Message) -> Message:
        """Answer `hypermap_msgs/GetHitsInAreas`."""
        hypermap = self._current.hypermap
        hits = []
        for number, message in enumerate(request.areas):
            try:
                area = self._requests.area(hypermap, message)
            except HypermapError as error:
                raise HypermapError(f"areas[{number}]: {error}") from None
            labels = hypermap.labels_in(request.layer, area)
            hits.append(area_hits(self._port, labels, hypermap.values_in(request.layer, area)))
        return hits_reply(self._port, hypermap.base_frame, hits)

    def find_objects(self, request: Message) -> Message:
        """Answer `hypermap_msgs/FindObjects`."""
        hypermap = self._current.hypermap
        near = self._near(hypermap, request)
        if not request.within >= 0:
            raise HypermapError(f"within must not be negative, got {request.within}")
        if request.within > 0 and near is None:
            raise HypermapError("within needs near or origin: a distance from what?")
        found = hypermap.objects(
            request.name or None,
            near=near,
            within=request.within or None,
            inside=request.inside or None,
            area=self._requests.area_or_all(hypermap, request.area),
            tags=request.tags,
            layer=request.layer or None,
            limit=request.limit or None,
        )
        distances = [] if near is None else [float(hit.distance or 0.0) for hit in found]
        return self._port.response(f"{_MSGS}/FindObjects")(
            success=True,
            message="",
            frame_id=hypermap.base_frame,
            objects=object_states(found, self._port),
            distances=distances,
        )

    def _near(self, hypermap: Hypermap, request: Message) -> Any:
        """Return from what distances are measured; None if from nothing."""
        if not request.origin.header.frame_id:
            return request.near or None
        if request.near:
            raise HypermapError("give near or origin, not both")
        return self._requests.point(hypermap, request.origin)
