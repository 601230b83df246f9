"""The map that a node serves now, and the parts of the node that show it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Generic, Protocol, TypeVar

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.ros.port import Closable, Port, Value

Thing = TypeVar("Thing", bound=Closable)


class Part(Protocol):
    """A part of the map server: it brings the map to those who listen or ask."""

    def set(self, values: Mapping[str, Value]) -> None:
        """Take the values of parameters, at the start and when they change."""
        ...

    def show(self, hypermap: Hypermap, changed: Iterable[str] | None = None) -> None:
        """Show a map.

        Args:
            hypermap: the map now.
            changed: names of the layers that differ from the last time; None for a new map.
        """
        ...

    def close(self) -> None:
        """Stop; topics and services are gone then."""
        ...


class CurrentMap:
    """The one owner of the map: it is never changed, but replaced as a whole.

    So whoever asks takes `hypermap` once, and sees either the old map or the new one. Changes
    wait for each other, and each is shown before the next begins.
    """

    def __init__(self, port: Port) -> None:
        self._port = port
        self._hypermap = Hypermap()
        self._parts: tuple[Part, ...] = ()
        self._writing = threading.RLock()

    @property
    def hypermap(self) -> Hypermap:
        """The map now; it is not to be changed."""
        return self._hypermap

    def replace(self, hypermap: Hypermap) -> None:
        """Put another map in its place."""
        with self._writing:
            self._hypermap = hypermap
            self._show(None)

    def change(self, name: str, make: Callable[[Hypermap, Layer], Layer]) -> None:
        """Replace one layer.

        Args:
            name: of the layer.
            make: takes the map and the layer and returns a new layer of that name; what it raises
                leaves the map as it is.

        Raises:
            LayerNotFound: If there is no such layer any more.
        """
        with self._writing:
            hypermap = self._hypermap
            self._hypermap = hypermap.with_layer(make(hypermap, hypermap[name]))
            self._show([name])

    def show_on(self, parts: Sequence[Part]) -> None:
        """Show the map, and all that follow, on these parts and no others."""
        with self._writing:
            self._parts = tuple(parts)
            self._show(None)

    def show_again(self) -> None:
        """Show all of the map once more."""
        with self._writing:
            self._show(None)

    def _show(self, changed: Sequence[str] | None) -> None:
        for part in self._parts:
            self._show_on(part, changed)

    def _show_on(self, part: Part, changed: Sequence[str] | None) -> None:
        try:
            part.show(self._hypermap, changed)
        except HypermapError as error:
            self._port.log("error", str(error))  # the other parts go on


class KeptOpen(Generic[Thing]):
    """Topics or services, of which exactly those that are wanted are open."""

    def __init__(self) -> None:
        self._open: dict[str, Thing] = {}

    def keep(self, wanted: Mapping[str, Callable[[], Thing]]) -> set[str]:
        """Open what is wanted and not open yet, and close what is wanted no more.

        Args:
            wanted: for each name, what opens it.

        Returns:
            The names of what was opened.
        """
        for name in [name for name in self._open if name not in wanted]:
            self._open.pop(name).close()
        opened = wanted.keys() - self._open.keys()
        for name in sorted(opened):
            self._open[name] = wanted[name]()
        return opened

    def __getitem__(self, name: str) -> Thing:
        return self._open[name]

    def close(self) -> None:
        """Close all."""
        self.keep({})
