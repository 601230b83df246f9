"""Layers that other nodes fill or change: subscribe mode, and updates of parts of a layer."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from hypermap.core.errors import HypermapError, LayerNotFound
from hypermap.core.frames import Pose2D
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.core.objects import SemanticObject
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.recordings.messages.header import clean_frame
from hypermap.recordings.messages.occupancy import occupancy_of_grid
from hypermap.ros.messages.from_messages import (
    apply_semantic_update,
    semantic_objects_of,
    with_grid_update,
)
from hypermap.ros.port import Closable, Message, Port, Value
from hypermap.ros.server.current_map import CurrentMap, KeptOpen
from hypermap.ros.server.floor_frames import FloorFrames
from hypermap.ros.server.layer_topics import global_layers, is_set
from hypermap.ros.topic_names import topic_name

_WAITING = 100  # updates in the queue; each of them counts
_REASONS = 20  # for which messages of a topic may be wrong, each logged once
_NUMBER = re.compile(r"-?\d[\d.]*(e[-+]?\d+)?")


@dataclass(frozen=True)
class _Source:
    """A topic from which layers of a class take messages.

    Attributes:
        name: its name; for that of a single layer, what follows the layer's name.
        type_name: type of its messages.
        make: takes a layer, a message and the pose of the message's frame in the layer's, and
            returns the new layer, and what of the message was wrong.
        is_latched: whether a message contains a whole layer, so that the last one is kept.
    """

    name: str
    type_name: str
    make: Callable[[Any, Message, Pose2D], tuple[Layer, Sequence[str]]]
    is_latched: bool = False


@dataclass(frozen=True)
class _Sources:
    """The topics for layers of one class: for whole layers, and for updates."""

    whole: _Source
    update: _Source
    shared_update: _Source


def _grid(layer: OccupancyLayer, message: Message, pose: Pose2D) -> tuple[Layer, list[str]]:
    received = occupancy_of_grid(message)
    grid = received.grid and replace(received.grid, origin=pose @ received.grid.origin)
    return OccupancyLayer(layer.name, layer.frame_id, grid, received.cells, layer.settings), []


def _objects(layer: SemanticLayer, message: Message, pose: Pose2D) -> tuple[Layer, list[str]]:
    received, problems = semantic_objects_of(message)
    moved = [_moved(item, pose, problems) for item in received]
    objects = [item for item in moved if item is not None]
    return SemanticLayer(layer.name, layer.frame_id, objects, layer.settings), problems


def _moved(item: SemanticObject, pose: Pose2D, problems: list[str]) -> SemanticObject | None:
    """Return an object in another frame; None, and a problem, if that is out of the world."""
    try:
        return replace(item, footprint=pose.apply_geometry(item.footprint))
    except ValueError as error:
        problems.append(f"object {item.id} ({item.name!r}) is left out: {error}")
        return None


def _updated_grid(layer: OccupancyLayer, message: Message, _: Pose2D) -> tuple[Layer, list[str]]:
    return with_grid_update(layer, message), []


def _updated_objects(layer: SemanticLayer, message: Message, _: Pose2D) -> tuple[Layer, list[str]]:
    changed = layer.copy()
    return changed, apply_semantic_update(changed, message)


_SOURCES: Mapping[type[Layer], _Sources] = {
    OccupancyLayer: _Sources(
        _Source("/map", "nav_msgs/OccupancyGrid", _grid, is_latched=True),
        _Source("map_updates", "map_msgs/OccupancyGridUpdate", _updated_grid),
        _Source("/map_updates", "map_msgs/OccupancyGridUpdate", _updated_grid),
    ),
    SemanticLayer: _Sources(
        _Source("/semantic_map", "hypermap_msgs/SemanticMap", _objects, is_latched=True),
        _Source("semmap_updates", "hypermap_msgs/SemanticMapUpdate", _updated_objects),
        _Source("/semantic_map_updates", "hypermap_msgs/SemanticMapUpdate", _updated_objects),
    ),
}


class LayerUpdates:
    """The part that listens to the topics that fill or change layers.

    A message that is wrong leaves the layer as it was and is logged; those that follow it and are
    wrong for the same reason are not, until a good one comes.

    Args:
        port: the middleware.
        current: the served map.
        frames: finds the frames of messages.
        write: called with a layer before and after an update of its objects; what it raises
            leaves the layer as it was.
    """

    def __init__(
        self,
        port: Port,
        current: CurrentMap,
        frames: FloorFrames,
        write: Callable[[SemanticLayer, SemanticLayer], None] | None = None,
    ) -> None:
        self._write = write
        self._port = port
        self._current = current
        self._frames = frames
        self._whole: KeptOpen[Closable] = KeptOpen()
        self._updates: KeptOpen[Closable] = KeptOpen()
        self._said: dict[tuple[str, str], set[str]] = {}  # of topics and layers that take from them

    def set(self, values: Mapping[str, Value]) -> None:
        """Take parameters: there are none."""

    def show(self, hypermap: Hypermap, changed: Iterable[str] | None = None) -> None:
        """Listen for the layers of a map."""
        if changed is not None:
            return
        self._said.clear()
        # Subscribing again brings what was latched, which the layers of a new map have not heard.
        self._whole.close()
        self._whole.keep(
            {
                sources.whole.name: self._opener(sources.whole, partial(_filled, kind=kind))
                for kind, sources in _SOURCES.items()
                if _filled(hypermap, kind)
            }
        )
        self._updates.keep(self._wanted_updates(hypermap))

    def close(self) -> None:
        """Listen no more."""
        self._whole.close()
        self._updates.close()

    def _wanted_updates(self, hypermap: Hypermap) -> dict[str, Callable[[], Closable]]:
        wanted = {}
        for kind, sources in _SOURCES.items():
            for layer in hypermap:
                if isinstance(layer, kind):
                    topic = topic_name(layer.name, sources.update.name)
                    own = replace(sources.update, name=topic)
                    wanted[topic] = self._opener(own, partial(_named, name=layer.name))
            if _shared(hypermap, kind):
                shared = sources.shared_update
                wanted[shared.name] = self._opener(shared, partial(_shared, kind=kind))
        return wanted

    def _opener(
        self, source: _Source, layers_of: Callable[[Hypermap], list[str]]
    ) -> Callable[[], Closable]:
        return partial(
            self._port.subscribe,
            source.name,
            source.type_name,
            partial(self._take, source, layers_of),
            latched=source.is_latched,
            queue=1 if source.is_latched else _WAITING,
        )

    def _take(
        self, source: _Source, layers_of: Callable[[Hypermap], list[str]], message: Message
    ) -> None:
        """Put a message into the layers that take it."""
        for name in layers_of(self._current.hypermap):
            problems: list[str] = []
            try:
                self._current.change(name, partial(self._changed, source, message, problems))
            except LayerNotFound:  # another map has come meanwhile
                continue
            except HypermapError as error:
                problems.append(f"{error}; the message is ignored")
            if problems:
                self._complain(source.name, name, problems)
            else:
                self._said.pop((source.name, name), None)

    def _complain(self, topic: str, layer: str, problems: Sequence[str]) -> None:
        """Log what was wrong with a message, except for reasons that were logged before.

        Reasons that differ in numbers alone are one.
        """
        said = self._said.setdefault((topic, layer), set())
        fresh = [problem for problem in problems if _NUMBER.sub("#", problem) not in said]
        if not fresh or len(said) > _REASONS:
            return
        said.update(_NUMBER.sub("#", problem) for problem in fresh)
        for problem in fresh[:_REASONS]:
            self._port.log("warning", f"{topic}: layer {layer!r}: {problem}")
        if len(fresh) > _REASONS:
            count = len(fresh) - _REASONS
            self._port.log("warning", f"{topic}: layer {layer!r}: {count} more are wrong")
        if len(said) > _REASONS:
            self._port.log("warning", f"{topic}: layer {layer!r}: further reasons are not logged")

    def _changed(
        self,
        source: _Source,
        message: Message,
        problems: list[str],
        hypermap: Hypermap,
        layer: Layer,
    ) -> Layer:
        if not source.is_latched and not is_set(layer, "enable_update"):
            raise HypermapError("it accepts no updates because its enable_update is false")
        pose = self._pose(hypermap, layer, message)
        changed, wrong = source.make(layer, message, pose)
        problems += wrong
        if self._write is None or source.is_latched:
            return changed
        if isinstance(layer, SemanticLayer) and isinstance(changed, SemanticLayer):
            self._write(layer, changed)
        return changed

    def _pose(self, hypermap: Hypermap, layer: Layer, message: Message) -> Pose2D:
        """Return the pose of a message's frame in that of the layer."""
        header = getattr(message, "header", None)
        frame = "" if header is None else clean_frame(header.frame_id)
        return self._frames.pose(hypermap, layer.frame_id, frame or layer.frame_id)


def _named(hypermap: Hypermap, name: str) -> list[str]:
    return [name] if name in hypermap else []


def _filled(hypermap: Hypermap, kind: type[Layer]) -> list[str]:
    """Return the names of the layers of a class that are in subscribe mode."""
    layers = (layer for layer in hypermap if isinstance(layer, kind))
    return [layer.name for layer in layers if is_set(layer, "subscribe_mode")]


def _shared(hypermap: Hypermap, kind: type[Layer]) -> list[str]:
    """Return the names of the layers of a class that take updates from the global topic."""
    published = [layer.name for layer in global_layers(hypermap) if isinstance(layer, kind)]
    return [*_filled(hypermap, kind), *published]
