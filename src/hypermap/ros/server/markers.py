"""The part of a node that publishes semantic layers as markers, for rviz and others."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Mapping

import numpy as np

from hypermap.colors import Color, class_colors
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.ros.messages.marker_array import MarkerStyle, empty_marker_array, marker_array
from hypermap.ros.port import Parameter, Port, Publisher, Value
from hypermap.ros.topic_names import topic_name


class LayerMarkers:
    """The part of a node that publishes `LAYER_markers` for each semantic layer."""

    PARAMETERS = (
        Parameter("show_fill", True, "Whether objects are filled.", changes=True),
        Parameter("show_outlines", True, "Whether objects have outlines.", changes=True),
        Parameter("show_labels", True, "Whether objects have labels.", changes=True),
        Parameter(
            "fill_opacity", 1.0, "How much fills hide what is below.", 0.0, 1.0, changes=True
        ),
        Parameter("outline_width", 0.02, "Width of outlines [m].", 0.001, 1.0, changes=True),
        Parameter("label_height", 0.15, "Height of the letters [m].", 0.01, 10.0, changes=True),
        Parameter(
            "max_labels", 1000, "Of more objects, only the largest have names.", 0, changes=True
        ),
        Parameter(
            "marker_height", 0.02, "Height of markers over the floor [m].", -100.0, 100.0, (), True
        ),
        Parameter("shown_classes", (), "Show these classes only; all if empty.", changes=True),
        Parameter("hidden_classes", (), "Classes that are not shown.", changes=True),
    )

    def __init__(self, port: Port) -> None:
        self._port = port
        self._style = MarkerStyle()
        self._hypermap: Hypermap | None = None
        self._publishers: dict[str, Publisher] = {}
        self._colors: dict[str, Color] = {}
        self._frames: dict[str, str] = {}
        self._lock = threading.RLock()

    def set(self, values: Mapping[str, Value]) -> None:
        """Take new values of parameters, all or some; what is shown is shown again."""
        own = {p.name: values[p.name] for p in self.PARAMETERS if p.name in values}
        with self._lock:
            self._style = MarkerStyle(**{**vars(self._style), **own})
            if own and self._hypermap is not None:
                self.show(self._hypermap)

    def show(self, hypermap: Hypermap, changed: Iterable[str] | None = None) -> None:
        """Publish the semantic layers of a map.

        Args:
            hypermap: the map.
            changed: names of the layers that have changed; None for all.
        """
        with self._lock:
            self._hypermap = hypermap
            # Copies, which cost nothing, so that a change in between is not seen by halves.
            semantic = [item.copy() for item in hypermap if isinstance(item, SemanticLayer)]
            layers = {item.name: item for item in semantic}
            for name in [*self._publishers.keys() - layers.keys()]:
                self._remove(name)
            colors = class_colors(name for item in layers.values() for name in _classes(item))
            news = set(layers if changed is None else changed) | layers.keys() - self._publishers
            for name, layer in layers.items():
                recolored = any(colors[c] != self._colors.get(c) for c in _classes(layer))
                if name in news or recolored:
                    self._publish(layer, colors)
            self._colors = colors

    def close(self) -> None:
        """Publish no more; what was shown vanishes."""
        with self._lock:
            self._hypermap = None
            for name in list(self._publishers):
                self._remove(name)

    def _publish(self, layer: SemanticLayer, colors: Mapping[str, Color]) -> None:
        if layer.name not in self._publishers:
            self._publishers[layer.name] = self._port.publisher(
                topic_name(layer.name, "markers"), "visualization_msgs/MarkerArray", latched=True
            )
        self._frames[layer.name] = layer.frame_id
        message = marker_array(layer, colors, self._port, self._style)
        self._publishers[layer.name].publish(message)

    def _remove(self, name: str) -> None:
        publisher = self._publishers.pop(name)
        publisher.publish(empty_marker_array(self._frames.pop(name), self._port))
        publisher.close()


def _classes(layer: SemanticLayer) -> list[str]:
    """Return the names of the objects in a layer, each once."""
    table = layer.table
    names = list(table.vocabulary)
    return [names[code] for code in np.unique(table.codes)]
