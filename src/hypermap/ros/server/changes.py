"""What changed in the map: the service `get_changes` and the topic `changes`."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterable, Mapping

from hypermap.console.moments import changes_since
from hypermap.core.hypermap import Hypermap
from hypermap.history import grown, in_force, next_expiry
from hypermap.ros.messages.change_messages import change_message
from hypermap.ros.messages.geometry_messages import header
from hypermap.ros.port import Message, Port, Publisher, Value
from hypermap.ros.server.current_map import CurrentMap

_EVERY = 1.0  # seconds between looks for what has expired


class Changes:
    """Publishes the changes of the map's newest version, and answers what changed since a time.

    What was changed and not stored yet counts as the next version. Objects that expire are taken
    out of the map.
    """

    def __init__(self, port: Port, current: CurrentMap) -> None:
        self._port = port
        self._current = current
        self._publisher: Publisher | None = None
        self._expires: float | None = None
        self._lock = threading.Lock()
        self._timer = port.timer(_EVERY, self._expire)

    def get_changes(self, request: Message) -> Message:
        """Answer `hypermap_msgs/GetChanges`.

        Raises:
            HypermapError: If `since` is not a time, or the map keeps no history.
        """
        hypermap = grown(self._current.hypermap, time.time())
        names = set(request.names)
        changes = [
            change_message(revision, change, hypermap, self._port)
            for revision, change in changes_since(hypermap, str(request.since) or None, "since")
            if not names or change.names & names
        ]
        return self._port.response("hypermap_msgs/GetChanges")(
            success=True, message="", frame_id=hypermap.base_frame, changes=changes
        )

    def set(self, values: Mapping[str, Value]) -> None:
        """Take parameters: there are none."""

    def show(self, hypermap: Hypermap, changed: Iterable[str] | None = None) -> None:  # noqa: ARG002
        """Publish what changed last in a map that keeps its history."""
        with self._lock:
            self._expires = next_expiry(hypermap)
            hypermap = grown(hypermap, time.time())
            revisions = [] if hypermap.history is None else hypermap.history.revisions()
            if not revisions:
                return
            if self._publisher is None:
                self._publisher = self._port.publisher(
                    "changes", "hypermap_msgs/ObjectChangeArray", latched=True
                )
            last = revisions[-1]
            self._publisher.publish(
                self._port.message("hypermap_msgs/ObjectChangeArray")(
                    header=header(hypermap.base_frame, self._port, self._port.now()),
                    changes=[
                        change_message(last, change, hypermap, self._port)
                        for change in last.changes
                    ],
                )
            )

    def close(self) -> None:
        """Publish no more."""
        self._timer.close()
        with self._lock:
            if self._publisher is not None:
                self._publisher.close()
                self._publisher = None

    def _expire(self) -> None:
        """Take out of the map what has expired."""
        with self._lock:
            now = time.time()
            if self._expires is None or self._expires > now:
                return
            self._expires = None
        hypermap = self._current.hypermap
        left = in_force(hypermap, now)
        for name in [layer.name for layer in left if layer is not hypermap[layer.name]]:
            self._current.change(name, lambda current, layer: in_force(current, now)[layer.name])
