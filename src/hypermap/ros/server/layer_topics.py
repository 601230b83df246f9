"""The latched topics of the map server: its layers, what they are, and where their frames lie."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.core.value_layer import ValueLayer
from hypermap.ros.messages.grid_map_messages import GRID_MAP, grid_map
from hypermap.ros.messages.to_messages import (
    FLAGS,
    Types,
    hypermap_meta_data,
    layer_transforms,
    map_meta_data,
    occupancy_grid,
    semantic_map,
    value_grid,
    value_scale,
)
from hypermap.ros.port import Message, Port, Publisher, Value
from hypermap.ros.server.current_map import KeptOpen
from hypermap.ros.topic_names import topic_name

METADATA = "hypermap_metadata"


@dataclass(frozen=True)
class Kind:
    """A topic that every layer of a class has.

    Attributes:
        suffix: what follows the layer's name.
        global_name: the topic for layers with `publish_global_topics`; empty where there is none.
        type_name: type of its messages.
        make: makes a message of the layer.
        is_optional: whether the topic is left out where its type is not installed.
    """

    suffix: str
    global_name: str
    type_name: str
    make: Callable[[Any, Types, int], Message]
    is_optional: bool = False


_KINDS: Mapping[type[Layer], tuple[Kind, ...]] = {
    OccupancyLayer: (
        Kind("map", "/map", "nav_msgs/OccupancyGrid", occupancy_grid),
        Kind("map_metadata", "/map_metadata", "nav_msgs/MapMetaData", map_meta_data),
    ),
    SemanticLayer: (Kind("semmap", "/semantic_map", "hypermap_msgs/SemanticMap", semantic_map),),
    ValueLayer: (
        Kind("values", "", "nav_msgs/OccupancyGrid", value_grid),
        Kind("values_scale", "", "std_msgs/String", value_scale),
        Kind("grid_map", "", GRID_MAP, grid_map, is_optional=True),
    ),
}


class LayerTopics:
    """The part that publishes each layer, `hypermap_metadata`, and the frames on tf.

    A layer that is still empty is not published before it holds something, so that nobody takes a
    map without cells for a world without obstacles.
    """

    def __init__(self, port: Port) -> None:
        self._port = port
        self._open: KeptOpen[Publisher] = KeptOpen()
        self._topics: dict[str, tuple[str, Kind]] = {}  # with the layer's name
        self._filled: frozenset[str] = frozenset()  # topics on which a layer was published

    def set(self, values: Mapping[str, Value]) -> None:
        """Take parameters: there are none."""

    def show(self, hypermap: Hypermap, changed: Iterable[str] | None = None) -> None:
        """Publish the layers that have changed; with a new map, all that there is to know."""
        stamp = self._port.now()
        if changed is None:
            self._topics = _topics(hypermap, self._port, partial(self._port.log, "warning"))
            self._open_topics()
            self._port.static_transforms(layer_transforms(hypermap, self._port, stamp))
        self._publish(hypermap, None if changed is None else list(changed), stamp)
        if changed is None:  # last: who hears of a layer finds its topics
            node = self._port.node_name
            self._open[METADATA].publish(hypermap_meta_data(hypermap, node, self._port))

    def close(self) -> None:
        """Close the topics; tf keeps what it knows."""
        self._open.close()
        self._filled = frozenset()

    def _open_topics(self) -> None:
        types = {topic: kind.type_name for topic, (_, kind) in self._topics.items()}
        types[METADATA] = "hypermap_msgs/HypermapMetaData"
        fresh = self._open.keep(
            {
                topic: partial(self._port.publisher, topic, type_name, latched=True)
                for topic, type_name in types.items()
            }
        )
        self._filled &= types.keys() - fresh

    def _publish(self, hypermap: Hypermap, changed: Collection[str] | None, stamp: int) -> None:
        messages: dict[tuple[str, str], Message] = {}
        for topic, (name, kind) in self._topics.items():
            if changed is not None and name not in changed:
                continue
            layer = hypermap[name]
            if _is_empty(layer) and topic not in self._filled:
                continue
            key = name, kind.suffix  # the global topic carries the same message
            if key not in messages:
                messages[key] = kind.make(layer, self._port, stamp)
            self._open[topic].publish(messages[key])
            self._filled |= {topic}


def kinds_of(layer: type[Layer], types: Types) -> list[Kind]:
    """Return the topics that every layer of a class has; none for a class without."""
    found = next((kind for kind in _KINDS if issubclass(layer, kind)), None)
    kinds = () if found is None else _KINDS[found]
    return [kind for kind in kinds if not kind.is_optional or _is_there(kind.type_name, types)]


def _is_there(type_name: str, types: Types) -> bool:
    try:
        types.message(type_name)
    except HypermapError:
        return False
    return True


def is_set(layer: Layer, flag: str) -> bool:
    """Return a flag of a layer's settings, as "subscribe_mode"."""
    return bool(layer.settings.get(flag, FLAGS[flag]))


def global_layers(
    hypermap: Hypermap, complain: Callable[[str], object] = lambda _: None
) -> list[Layer]:
    """Return the layers that are published globally: of each class, the first that wants to be.

    One in subscribe mode is not, since it would hear itself.

    Args:
        hypermap: the map.
        complain: takes a text for each layer that wants to be, but is not.
    """
    found: dict[type[Layer], Layer] = {}
    for layer in hypermap:
        kind = _class_of(layer)
        if kind is None or not is_set(layer, "publish_global_topics"):
            continue
        topic = _KINDS[kind][0].global_name
        if not topic:
            complain(f"there is no global topic for layers of class {layer.class_name}")
        elif is_set(layer, "subscribe_mode"):
            complain(f"layer {layer.name!r} listens to {topic}, so it is not published there")
        elif kind in found:
            complain(
                f"layer {layer.name!r} is not published on {topic}, since layer "
                f"{found[kind].name!r} is"
            )
        else:
            found[kind] = layer
    return list(found.values())


def _topics(
    hypermap: Hypermap, types: Types, complain: Callable[[str], object]
) -> dict[str, tuple[str, Kind]]:
    topics: dict[str, tuple[str, Kind]] = {}
    for layer in hypermap:
        for kind in kinds_of(type(layer), types):
            topic = topic_name(layer.name, kind.suffix)
            other, _ = topics.setdefault(topic, (layer.name, kind))
            if other != layer.name:
                complain(
                    f"layer {layer.name!r} is not published, since its topic would be {topic}, as "
                    f"that of layer {other!r}: rename one of them"
                )
    for layer in global_layers(hypermap, complain):
        topics.update(
            (kind.global_name, (layer.name, kind)) for kind in kinds_of(type(layer), types)
        )
    return topics


def _class_of(layer: Layer) -> type[Layer] | None:
    return next((kind for kind in _KINDS if isinstance(layer, kind)), None)


def _is_empty(layer: Layer) -> bool:
    return isinstance(layer, OccupancyLayer | ValueLayer) and layer.cells is None
