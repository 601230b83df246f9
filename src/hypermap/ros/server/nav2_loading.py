"""Loads maps for Nav2's tools, by the service of its map server."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import unquote, urlsplit

from hypermap.core.errors import FileMissing, FormatError, HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.ros.messages.to_messages import occupancy_grid
from hypermap.ros.port import Message, Port
from hypermap.ros.server.layer_topics import global_layers
from hypermap.ros.server.map_files import MapFiles

TYPE = "nav2_msgs/LoadMap"
SERVICE = "nav2_load_map"
_TEXTS = {".yaml", ".yml"}


class Nav2Loading:
    """Answers `nav2_msgs/LoadMap`, with the results of nav2's map server.

    Args:
        port: the middleware.
        files: what loads a map.
    """

    def __init__(self, port: Port, files: MapFiles) -> None:
        self._port = port
        self._files = files

    @property
    def is_possible(self) -> bool:
        """Whether the package nav2_msgs is there; it is one of ROS 2."""
        try:
            self._port.response(TYPE)
        except HypermapError:
            return False
        return True

    def load(self, request: Message) -> Message:
        """Load the map that a path or a URL of a file names; the old one stays if it is wrong.

        Args:
            request: its `map_url` is relative to `map_directory`, or leads into it.

        Returns:
            The first grid with cells, one with `publish_global_topics` before others, and the
            result.

        Raises:
            HypermapError: If no file may be loaded, or not this one.
        """
        response = self._port.response(TYPE)
        try:
            hypermap = self._files.show(self._path(request.map_url))
        except FileMissing as error:
            return self._refusal(error, response.RESULT_MAP_DOES_NOT_EXIST)
        except FormatError as error:
            if error.path is None:  # the name is refused, not what the file holds
                raise
            if Path(error.path).suffix.lower() in _TEXTS:
                return self._refusal(error, response.RESULT_INVALID_MAP_METADATA)
            return self._refusal(error, response.RESULT_INVALID_MAP_DATA)
        answer = response(result=response.RESULT_SUCCESS)
        if (layer := _grid(hypermap)) is not None:
            answer.map = occupancy_grid(layer, self._port, self._port.now())
        return answer

    def _path(self, url: str) -> Path:
        """Return the path of a map, as `MapFiles.path` allows it."""
        try:
            name = unquote(urlsplit(url).path) if url.startswith("file://") else url
        except ValueError as error:
            raise HypermapError(f"{url[:200]!r} is not a file URL: {error}") from None
        directory, path = self._files.directory, Path(name)
        if directory is not None and path.is_absolute():
            top = directory.absolute()
            if path.is_relative_to(top):
                name = str(path.relative_to(top))
        return self._files.path(name)

    def _refusal(self, error: HypermapError, result: int) -> Message:
        self._port.log("error", f"{SERVICE}: {error}")
        return self._port.response(TYPE)(result=result)


def _grid(hypermap: Hypermap) -> OccupancyLayer | None:
    layers = [*global_layers(hypermap), *hypermap]
    grids = [layer for layer in layers if isinstance(layer, OccupancyLayer)]
    return next((layer for layer in grids if layer.cells is not None), None)
