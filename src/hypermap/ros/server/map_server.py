"""The map server: a map as topics, services and frames, for ROS 1, ROS 2 and without ROS."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from shapely.geometry.base import BaseGeometry

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.exploration.coverage import Coverage
from hypermap.formats import open_map
from hypermap.ros.port import Level, Parameter, Port, Value
from hypermap.ros.server.automap import AutoMap
from hypermap.ros.server.changes import Changes
from hypermap.ros.server.costmap_masks import CostmapMasks
from hypermap.ros.server.current_map import CurrentMap, MapPart
from hypermap.ros.server.floor_frames import FloorFrames
from hypermap.ros.server.following import Following, Source
from hypermap.ros.server.health import Health, Tally
from hypermap.ros.server.layer_topics import LayerTopics
from hypermap.ros.server.map_files import MAP_DIRECTORY, MapFiles
from hypermap.ros.server.markers import LayerMarkers
from hypermap.ros.server.plans import Plans
from hypermap.ros.server.requests import Requests
from hypermap.ros.server.room_graph import RoomGraph
from hypermap.ros.server.save_at_end import SAVE_TO, announce_end, archive_to_save, save_at_end
from hypermap.ros.server.services import Services
from hypermap.ros.server.terminal_console import TerminalConsole
from hypermap.ros.server.updates import LayerUpdates


class MapServer:
    """The node: it loads a map, shows it, answers questions and takes changes.

    Args:
        port: the middleware.
        file: a map to load, whatever the parameters say.
        source: a map that others change, instead of a file; each new version of it is served.
    """

    NAME = "hypermap_server"
    PARAMETERS: tuple[Parameter, ...] = (
        Parameter("file", "", "The map to load at the start."),
        Parameter("load_map", False, "Whether `file` is loaded, as an .hmap archive."),
        Parameter("load_map_config", False, "Whether `file` is loaded, as a configuration file."),
        MAP_DIRECTORY,
        SAVE_TO,
        Parameter("tf_timeout", 0.5, "How long to wait for tf to know a frame [s].", 0.0, 60.0),
        Parameter(
            "console", True, "Whether commands are taken from the terminal, if there is one."
        ),
        *LayerMarkers.PARAMETERS,
        *CostmapMasks.PARAMETERS,
        *AutoMap.PARAMETERS,
        *Plans.PARAMETERS,
    )

    def __init__(
        self, port: Port, file: str | Path | None = None, source: Source | None = None
    ) -> None:
        self._port = port
        self._file = file
        self._source = source
        self._from_source = Hypermap()
        self._current = CurrentMap(port)
        self._values: dict[str, Value] = {}
        self._parts: tuple[MapPart, ...] = ()
        self._greeting: tuple[Level, str] = "info", ""
        self._automap: AutoMap | None = None

    @property
    def hypermap(self) -> Hypermap:
        """The map as it is now; it is never changed, but replaced."""
        return self._current.hypermap

    @property
    def name(self) -> str:
        """The name of the file or source that the map comes from, or else that of the node."""
        file = self._current.loaded_from
        if file is not None:
            return file.name
        return self.NAME if self._source is None else self._source.name

    @property
    def address(self) -> str:
        """What the map was loaded from, or else a name that stands for a file."""
        if self._current.loaded_from is not None:
            return str(self._current.loaded_from)
        return "MAP.hmap" if self._source is None else self._source.address

    def begin(self, area: BaseGeometry) -> None:
        """Begin to show what a camera covers of an area of the base frame; see `AutoMap`.

        Raises:
            HypermapError: If the node is not active, or no cell of the map is in the area.
        """
        if self._automap is None:
            raise HypermapError("the map server is not active")
        self._automap.begin(area)

    def coverage(self) -> Coverage | None:
        """Return what is covered of that area by now; None while there is none."""
        return None if self._automap is None else self._automap.coverage()

    def configure(self) -> None:
        """Read the parameters and load the map that they name.

        Raises:
            HypermapError: If a parameter or the file is wrong; no map is loaded then.
        """
        values = self._port.parameters(self.PARAMETERS, self._set)
        save_to = archive_to_save(values)
        self._values = dict(values)
        if self._source is None:
            file = self._file or _file_to_load(values)
            hypermap = Hypermap() if file is None else open_map(file)
            self._current.replace(hypermap, None if file is None else Path(file).absolute())
            self._greeting = _greeting(hypermap, file, str(values["file"]))
        else:
            hypermap = self._from_source = self._source.hypermap
            self._current.replace(hypermap)
            self._greeting = _greeting(hypermap, self._source.address, "")
        if save_to is not None:
            announce_end(save_to, self._current.files, self._port)

    def activate(self) -> None:
        """Publish, serve and listen."""
        port, current = self._port, self._current
        frames = FloorFrames(port, float(str(self._values["tf_timeout"])))
        files = MapFiles(port, current, self._announce)
        directory = str(self._values["map_directory"])
        files.directory = Path(directory).expanduser() if directory else None
        tally, requests = Tally(), Requests(frames)
        plans = Plans(port, current, requests)
        self._automap = automap = AutoMap(port, current, requests)
        changes = Changes(port, current)
        following = None
        if self._source is not None:
            following = Following(port, current, self._source, self._from_source)
        parts: list[MapPart] = [
            plans,
            Services(port, current, requests, plans, files, tally, changes),
            LayerTopics(port),
            LayerUpdates(port, current, frames, None if following is None else following.write),
            LayerMarkers(port),
            RoomGraph(port),
            changes,
            CostmapMasks(port),
            automap,
            Health(port, current, tally, archive_to_save(self._values)),
        ]
        if self._values["console"]:
            parts.append(TerminalConsole(port, current, automap.start))
        if following is not None:
            parts.append(following)
        for part in parts:
            part.set(self._values)
        self._parts = tuple(parts)
        current.show_on(self._parts)
        port.log(*self._greeting)  # last: who hears of it finds the topics and services

    def deactivate(self) -> None:
        """Stop all that; the map stays."""
        parts, self._parts, self._automap = self._parts, (), None
        self._current.show_no_more()
        for part in reversed(parts):
            part.close()

    def cleanup(self) -> None:
        """Forget the map, but store it first where the operator wants that."""
        if (path := archive_to_save(self._values)) is not None:
            save_at_end(self._current.hypermap, path, self._current.files, self._port)
        self._current.replace(Hypermap())

    def _set(self, values: Mapping[str, Value]) -> None:
        """Take parameters that have changed while the node runs."""
        self._values.update(values)
        for part in self._parts:
            part.set(values)

    def _announce(self, hypermap: Hypermap, file: str) -> None:
        self._port.log("info", _loaded(hypermap, file))


def _loaded(hypermap: Hypermap, file: str) -> str:
    layers = ", ".join(f"{layer.name} ({layer.class_name})" for layer in hypermap) or "none"
    return f"loaded {file}; base frame {hypermap.base_frame}, layers: {layers}"


def _greeting(hypermap: Hypermap, loaded: str | Path | None, file: str) -> tuple[Level, str]:
    """Return what the log says once all is there.

    Args:
        hypermap: the map.
        loaded: where it comes from; None if it was not loaded.
        file: the parameter of that name.
    """
    if loaded is not None:
        return "info", _loaded(hypermap, str(loaded))
    if file:
        return "warning", (
            f"the parameter file is {file!r}, but neither load_map nor load_map_config is true: "
            "starting without a map"
        )
    return "info", "starting without a map: load one by load_map or the console"


def _file_to_load(values: Mapping[str, Value]) -> Path | None:
    """Return the file that the parameters want loaded; None for none.

    Raises:
        HypermapError: If they contradict each other.
    """
    wanted = [name for name in ("load_map", "load_map_config") if values[name]]
    if not wanted:
        return None
    if len(wanted) > 1:
        raise HypermapError("load_map and load_map_config cannot both be true: a file is only one")
    if not values["file"]:
        raise HypermapError(f"{wanted[0]} is true, but the parameter file names no file")
    return Path(str(values["file"])).expanduser()
