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
from pathlib import Path
from typing import IO, Any, Protocol

import yaml

from hypermap.core.errors import HypermapError
from hypermap.core.occupancy import OccupancyLayer
from hypermap.recordings.messages.header import clean_frame
from hypermap.ros.port import Closable, Message, Port
from hypermap.ros.rviz.config import (
    DEFAULT_SERVER,
    View,
    configuration,
    display,
    has_display,
    opened,
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
_log = logging.getLogger(__name__)


class Displays(Protocol):
    """What takes orders to show displays, as `bindings` describes them."""

    def tell(self, do: str, **order: Any) -> None:
        """Give an order."""
        ...


class RvizWindow:
    """A window of rviz in a process of its own; one that crashes comes again as it was told to be.

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
            raise HypermapError(f"rviz has ended with exit code {code}")
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
    """Keeps the displays of a window like the layers of a map server.

    Args:
        port: the node that listens.
        window: where displays are shown.
        server: full name of the map server's node.
        view: what is seen first; None for the first grid that the server has.
    """

    def __init__(
        self, port: Port, window: Displays, server: str = DEFAULT_SERVER, view: View | None = None
    ) -> None:
        self._port, self._window, self._server = port, window, server
        self._shown: dict[str, dict[str, Any]] = {}
        self._frame = "map"
        self._wants_view = view is None
        self._grid: Closable | None = None
        self._lock = threading.Lock()
        window.tell("load", config=configuration([], self._frame, view or View()))
        port.subscribe(
            f"{server}/hypermap_metadata", "hypermap_msgs/HypermapMetaData", self.show, latched=True
        )

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
                    text = yaml.safe_dump(config, allow_unicode=True)
                    order = {"class": config["Class"], "config": text}
                    self._window.tell("put", name=name, **order, open=opened(config))
                    self._shown[name] = config
            if self._wants_view and self._grid is None:
                self._subscribe_to_grid(layers)

    def look_at(self, grid: Message) -> None:
        """Show the whole of a grid, given as `nav_msgs/MapMetaData`, once."""
        with self._lock:
            if not (self._wants_view and grid.width and grid.height):
                return
            self._wants_view = False
            xmin, ymin = grid.origin.position.x, grid.origin.position.y
            xmax, ymax = xmin + grid.width * grid.resolution, ymin + grid.height * grid.resolution
            view = View.of((xmin, ymin, xmax, ymax))
            shown = list(self._shown.values())
            self._window.tell("load", config=configuration(shown, self._frame, view))

    def _subscribe_to_grid(self, layers: Sequence[Message]) -> None:
        """Ask where the first grid in the fixed frame lies."""
        for layer in layers:
            is_grid = layer.class_name == OccupancyLayer.class_name
            if is_grid and clean_frame(layer.frame_id) == self._frame:
                topic = f"{self._server}/{topic_name(layer.name, 'map_metadata')}"
                self._grid = self._port.subscribe(
                    topic, "nav_msgs/MapMetaData", self.look_at, latched=True
                )
                return


def follow(port: Port, server: str = DEFAULT_SERVER, view: View | None = None) -> None:
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
