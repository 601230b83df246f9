"""The part of a live node that corrects poses by the optimized path or graph of SLAM."""

from __future__ import annotations

import threading

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import HypermapError
from hypermap.core.trajectory import Trajectory, invert, trajectory_of
from hypermap.recordings.messages.header import clean_frame
from hypermap.ros.mapper.live_map import LiveMap
from hypermap.ros.mapper.optimized_poses import TimedGraph, path_of
from hypermap.ros.mapper.settings import GRAPH, PATH, LiveSettings
from hypermap.ros.port import Message, Port
from hypermap.ros.throttle import Throttle

_LEAST = 0.02  # meters that a frame must move for the map to be made again
_QUEUE = 100  # graphs that may wait, because each contains the time of one node


class PathCorrections:
    """Moves the map when a loop closure has moved the path on which it was made.

    The newest path or graph waits until the one before is done, in a thread of its own.
    """

    def __init__(
        self, port: Port, settings: LiveSettings, live_map: LiveMap, log: Throttle
    ) -> None:
        self._port, self._settings, self._map, self._log = port, settings, live_map, log
        self._map_frame = clean_frame(settings.map_frame)
        self._graph = TimedGraph()
        self._topic = settings.graph_topic or settings.path_topic
        self._base_T_camera: NDArray[np.float64] | None = None
        self._newest: Message | None = None
        self._wakes = threading.Event()
        self._ends = False
        if settings.graph_topic:
            self._subscription = port.subscribe(self._topic, GRAPH, self._take_graph, queue=_QUEUE)
        else:
            self._subscription = port.subscribe(self._topic, PATH, self._take, latched=True)
        self._thread = threading.Thread(target=self._work, name="path corrections", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Correct no more."""
        self._subscription.close()
        self._ends = True
        self._wakes.set()
        self._thread.join()

    def _take_graph(self, message: Message) -> None:
        self._graph.learn(message)
        self._take(message)

    def _take(self, message: Message) -> None:
        self._newest = message
        self._wakes.set()

    def _work(self) -> None:
        while self._wakes.wait() and not self._ends:
            self._wakes.clear()
            try:
                self._correct(self._newest)
            except HypermapError as error:
                self._log.log("warning", "path", f"{self._topic}: {error}; no pose was corrected")
            except Exception as error:  # one path must not end the others
                kind = type(error).__name__
                self._log.log("error", "path", f"poses were not corrected: {kind}: {error}")

    def _correct(self, message: Message) -> None:
        stamps, poses = self._map.logged_poses()
        if len(stamps) == 0:
            return
        path = self._path(message)
        if path is None:
            return
        camera = path.at(path.stamps) @ self._mounting(stamps[-1], poses[-1])
        correction = self._map.correct(trajectory_of(path.stamps, camera), _LEAST)
        if correction is not None:
            self._port.log("info", correction.sentence())

    def _path(self, message: Message) -> Trajectory | None:
        read = self._graph.path if self._settings.graph_topic else path_of
        return read(message, self._map_frame)

    def _mounting(self, stamp: float, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return `base_T_camera`, which the first path finds by a frame not corrected before."""
        if self._base_T_camera is None:
            at = round(stamp * 1e9)
            map_T_base = self._port.lookup(self._map_frame, self._settings.base_frame, at)
            self._base_T_camera = invert(map_T_base) @ pose
        return self._base_T_camera
