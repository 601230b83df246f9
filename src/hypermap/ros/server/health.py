"""The state of the map server on `/diagnostics`: its map, its queries, where it will save."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Literal

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.ros.messages.diagnostics import TYPE, status_array
from hypermap.ros.port import Closable, Port, Publisher, Value
from hypermap.ros.server.current_map import CurrentMap
from hypermap.ros.server.save_at_end import place_at_end
from hypermap.text import counted

_PERIOD = 1.0  # s


class Tally:
    """Counts questions; those who ask may do so at once.

    Attributes:
        answered: how many were answered.
        refused: how many ended with an error.
    """

    def __init__(self) -> None:
        self.answered = self.refused = 0
        self._lock = threading.Lock()

    def count(self, is_answered: bool) -> None:
        """Count a question."""
        with self._lock:
            self.answered += is_answered
            self.refused += not is_answered


class Health:
    """The part that publishes `/diagnostics` every second, where `diagnostic_msgs` is installed.

    Args:
        port: the middleware.
        current: the map.
        tally: of the questions.
        save_to: where the operator wants the map stored at the end; None for nowhere.
    """

    def __init__(self, port: Port, current: CurrentMap, tally: Tally, save_to: Path | None) -> None:
        self._port = port
        self._current = current
        self._tally = tally
        self._save_to = save_to
        self._publisher: Publisher | None = None
        self._timer: Closable | None = None

    def set(self, values: Mapping[str, Value]) -> None:
        """Take parameters: there are none."""

    def show(self, hypermap: Hypermap, changed: Iterable[str] | None = None) -> None:  # noqa: ARG002
        """Begin to report; each report looks at the map of its time."""
        if self._timer is not None:
            return
        try:
            self._publisher = self._port.publisher("/diagnostics", TYPE)
        except HypermapError:
            self._port.log("info", "no diagnostic_msgs here, so nothing on /diagnostics")
        self._timer = self._port.timer(_PERIOD, self._report)

    def close(self) -> None:
        """Report no more."""
        for closable in (self._timer, self._publisher):
            if closable is not None:
                closable.close()
        self._timer = self._publisher = None

    def _report(self) -> None:
        publisher, hypermap = self._publisher, self._current.hypermap
        if publisher is None:
            return
        count = len(hypermap.layers)
        level: Literal["OK", "WARN"] = "OK" if count else "WARN"
        message = f"serving {counted(count, 'layer')}" if count else "there is no map"
        name = f"{self._port.node_name}: map"
        values = self._values(hypermap)
        publisher.publish(status_array(level, name, message, values, self._port, self._port.now()))

    def _values(self, hypermap: Hypermap) -> Iterator[tuple[str, str]]:
        yield "map", ", ".join(sorted(map(str, self._current.files))) or "none"
        for layer in hypermap:
            yield f"layer {layer.name}", f"{layer.class_name}, {_content(layer)}"
        yield "questions answered", str(self._tally.answered)
        yield "questions refused", str(self._tally.refused)
        where = self._save_to and place_at_end(self._save_to, self._current.files)
        yield "stored at the end in", str(where or "nowhere")


def _content(layer: Layer) -> str:
    if isinstance(layer, SemanticLayer):
        return counted(len(layer), "object")
    if isinstance(layer, OccupancyLayer):
        grid = layer.grid
        return "empty" if grid is None else f"{grid.width} x {grid.height} cells"
    return "empty" if layer.extent().is_empty else "not empty"
