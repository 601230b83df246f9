"""The map that a node serves, and the parts of the node that show it."""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Generic, Protocol, TypeVar

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.history import in_force
from hypermap.ros.port import Closable, Port, Value

Thing = TypeVar("Thing", bound=Closable)

_PATIENCE = 5.0  # seconds that a part may take to show the map when the node stops


class MapPart(Protocol):
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
    wait for each other. A new map is shown before `replace` returns; changed layers are shown by a
    thread, as soon as that can, so several changes at once if they come fast.
    """

    def __init__(self, port: Port) -> None:
        self._port = port
        self._hypermap = Hypermap()
        self._files: frozenset[Path] = frozenset()
        self._loaded_from: Path | None = None
        self._parts: tuple[MapPart, ...] = ()
        self._changed: set[str] = set()  # layers that are not shown as they are
        self._showing = threading.RLock()  # taken before the next, if both are
        self._writing = threading.Condition()  # guards the map and what of it has changed
        self._thread: threading.Thread | None = None

    @property
    def hypermap(self) -> Hypermap:
        """The map now; it is not to be changed."""
        return self._hypermap

    @property
    def files(self) -> frozenset[Path]:
        """The files that hold this map, as it was loaded or stored."""
        return self._files

    @property
    def loaded_from(self) -> Path | None:
        """The file that it was loaded from; None for none."""
        return self._loaded_from

    def replace(self, hypermap: Hypermap, file: Path | None = None) -> None:
        """Put another map in its place, loaded from a file, without what has expired."""
        with self._showing:
            with self._writing:
                self._hypermap = in_force(hypermap, time.time())
                self._files = frozenset() if file is None else frozenset([file])
                self._loaded_from = file
            self.show_again()

    def stored(self, file: Path) -> None:
        """Note that the map was stored in a file."""
        with self._writing:
            self._files |= {file}

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
            self._changed.add(name)
            self._writing.notify()

    def put(self, make: Callable[[Hypermap], Layer]) -> None:
        """Put a layer in the place of the one of its name, or behind all others.

        Args:
            make: takes the map and returns the layer; what it raises leaves the map as it is.
        """
        with self._showing:
            with self._writing:
                hypermap = self._hypermap
                layer = make(hypermap)
                if layer.name in hypermap:
                    self._hypermap = hypermap.with_layer(layer)
                else:
                    self._hypermap = hypermap.with_layers([*hypermap, layer])
            self.show_again()

    def show_on(self, parts: Sequence[MapPart]) -> None:
        """Show the map, and all that follow, on these parts and no others."""
        with self._showing:
            self._parts = tuple(parts)
            self.show_again()
            if self._thread is None:
                self._thread = threading.Thread(target=self._show_changes, name="map", daemon=True)
                self._thread.start()

    def show_no_more(self) -> None:
        """Show it on no part; where a change is just being shown, wait until that is done."""
        with self._showing:
            self._parts = ()
        with self._writing:
            thread, self._thread = self._thread, None
            self._writing.notify_all()
        if thread is not None and thread.is_alive():  # a signal may come before it has started
            thread.join(_PATIENCE)

    def show_again(self) -> None:
        """Show all of the map once more."""
        with self._showing:
            with self._writing:
                hypermap = self._hypermap
                self._changed.clear()
            self._show(hypermap, None)

    def _show_changes(self) -> None:
        me = threading.current_thread()
        while True:
            with self._writing:
                self._writing.wait_for(lambda: self._changed or self._thread is not me)
                if self._thread is not me:
                    return
            with self._showing:
                with self._writing:
                    hypermap, changed = self._hypermap, sorted(self._changed)
                    self._changed.clear()
                if changed:
                    self._show(hypermap, changed)

    def _show(self, hypermap: Hypermap, changed: Sequence[str] | None) -> None:
        for part in self._parts:
            self._show_on(part, hypermap, changed)

    def _show_on(self, part: MapPart, hypermap: Hypermap, changed: Sequence[str] | None) -> None:
        """Show the map on one part; the others go on if it fails."""
        try:
            part.show(hypermap, changed)
        except HypermapError as error:
            self._port.log("error", str(error))
        except Exception:
            if not self._port.is_shut_down:  # Ctrl-C amid an import looks like an error of it
                self._port.log("error", traceback.format_exc())


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
