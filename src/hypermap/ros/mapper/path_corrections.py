"""The part of a live node that corrects poses by the optimized path of a SLAM system."""

from __future__ import annotations

import threading

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import FormatError, FrameError, HypermapError
from hypermap.core.trajectory import Trajectory, invert, pose_matrix, trajectory_of
from hypermap.recordings.messages.header import as_seconds, clean_frame, nanoseconds
from hypermap.ros.mapper.live_map import LiveMap
from hypermap.ros.mapper.settings import PATH, LiveSettings
from hypermap.ros.port import Message, Port
from hypermap.ros.throttle import Throttle

_LEAST = 0.02  # meters that a frame must move for the map to be made again


class PathCorrections:
    """Moves the map when a loop closure has moved the path on which it was made.

    The newest path waits until the one before is done, in a thread of its own.
    """

    def __init__(
        self, port: Port, settings: LiveSettings, live_map: LiveMap, log: Throttle
    ) -> None:
        self._port, self._settings, self._map, self._log = port, settings, live_map, log
        self._map_frame = clean_frame(settings.map_frame)
        self._base_T_camera: NDArray[np.float64] | None = None
        self._newest: Message | None = None
        self._wakes = threading.Event()
        self._ends = False
        self._thread = threading.Thread(target=self._work, name="path corrections", daemon=True)
        self._thread.start()
        self._subscription = port.subscribe(settings.path_topic, PATH, self._take, latched=True)

    def close(self) -> None:
        """Correct no more."""
        self._subscription.close()
        self._ends = True
        self._wakes.set()
        self._thread.join()

    def _take(self, message: Message) -> None:
        self._newest = message
        self._wakes.set()

    def _work(self) -> None:
        while self._wakes.wait() and not self._ends:
            self._wakes.clear()
            try:
                self._correct(self._newest)
            except HypermapError as error:
                topic = self._settings.path_topic
                self._log.log("warning", "path", f"{topic}: {error}; no pose was corrected")
            except Exception as error:  # one path must not end the others
                kind = type(error).__name__
                self._log.log("error", "path", f"poses were not corrected: {kind}: {error}")

    def _correct(self, message: Message) -> None:
        stamps, poses = self._map.logged_poses()
        if len(stamps) == 0:
            return
        path = path_of(message, self._map_frame)
        camera = path.at(path.stamps) @ self._mounting(stamps[-1], poses[-1])
        correction = self._map.correct(trajectory_of(path.stamps, camera), _LEAST)
        if correction is not None:
            self._port.log("info", correction.sentence())

    def _mounting(self, stamp: float, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return `base_T_camera`, which the first path finds by a frame not corrected before."""
        if self._base_T_camera is None:
            at = round(stamp * 1e9)
            map_T_base = self._port.lookup(self._map_frame, self._settings.base_frame, at)
            self._base_T_camera = invert(map_T_base) @ pose
        return self._base_T_camera


def path_of(message: Message, map_frame: str) -> Trajectory:
    """Return a `nav_msgs/Path` as a trajectory; of poses with one stamp, the last one counts.

    Raises:
        FrameError: If it is in another frame.
        FormatError: If it has no poses, or none of use.
    """
    frame_id = clean_frame(message.header.frame_id)
    if frame_id != map_frame:
        raise FrameError(f"the path is in the frame {frame_id!r}, not in {map_frame!r}")
    by_stamp = {nanoseconds(one.header.stamp): one.pose for one in message.poses}
    if len(by_stamp) < 2:
        raise FormatError("a path needs at least two poses with stamps of their own")
    stamps = sorted(by_stamp)
    places = [by_stamp[stamp].position for stamp in stamps]
    turns = [by_stamp[stamp].orientation for stamp in stamps]
    try:
        matrices = pose_matrix(
            [(p.x, p.y, p.z) for p in places], [(q.x, q.y, q.z, q.w) for q in turns]
        )
    except ValueError as error:
        raise FormatError(str(error)) from None
    return trajectory_of(np.array([as_seconds(stamp) for stamp in stamps]), matrices)
