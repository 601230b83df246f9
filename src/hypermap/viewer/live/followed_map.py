"""A map that others change, as the page shows it."""

from __future__ import annotations

import time
from typing import Any, Protocol

from hypermap.core.hypermap import Hypermap
from hypermap.viewer.live.shown_map import MapVersion


class Followed(Protocol):
    """Who has the map: a node that serves it, or a site of a store."""

    @property
    def name(self) -> str:
        """What the page calls the map."""

    @property
    def address(self) -> str:
        """What opens the map elsewhere: a file, or an address in a store."""

    @property
    def hypermap(self) -> Hypermap:
        """The present map: the same object while nothing has changed, never changed itself."""


class FollowedMap:
    """A map that others change; windows look at it, and see each change by themselves.

    Attributes:
        is_editable, event_count, saves: see `ShownMap`.
    """

    def __init__(self, followed: Followed) -> None:
        """Begin with the map as it is."""
        self.is_editable = False
        self.event_count = self.saves = 0
        self._followed = followed
        hypermap = followed.hypermap
        # Milliseconds, so that no version is given again when the server starts again.
        version = self._opened = time.time_ns() // 1_000_000
        self._current = MapVersion(version, hypermap, {layer.name: version for layer in hypermap})

    @property
    def name(self) -> str:
        """What the page calls the map."""
        return self._followed.name

    @property
    def address(self) -> str:
        """What opens the map elsewhere."""
        return self._followed.address

    @property
    def current(self) -> MapVersion:
        """The map as windows know it."""
        return self._current

    def status(self) -> dict[str, Any]:
        """Return the state of editing: there is nothing to undo or save."""
        return {
            "version": self._current.version,
            "opened": self._opened,
            "can_undo": False,
            "can_redo": False,
            "unsaved": False,
        }

    def look(self) -> None:
        """Take over what others have changed, and notify windows."""
        hypermap, before = self._followed.hypermap, self._current
        if hypermap is before.hypermap:
            return
        version = before.version + 1
        kept = {layer.name: layer for layer in before.hypermap}
        changed_in = {
            layer.name: before.changed_in[layer.name] if kept.get(layer.name) is layer else version
            for layer in hypermap
        }
        if not kept.keys() & changed_in.keys():  # another map, which windows show as a whole
            self._opened = version
        self._current = MapVersion(version, hypermap, changed_in)
        self.event_count += 1
