"""The semantic mapper: what a robot's camera sees becomes a map while it drives.

Callbacks hand the newest complete frame to a worker, which maps it; see `worker`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack, closing
from pathlib import Path
from typing import TypeVar

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.recordings.messages.header import clean_frame
from hypermap.recordings.messages.occupancy import occupancy_of_grid
from hypermap.ros.mapper import diagnostics
from hypermap.ros.mapper.exploring import LiveExploration
from hypermap.ros.mapper.frames import FrameMaker
from hypermap.ros.mapper.inputs import LiveInputs
from hypermap.ros.mapper.live_map import LiveMap
from hypermap.ros.mapper.live_values import LiveValues
from hypermap.ros.mapper.outputs import LiveOutputs, PolygonTopics
from hypermap.ros.mapper.path_corrections import PathCorrections
from hypermap.ros.mapper.saving import Saving
from hypermap.ros.mapper.settings import OCCUPANCY, PARAMETERS, LiveSettings
from hypermap.ros.mapper.statistics import Report, State, Statistics
from hypermap.ros.mapper.tf_corrections import TfCorrections
from hypermap.ros.mapper.worker import Worker
from hypermap.ros.port import Closable, Message, Port, Value
from hypermap.ros.throttle import Throttle
from hypermap.text import counted

_STORE = "hypermap_msgs/StoreMap"
_Part = TypeVar("_Part", bound=Closable)


class SemanticMapper:
    """The node; see docs/live.md for its topics, services and parameters."""

    NAME = "semantic_mapper"
    PARAMETERS = (*PARAMETERS, *LiveOutputs.PARAMETERS)
    POLYGONS = PolygonTopics()

    def __init__(self, port: Port) -> None:
        self._port = port
        self._settings: LiveSettings | None = None
        self._values: dict[str, Value] = {}
        self._map: LiveMap | None = None
        self._life: _Life | None = None

    def configure(self) -> None:
        """Read the parameters and load the detector.

        Raises:
            HypermapError: If a parameter or a file is wrong.
        """
        self._values = self._read()
        settings = LiveSettings.of(self._values, self._port.origins(), self._port.node_name)
        if settings.save_to:
            _check_folder(Path(settings.save_to).absolute().parent, "save_to")
        if settings.map_directory:
            _check_folder(Path(settings.map_directory), "map_directory")
        live_map = LiveMap(settings)
        live_map.warm_up()
        if settings.onto:
            begins = f"continues {settings.onto}, which has {counted(len(live_map), 'object')}"
            if not Path(settings.onto).exists():
                begins = f"starts empty: {settings.onto} does not exist yet"
            self._port.log("info", f"the map {begins}")
        self._settings, self._map = settings, live_map

    def activate(self) -> None:
        """Publish, serve and subscribe, and start to map."""
        if self._settings is None or self._map is None:
            raise HypermapError("the node is not configured")
        self._life = _Life(self._port, self._settings, self._map, self._values, self.POLYGONS)

    def deactivate(self) -> None:
        """Stop mapping, and save the map, if `save_to` is given.

        Raises:
            HypermapError: If it cannot be saved.
        """
        life, self._life = self._life, None
        if life is not None:
            life.close()

    def cleanup(self) -> None:
        """Forget the map."""
        self._map = self._settings = None

    def report(self) -> Report | None:
        """Return how the node fares; None if it is not active."""
        life = self._life
        return None if life is None else life.report()

    def hypermap(self) -> Hypermap:
        """Return the map so far; an empty one if the node is not configured."""
        live_map = self._map
        return Hypermap() if live_map is None else live_map.hypermap()

    def mapped(self) -> tuple[SemanticLayer, OccupancyLayer | None]:
        """Return the objects and cells so far, as `LiveMap.mapped` does.

        Without a configuration, there are none.
        """
        live_map = self._map
        return (SemanticLayer("semantic", "map"), None) if live_map is None else live_map.mapped()

    def __len__(self) -> int:
        """Return how many objects are in the map."""
        live_map = self._map
        return 0 if live_map is None else len(live_map)

    def _read(self) -> dict[str, Value]:
        return self._port.parameters(self.PARAMETERS, self._change)

    def _change(self, values: Mapping[str, Value]) -> None:
        self._values.update(values)
        life = self._life
        if life is not None:
            life.outputs.set(values)


class _Life:
    """The node from its activation to its end.

    Its parts do not hold what holds them, so that a map is freed as soon as the node forgets it:
    Python's collector of cycles counts objects, not how large they are.
    """

    def __init__(
        self,
        port: Port,
        settings: LiveSettings,
        live_map: LiveMap,
        values: Mapping[str, Value],
        topics: PolygonTopics,
    ) -> None:
        self._port = port
        self._settings = settings
        self._map = live_map
        self._map_frame = clean_frame(settings.map_frame)
        self._statistics = Statistics()
        self._log = Throttle(port.log)
        self._frames = FrameMaker(settings, port.log)
        self._said = ""
        self._others: list[Closable] = []
        with ExitStack() as begun:  # which is closed again where a part cannot begin
            self._begin(begun, values, topics)
            begun.pop_all()

    def _begin(self, begun: ExitStack, values: Mapping[str, Value], topics: PolygonTopics) -> None:
        port, settings, live_map = self._port, self._settings, self._map

        def closing_later(part: _Part) -> _Part:
            return begun.enter_context(closing(part))

        self.outputs = closing_later(LiveOutputs(port, settings, live_map, topics))
        self.outputs.set(values)
        self._diagnostics = closing_later(port.publisher("/diagnostics", diagnostics.TYPE))
        self._worker = closing_later(
            Worker(
                port, settings, live_map, self._frames, self.outputs, self._statistics, self._log
            )
        )
        self._saving = closing_later(Saving(port, settings, live_map, self._log))
        for other in self._make_others():
            self._others.append(closing_later(other))
        self._values = closing_later(LiveValues(port, settings, live_map, self._log))
        self._inputs = closing_later(
            LiveInputs(
                port,
                settings,
                self._statistics,
                self._log,
                self._worker.put,
                self._take_camera_info,
                self._take_color_info,
                self._worker.jump,
            )
        )

    def _make_others(self) -> Iterator[Closable]:
        """Yield what is there besides mapping, each when the one before is kept."""
        port, settings, live_map = self._port, self._settings, self._map
        yield port.timer(1.0, self._diagnose)
        yield port.service(
            "clear",
            "std_srvs/Trigger",
            self._clear,
            lambda text: self._answer("std_srvs/Trigger", False, text),
        )
        yield port.service(
            "save_map", _STORE, self._store, lambda _: port.response(_STORE)(success=False)
        )
        if settings.frontiers:
            yield LiveExploration(port, settings, live_map, self._log)
        if settings.path_topic or settings.graph_topic:
            yield PathCorrections(port, settings, live_map, self._log)
        elif settings.odom_frame:
            yield TfCorrections(port, settings, live_map, self._log)
        # Before the images, for which a bag player waits: a bag publishes its map only once.
        if settings.map_topic:
            yield port.subscribe(settings.map_topic, OCCUPANCY, self._take_occupancy, latched=True)

    def close(self) -> None:
        """End it, and save the map if that was asked for."""
        self._inputs.close()
        for closable in self._others:
            closable.close()
        self._worker.close()
        self._values.close()  # for the walls of the last frame
        self.outputs.close()
        self._diagnostics.close()
        self._saving.close()

    def report(self) -> Report:
        """Return how the node fares."""
        return self._statistics.report(self._settings.geometry_topic)

    # What callbacks bring

    def _take_camera_info(self, message: Message) -> None:
        self._frames.camera_info = message

    def _take_color_info(self, message: Message) -> None:
        self._frames.color_info = message

    def _take_occupancy(self, message: Message) -> None:
        topic = self._settings.map_topic
        try:
            layer = occupancy_of_grid(message)
        except HypermapError as error:
            self._log.log("warning", "map", f"{topic}: {error}; this map is left out")
            return
        if layer.frame_id != self._map_frame:
            self._log.log(
                "warning",
                "map",
                f"{topic}: the map is in frame {layer.frame_id!r}, not in {self._map_frame!r}, and "
                "is left out",
            )
            return
        self._map.give_occupancy(layer)

    # What others ask

    def _answer(self, type_name: str, success: bool, text: str) -> Message:
        return self._port.response(type_name)(success=success, message=text)

    def _clear(self, _: Message) -> Message:
        forgotten = f"{counted(len(self._map), 'object')} forgotten"
        self._map.clear()
        self._port.log("info", f"asked to clear the map: {forgotten}")
        return self._answer("std_srvs/Trigger", True, forgotten)

    def _store(self, request: Message) -> Message:
        self._saving.store(request.filename)
        return self._port.response(_STORE)(success=True)

    def _diagnose(self) -> None:
        report = self.report()
        if report.state.value + report.message.partition(":")[0] != self._said:
            self._said = report.state.value + report.message.partition(":")[0]
            level = {State.OK: "info", State.WARN: "warning", State.ERROR: "error"}[report.state]
            self._port.log(level, report.message)  # type: ignore[arg-type]
        self._diagnostics.publish(
            diagnostics.diagnostic_array(
                report, len(self._map), self._port.node_name, self._port, self._port.now()
            )
        )


def _check_folder(folder: Path, parameter: str) -> None:
    if not folder.is_dir():
        raise HypermapError(f"{parameter}: {folder}: there is no such folder")
