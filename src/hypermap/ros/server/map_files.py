"""Loads and stores maps for clients, in one directory of the operator's choice."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.formats.any_file import open_any
from hypermap.formats.backup import save_with_backup
from hypermap.ros.port import Message, Parameter, Port
from hypermap.ros.server.current_map import CurrentMap
from hypermap.ros.server.map_directory import archive_within, path_within

MAP_DIRECTORY = Parameter(
    "map_directory",
    "",
    "Directory in which the services load_map and store_map may read and write; without one they "
    "refuse.",
)


class MapFiles:
    """The services `load_map`, `store_map` and `clear`, and what that of nav2 needs of them.

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
            HypermapError: If the name leads out of the directory, or the file is not a map.
        """
        self.show(self.path(request.filename))
        return self._port.response("hypermap_msgs/LoadMap")(success=True)

    def store(self, request: Message) -> Message:
        """Answer `hypermap_msgs/StoreMap`: write an archive; an older one stays as NAME.bak.

        Raises:
            HypermapError: If the name leads out of the directory, does not end in .hmap, or the
                file cannot be written.
        """
        path = archive_within(self._named_directory(), request.filename)
        backup = save_with_backup(self._current.hypermap, path)
        self._current.stored(path)
        kept = f"; what was there stays as {backup.name}" if backup else ""
        self._port.log("info", f"stored the map in {request.filename}{kept}")
        return self._port.response("hypermap_msgs/StoreMap")(success=True)

    def clear(self, request: Message) -> Message:  # noqa: ARG002 - there is nothing in it
        """Answer `std_srvs/Trigger`: forget the map; files stay."""
        self._current.replace(Hypermap())
        self._port.log("info", "the map is empty now")
        return self._port.response("std_srvs/Trigger")(success=True, message="the map is empty now")

    def path(self, filename: str) -> Path:
        """Return the path of a file that a client names.

        Raises:
            HypermapError: If its name leads out of the directory, or there is none.
        """
        return path_within(self._named_directory(), filename)

    def show(self, path: Path) -> Hypermap:
        """Put the map of a file in the place of the one that is served, and return it.

        Raises:
            HypermapError: If the file is not a map; the old one stays.
        """
        hypermap = open_any(path)
        self._current.replace(hypermap, path)
        self._announce(hypermap, str(path.relative_to(self._named_directory())))
        return hypermap

    def _named_directory(self) -> Path:
        """Return the directory.

        Raises:
            HypermapError: If the operator has named none.
        """
        if self.directory is None:
            raise HypermapError(
                "loading and storing by service is off: start the node with the parameter "
                "map_directory, the folder in which maps may be read and written"
            )
        return self.directory
