"""Loading and storing maps on a client's word: inside one directory that the operator has named."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from hypermap.core.errors import FileMissing, HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.formats import open_map, save_map
from hypermap.formats.store import safe_name
from hypermap.ros.current_map import CurrentMap
from hypermap.ros.port import Message, Parameter, Port

MAP_DIRECTORY = Parameter(
    "map_directory",
    "",
    "Directory in which the services load_map and store_map may read and write; without one they "
    "refuse.",
)
ARCHIVE = ".hmap"


class MapFiles:
    """The services `load_map`, `store_map` and `clear`.

    Attributes:
        directory: where the maps are; None if the operator has named none.
    """

    def __init__(
        self, port: Port, current: CurrentMap, announce: Callable[[Hypermap, str], None]
    ) -> None:
        self._port = port
        self._current = current
        self._announce = announce
        self.directory: Path | None = None

    def load(self, request: Message) -> Message:
        """Answer `hypermap_msgs/LoadMap`; the old map stays if the new one is wrong.

        Raises:
            HypermapError: If the name leads out of the directory, or the file is no map.
        """
        path = self.path_of(request.filename)
        hypermap = open_map(path)
        self._current.replace(hypermap)
        self._announce(hypermap, request.filename)
        return self._port.response("hypermap_msgs/LoadMap")(success=True)

    def store(self, request: Message) -> Message:
        """Answer `hypermap_msgs/StoreMap`: write an archive, in place of an older one.

        Raises:
            HypermapError: If the name leads out of the directory, does not end in .hmap, or the
                file cannot be written.
        """
        path = self.path_of(request.filename)
        if path.suffix.lower() != ARCHIVE:
            raise HypermapError(f"{request.filename!r}: give a name that ends in {ARCHIVE}")
        save_map(self._current.hypermap, path)
        self._port.log("info", f"stored the map in {request.filename}")
        return self._port.response("hypermap_msgs/StoreMap")(success=True)

    def clear(self, request: Message) -> Message:  # noqa: ARG002 - there is nothing in it
        """Answer `std_srvs/Trigger`: forget the map; files stay."""
        self._current.replace(Hypermap())
        self._port.log("info", "the map is empty now")
        return self._port.response("std_srvs/Trigger")(success=True, message="the map is empty now")

    def path_of(self, filename: str) -> Path:
        """Return where a file of the directory lies.

        Raises:
            HypermapError: If no directory was named, or the name leads out of it: it is absolute,
                has `..` in it, or passes a link to elsewhere.
        """
        if self.directory is None:
            raise HypermapError(
                "loading and storing by service is off: start the node with the parameter "
                "map_directory, the folder in which maps may be read and written"
            )
        if not self.directory.is_dir():
            raise FileMissing(f"{self.directory}: the map_directory does not exist")
        path = self.directory / safe_name(filename)
        if not _real(path).is_relative_to(_real(self.directory)):
            raise HypermapError(f"{filename!r} is a link that leads out of the map_directory")
        return path


def _real(path: Path) -> Path:
    return Path(os.path.realpath(path))
