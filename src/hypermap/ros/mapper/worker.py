"""The one thread of the semantic mapper that maps frames.

Callbacks put the newest complete frame in a slot. A frame that comes while the worker is busy
replaces the one that waits, so a slow machine drops frames and does not lag.
"""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import FrameError, HypermapError
from hypermap.mapping.preflight import Finding, Preflight
from hypermap.recordings.messages.header import clean_frame
from hypermap.ros.mapper.frames import FrameMaker
from hypermap.ros.mapper.inputs import QueuedFrame
from hypermap.ros.mapper.live_map import LiveMap
from hypermap.ros.mapper.mailbox import Mailbox
from hypermap.ros.mapper.outputs import LiveOutputs
from hypermap.ros.mapper.settings import LiveSettings
from hypermap.ros.mapper.statistics import FINE, Fate, Statistics
from hypermap.ros.port import Port
from hypermap.ros.throttle import Throttle

_TF_POLL = 0.01  # s
# Where a live node is mended otherwise than a recording.
_REMEDIES = {
    "level": "does tf say where the camera really is?",
    "scale": "is the parameter depth_scale right?",
    "registration": "take depth that is registered to color, or set the parameter register",
    "poses": "do the depth messages name an optical frame? If not, set camera_frame to one, or the "
    "parameter pose_convention",
    "upright": "does tf say how the camera is mounted? If so, set the parameter rotate",
}
_PATIENT_END = 30.0  # s that the worker may take for its last frame


class Worker:
    """Maps the newest frame, publishes what changed, and counts what became of each frame.

    It warns once of each fault that the pre-flight check finds.
    """

    def __init__(
        self,
        port: Port,
        settings: LiveSettings,
        live_map: LiveMap,
        frames: FrameMaker,
        outputs: LiveOutputs,
        statistics: Statistics,
        log: Throttle,
    ) -> None:
        self._port = port
        self._settings = settings
        self._map = live_map
        self._map_frame = clean_frame(settings.map_frame)
        self._frames = frames
        self._outputs = outputs
        self._statistics = statistics
        self._log = log
        self._mailbox = Mailbox[tuple[int, QueuedFrame]]()
        self._ends = threading.Event()
        self._waits_for_tf = False
        self._jumps = 0  # how often the clock has jumped back
        self._newest = (0, 0)  # jumps before the newest frame that was taken, and its stamp [ns]
        self._preflight = Preflight(
            _warning(port, self._map_frame), live_map.config.perception.max_depth
        )
        self._prepare_tf()
        self._thread = threading.Thread(target=self._work, name="mapping", daemon=True)
        self._thread.start()

    def put(self, queued: QueuedFrame) -> None:
        """Hand over a frame, instead of one that still waits."""
        replaced = self._mailbox.put((self._jumps, queued))
        if replaced is not None:
            self._statistics.count(Fate.NO_TF if self._waits_for_tf else Fate.BUSY)

    def jump(self) -> None:
        """Forget what waits, after the clock has jumped back."""
        if self._mailbox.take(timeout=0.0) is not None:
            self._statistics.count(Fate.CLOCK_JUMP)
        self._jumps += 1
        self._port.forget_transforms()
        self._port.log(
            "warning", "the clock has jumped back: dropped waiting messages, the map continues"
        )

    def close(self) -> None:
        """Map what is under way, and end."""
        self._ends.set()
        self._thread.join(_PATIENT_END)

    def _work(self) -> None:
        period = 1 / self._settings.publish_rate
        next_publish = 0.0
        while not self._ends.is_set():
            item = self._mailbox.take(timeout=min(period, 0.2))
            try:
                if item is not None:
                    self._take(*item)
                if time.monotonic() >= next_publish:
                    next_publish = time.monotonic() + period
                    self._outputs.publish()
            except Exception as error:  # one frame must not end the node
                kind = type(error).__name__
                self._log.log("error", kind, f"a frame failed: {kind}: {error}")
        self._outputs.publish()
        self._preflight.finish()

    def _take(self, jumps: int, queued: QueuedFrame) -> None:
        """Map a frame that came after so many jumps, and count what became of it."""
        fate, reason = Fate.UNUSABLE, ""
        try:
            fate, reason = self._map_frame_of(jumps, queued)
        except (HypermapError, ValueError) as error:
            reason = str(error)
        finally:
            self._statistics.count(fate, time.monotonic() - queued.arrived)
        if reason:
            self._log.log("warning", fate, f"{fate.value}: {reason}")

    def _map_frame_of(self, jumps: int, queued: QueuedFrame) -> tuple[Fate, str]:
        """Map a frame; return what became of it, and why if that is worth a line."""
        stamp = queued.match.stamp
        if (jumps, stamp) <= self._newest:
            return Fate.TOO_OLD, ""
        self._newest = jumps, stamp
        if self._frames.lacks_camera_info:
            return Fate.NO_CAMERA_INFO, f"nothing came on {self._settings.info_topic}"
        try:
            frame_id = self._frames.frame_id(queued.geometry)
            pose = self._pose(frame_id, stamp + round(self._settings.time_offset * 1e9))
            color_T_depth = self._depth_pose(queued, frame_id)
        except FrameError as error:
            return Fate.NO_TF, str(error)
        frame = self._frames.frame(queued.match, queued.geometry, pose, color_T_depth)
        fate, reason, observation = self._map.add(frame)
        if fate in FINE:
            self._preflight.add(frame)
        if observation is not None:
            self._outputs.show(observation, stamp)
            self._preflight.add_mapped(frame)
        return fate, reason

    def _depth_pose(self, queued: QueuedFrame, frame_id: str) -> NDArray[np.float64] | None:
        """Return `color_T_depth`, (4, 4), if depth is to be registered to color."""
        if not self._settings.register:
            return None
        color = clean_frame(queued.match.items["color"].header.frame_id)
        return self._port.lookup(color, frame_id)

    def _pose(self, frame_id: str, stamp: int) -> NDArray[np.float64]:
        """Return `map_T_camera` at a time; wait for it a little.

        The wait goes by the wall's clock: that of a paused bag would stand still.
        """
        if not frame_id:
            raise FrameError("the depth messages name no frame; set camera_frame")
        end = time.monotonic() + self._settings.tf_timeout
        self._waits_for_tf = True
        try:
            while (pose := self._pose_now(frame_id, stamp)) is None:
                if time.monotonic() >= end or self._ends.wait(_TF_POLL):
                    return self._port.lookup(self._map_frame, frame_id, stamp)
            return pose
        finally:
            self._waits_for_tf = False

    def _pose_now(self, frame_id: str, stamp: int) -> NDArray[np.float64] | None:
        """Return `map_T_camera` if tf knows it by now."""
        try:
            return self._port.lookup(self._map_frame, frame_id, stamp)
        except FrameError:
            return None

    def _prepare_tf(self) -> None:
        """Let the middleware listen to tf from now on, not only from the first frame on."""
        with contextlib.suppress(FrameError):
            self._port.lookup(self._map_frame, self._map_frame)


def _warning(port: Port, map_frame: str) -> Callable[[Finding], None]:
    """Return what warns of a fault that the pre-flight check finds."""

    def warn(finding: Finding) -> None:
        remedy = _REMEDIES.get(finding.check, finding.remedy)
        port.log("warning", f"{finding.measured} ({map_frame!r}); {finding.effect}; {remedy}")

    return warn
