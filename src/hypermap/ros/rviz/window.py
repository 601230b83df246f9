"""A window of rviz on ROS 1 that follows a map server: one display for each of its layers."""

from __future__ import annotations

import contextlib
import json
import logging
import signal
import subprocess
import sys
import threading
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import IO, Any, Protocol, TypeAlias

import yaml

from hypermap.core.errors import HypermapError
from hypermap.core.occupancy import OccupancyLayer
from hypermap.recordings.messages.header import clean_frame
from hypermap.ros.port import Closable, Message, Port
from hypermap.ros.rviz.config import (
    DEFAULT_SERVER,
    GROUND,
    MASKS,
    RvizView,
    configuration,
    display,
    exploration_display,
    ground,
    has_display,
    mask_display,
    opened,
    room_graph_display,
    views,
)
from hypermap.ros.topic_names import topic_name

_SCRIPT = Path(__file__).with_name("bindings.py")
_PYTHONS = ("/usr/bin/python3", sys.executable)
_NEEDED = "from rviz import bindings; import python_qt_binding"
# Run by its path, so that its folder, which has modules of common names, is no place for imports.
_RUN = "import runpy, sys; runpy.run_path(sys.argv[1], run_name='__main__')"
_END_TIMEOUT = 10.0  # s

# Exit codes: graphics drivers are not free of faults, and the C library aborts where it finds that
# they have overwritten memory. Qt aborts, too, where it cannot open a display.
_CRASHES = (-signal.SIGSEGV, -signal.SIGBUS, -signal.SIGABRT)
_MOST_RESTARTS = 3
Bounds: TypeAlias = tuple[float, float, float, float]
"""xmin, ymin, xmax, ymax in the fixed frame [m]."""

_log = logging.getLogger(__name__)


class Displays(Protocol):
    """What takes orders to show displays, as `bindings` describes them."""

    def tell(self, do: str, **order: Any) -> None:
        """Give an order."""
        ...


class RvizWindow:
    """An rviz window in its own process; it reopens with its displays after a crash.

    Raises:
        HypermapError: If no Python here has rviz's bindings.
    """

    def __init__(self) -> None:
        self._command = [_python_with_rviz(), "-c", _RUN, str(_SCRIPT)]
        self._lock = threading.Lock()
        self._orders: dict[tuple[str, str], str] = {}  # those that still count, in their order
        self._crashes = 0
        self._process = self._started()

    def tell(self, do: str, **order: Any) -> None:
        """Give an order; one to a window that is closed is lost."""
        line = json.dumps({"do": do, **order})
        with self._lock:
            if do == "load":
                self._orders.clear()
            key = ("display", order["name"]) if "name" in order else (do, "")
            self._orders.pop(key, None)
            self._orders[key] = line
            self._write(line)

    def wait(self, timeout: float) -> bool:
        """Wait for the user to close the window, and return whether they did.

        Raises:
            HypermapError: If it has ended by an error, or has crashed more than three times.
        """
        try:
            code = self._process.wait(timeout)
        except subprocess.TimeoutExpired:
            return False
        if code in _CRASHES:
            self._crashes += 1
            name = signal.Signals(-code).name
            if self._crashes > _MOST_RESTARTS:
                raise HypermapError(
                    f"rviz has crashed {self._crashes} times ({name}); is there a display? Try it "
                    "alone, with: rviz"
                )
            _log.warning("rviz has crashed (%s); starting it again", name)
            self._restart()
            return False
        if code:
            raise HypermapError(f"rviz ended with exit code {code}")
        return True

    def close(self) -> None:
        """Close the window."""
        with self._lock, contextlib.suppress(BrokenPipeError):
            self._input.close()
        try:
            self._process.wait(_END_TIMEOUT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _started(self) -> subprocess.Popen[str]:
        return subprocess.Popen(self._command, stdin=subprocess.PIPE, text=True)

    def _restart(self) -> None:
        with self._lock:
            with contextlib.suppress(BrokenPipeError):  # of an order that was not read
                self._input.close()
            self._process = self._started()
            for line in self._orders.values():
                self._write(line)

    def _write(self, line: str) -> None:
        with contextlib.suppress(BrokenPipeError, ValueError):  # it is closed
            print(line, file=self._input, flush=True)

    @property
    def _input(self) -> IO[str]:
        assert self._process.stdin is not None
        return self._process.stdin


class LayerDisplays:
    """Keeps the displays of a window like the layers and masks of a map server.

    The view is fitted to the first grid, and again when the server says that another map has come
    and its first grid lies elsewhere; not where a grid grows while it is being made.

    Args:
        port: the node that listens.
        window: where displays are shown.
        server: full name of the map server's node.
        view: what is seen of the first map; None for its first grid.
    """

    def __init__(
        self,
        port: Port,
        window: Displays,
        server: str = DEFAULT_SERVER,
        view: RvizView | None = None,
    ) -> None:
        self._port, self._window, self._server = port, window, server
        self._shown: dict[str, dict[str, Any]] = {}
        self._heard: set[str] = set()  # displays of topics that not every server has
        self._frame = "map"
        self._has_view = view is not None
        self._grid: Closable | None = None
        self._grid_topic = ""
        self._bounds: Bounds | None = None  # of the grid
        self._fitted: Bounds | None = None  # to which the view was
        self._another_came = False  # since then
        self._lock = threading.RLock()
        window.tell("load", config=configuration([], self._frame, view or RvizView()))
        port.subscribe(
            f"{server}/hypermap_metadata", "hypermap_msgs/HypermapMetaData", self.show, latched=True
        )
        for name, topic in MASKS.items():
            show = partial(self.show_heard, mask_display(name, server))
            port.subscribe(f"{server}/{topic}", "nav_msgs/OccupancyGrid", show, latched=True)
        for shown in (room_graph_display(server), exploration_display(server)):
            show, topic = partial(self.show_heard, shown), shown["Marker Topic"]
            port.subscribe(topic, "visualization_msgs/MarkerArray", show, latched=True)

    def show(self, metadata: Message) -> None:
        """Show the layers that a `hypermap_msgs/HypermapMetaData` names, and no others."""
        with self._lock:
            layers = [item for item in metadata.layers if has_display(item.class_name)]
            frames = [clean_frame(item.frame_id) for item in metadata.layers]
            if frames and frames[0] != self._frame:
                self._frame = frames[0]
                self._window.tell("frame", frame=self._frame)
            wanted = {
                item.name: display(item.class_name, item.name, self._server) for item in layers
            }
            for name in [name for name in self._shown if name not in wanted]:
                self._window.tell("remove", name=name)
                del self._shown[name]
            for name, config in wanted.items():
                if self._shown.get(name) != config:
                    self._put(config)
                    self._shown[name] = config
            self._another_came = True
            self._listen_to_grid(layers)
            self._fit()

    def show_heard(self, config: dict[str, Any], _: Message) -> None:
        """Show a display from the first message of its topic on; not every server has it."""
        with self._lock:
            if config["Name"] not in self._heard:
                self._heard.add(config["Name"])
                self._put(config)

    def look_at(self, grid: Message) -> None:
        """Take note of where a grid lies, given as `nav_msgs/MapMetaData`."""
        with self._lock:
            if grid.width and grid.height:
                xmin, ymin = grid.origin.position.x, grid.origin.position.y
                width, height = grid.width * grid.resolution, grid.height * grid.resolution
                self._bounds = xmin, ymin, xmin + width, ymin + height
                self._fit()

    def _fit(self) -> None:
        """Show the whole of the grid, if that of another map lies elsewhere."""
        if not self._another_came or self._bounds in (None, self._fitted):
            return
        is_first = self._fitted is None
        self._fitted, self._another_came = self._bounds, False
        if (is_first and self._has_view) or self._bounds is None:
            return
        view = RvizView.of(self._bounds)
        self._window.tell("view", config=yaml.safe_dump(views(view)))
        if GROUND not in self._shown:  # a layer may be called so
            self._put(ground(view))

    def _put(self, config: dict[str, Any]) -> None:
        text = yaml.safe_dump(config, allow_unicode=True)
        order = {"class": config["Class"], "config": text, "open": opened(config)}
        self._window.tell("put", name=config["Name"], **order)

    def _listen_to_grid(self, layers: Sequence[Message]) -> None:
        """Ask where the first grid in the fixed frame lies."""
        grids = (
            topic_name(layer.name, "map_metadata")
            for layer in layers
            if layer.class_name == OccupancyLayer.class_name
            and clean_frame(layer.frame_id) == self._frame
        )
        topic = next(grids, "")
        if topic == self._grid_topic:
            return
        if self._grid is not None:
            self._grid.close()
        self._grid, self._grid_topic, self._bounds = None, topic, None
        if topic:
            self._grid = self._port.subscribe(
                f"{self._server}/{topic}", "nav_msgs/MapMetaData", self.look_at, latched=True
            )


def follow(port: Port, server: str = DEFAULT_SERVER, view: RvizView | None = None) -> None:
    """Show a window that follows a map server until it is closed or the node is to end.

    Raises:
        HypermapError: If rviz or its bindings are missing, or rviz has failed.
    """
    window = RvizWindow()
    try:
        LayerDisplays(port, window, server, view)
        while not port.is_shut_down and not window.wait(0.2):
            pass
    finally:
        window.close()


def _python_with_rviz() -> str:
    """Return the Python that rviz's bindings are for."""
    for python in _PYTHONS:
        if (
            Path(python).exists()
            and not subprocess.run(
                [python, "-c", _NEEDED], capture_output=True, check=False
            ).returncode
        ):
            return python
    raise HypermapError(
        "rviz's Python bindings are missing: on Debian, apt-get install rviz python3-rviz; "
        "elsewhere, source the setup.bash of ROS 1"
    )
