"""What the semantic mapper publishes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple, cast

from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.perception.observation import Observation
from hypermap.ros.mapper.live_map import LiveMap
from hypermap.ros.mapper.settings import OCCUPANCY, LiveSettings
from hypermap.ros.messages.to_messages import (
    object_state_array,
    occupancy_grid,
    polygon_stamped,
    semantic_map,
)
from hypermap.ros.port import Message, Port, Value
from hypermap.ros.server.markers import LayerMarkers

POLYGON = "geometry_msgs/PolygonStamped"


class PolygonTopics(NamedTuple):
    """On which topics detected shapes and observed areas are published."""

    shapes: tuple[str, ...] = ("detected_shape",)
    areas: tuple[str, ...] = ("observed_area",)


class LiveOutputs:
    """The topics of a live map; what nobody listens to is not made, but for the map itself."""

    PARAMETERS = LayerMarkers.PARAMETERS

    def __init__(
        self, port: Port, settings: LiveSettings, live_map: LiveMap, topics: PolygonTopics
    ) -> None:
        self._port = port
        self._map = live_map
        self._frame_id = settings.map_frame.strip("/")
        self._published = -1  # revision of the map
        self._semantic = port.publisher(
            settings.semantic_map_topic, "hypermap_msgs/SemanticMap", latched=True
        )
        self._objects = OnDemand(port, "objects", "hypermap_msgs/ObjectStateArray")
        self._grid: OnDemand | None = None
        if settings.occupancy and not settings.map_topic:
            self._grid = OnDemand(port, "map", OCCUPANCY)
        self._markers = LayerMarkers(port)
        self._shapes = _Polygons(port, topics.shapes)
        self._area = _Polygons(port, topics.areas)

    def set(self, values: Mapping[str, Value]) -> None:
        """Take new values of parameters."""
        self._markers.set(values)

    def publish(self) -> None:
        """Publish what has changed since the last time."""
        revision = self._map.revision
        if revision != self._published:
            self._published = revision
            layer = self._map.semantic()
            self._semantic.publish(semantic_map(layer, self._port, self._port.now()))
            self._markers.show(Hypermap([layer]))
        self._objects.publish(revision, self._states)
        if self._grid is not None:
            self._grid.publish(revision, self._occupancy)

    def show(self, observation: Observation, stamp: int) -> None:
        """Publish what a frame of some stamp [ns] shows."""
        if self._shapes.listeners:
            for seen in observation.objects:
                self._shapes.publish(
                    polygon_stamped(seen.footprint, self._frame_id, self._port, stamp)
                )
        if self._area.listeners:
            self._area.publish(
                polygon_stamped(observation.visible_area, self._frame_id, self._port, stamp)
            )

    def close(self) -> None:
        """Publish no more."""
        self._markers.close()
        for publisher in (self._semantic, self._objects, self._grid, self._shapes, self._area):
            if publisher is not None:
                publisher.close()

    def _states(self) -> Message:
        layer: SemanticLayer = self._map.semantic()
        return object_state_array(layer, self._port, self._port.now())

    def _occupancy(self) -> Message:
        layer = cast("OccupancyLayer", self._map.hypermap()["occupancy"])
        return occupancy_grid(layer, self._port, self._port.now())


class _Polygons:
    """Topics that carry the same polygons."""

    def __init__(self, port: Port, topics: Sequence[str]) -> None:
        self._publishers = [port.publisher(topic, POLYGON, latched=True) for topic in topics]

    @property
    def listeners(self) -> int:
        return sum(publisher.listeners for publisher in self._publishers)

    def publish(self, message: Message) -> None:
        for publisher in self._publishers:
            publisher.publish(message)

    def close(self) -> None:
        for publisher in self._publishers:
            publisher.close()


class OnDemand:
    """A latched topic whose message is made when someone listens and it has changed."""

    def __init__(self, port: Port, topic: str, type_name: str) -> None:
        self._publisher = port.publisher(topic, type_name, latched=True)
        self._published = -1

    def publish(self, revision: int, make: Callable[[], Message]) -> None:
        """Publish what there is at a revision of the map, if it is wanted and another."""
        if revision != self._published and self._publisher.listeners:
            self._published = revision
            self._publisher.publish(make())

    def close(self) -> None:
        """Publish no more."""
        self._publisher.close()
