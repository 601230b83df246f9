"""What the page shows: a map in its present version, whoever changes it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

from hypermap.core.hypermap import Hypermap


@dataclass(frozen=True, eq=False)
class MapVersion:
    """The map after one change; it never changes itself (snapshot isolation).

    Attributes:
        version: grows with every change.
        hypermap: the map.
        changed_in: version of the last change of each layer.
    """

    version: int
    hypermap: Hypermap
    changed_in: dict[str, int]


class ShownMap(Protocol):
    """A map that windows look at: a file that they edit, or one that others change.

    Attributes:
        is_editable: whether windows can change it.
        event_count: grows with every event that windows should know of.
        saves: how often it was saved.
    """

    is_editable: bool
    event_count: int
    saves: int

    @property
    def name(self) -> str:
        """What the page calls it."""

    @property
    def address(self) -> str:
        """What opens it elsewhere: a file, or an address in a store."""

    @property
    def current(self) -> MapVersion:
        """The present map."""

    def status(self) -> dict[str, Any]:
        """Return the state of editing, as windows show it."""

    def look(self) -> None:
        """Check whether others have changed the map or its file, and notify windows."""
