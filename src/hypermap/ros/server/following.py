"""The part of the map server that takes over what others change in its map, as in a store."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Mapping
from typing import Protocol

from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.core.semantic import SemanticLayer
from hypermap.ros.port import Port, Value
from hypermap.ros.server.current_map import CurrentMap

_LOOK = 0.2  # seconds between two looks
_PATIENCE = 5.0  # seconds that a look may take when the node stops


class Source(Protocol):
    """A map that others change, as that of a site in a store."""

    @property
    def name(self) -> str:
        """What people call it."""

    @property
    def address(self) -> str:
        """What opens it elsewhere."""

    @property
    def hypermap(self) -> Hypermap:
        """The present map: the same object while nothing has changed.

        Layers in which nothing has changed are the same, too.
        """

    def write(self, seen: Hypermap, before: SemanticLayer, after: SemanticLayer) -> None:
        """Change the objects of a layer of the map that was seen, for all.

        Raises:
            HypermapError: If that is not allowed, or another has changed them since.
        """


class Following:
    """Serves each new version of a map that others change, until a client loads another map.

    Layers in which nothing has changed are not published again. What clients of the node change
    of objects is written to the source; what else they change stays in the node, and is replaced
    when the same layer changes at its source.

    Args:
        port: the middleware.
        current: the served map.
        source: the map that others change.
        shown: what of it is served by now.
    """

    def __init__(self, port: Port, current: CurrentMap, source: Source, shown: Hypermap) -> None:
        self._port, self._current, self._source = port, current, source
        self._shown = shown
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._follow, name="following", daemon=True)
        self._thread.start()

    def set(self, values: Mapping[str, Value]) -> None:
        """Take parameters: there are none."""

    def write(self, before: SemanticLayer, after: SemanticLayer) -> None:
        """Write what a client changes to the source, unless another map was loaded.

        Raises:
            HypermapError: As `Source.write` does.
        """
        if not self._ended.is_set():
            self._source.write(self._shown, before, after)

    def show(self, hypermap: Hypermap, changed: Iterable[str] | None = None) -> None:
        """Follow no more if a client has loaded another map."""
        ours = {id(layer) for layer in self._shown}
        if changed is None and ours and not any(id(layer) in ours for layer in hypermap):
            self._ended.set()
            self._port.log("info", "another map was loaded; that of the store is not followed")

    def close(self) -> None:
        """Follow no more."""
        self._ended.set()
        self._thread.join(_PATIENCE)

    def _follow(self) -> None:
        while not self._ended.wait(_LOOK):
            hypermap = self._source.hypermap
            if hypermap is not self._shown and not self._ended.is_set():
                self._take(hypermap)

    def _take(self, hypermap: Hypermap) -> None:
        before = self._shown
        known = {layer.name: layer for layer in before}
        is_same_kind = list(known) == [layer.name for layer in hypermap]
        if not is_same_kind or list(before.frames) != list(hypermap.frames):
            self._shown = hypermap
            self._current.replace(hypermap)
            return
        for layer in hypermap:
            if layer is not known[layer.name]:
                self._put(layer)
        self._shown = hypermap  # last: a change of the layer before is none of this version

    def _put(self, layer: Layer) -> None:
        def newest(_hypermap: Hypermap, _before: Layer) -> Layer:
            return layer

        self._current.change(layer.name, newest)
