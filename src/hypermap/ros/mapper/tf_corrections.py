"""The part of a live node that corrects poses when localization corrects itself in tf."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import FrameError
from hypermap.core.trajectory import invert, trajectory_of
from hypermap.recordings.messages.header import clean_frame
from hypermap.ros.mapper.live_map import LiveMap
from hypermap.ros.mapper.repeating import Repeating
from hypermap.ros.mapper.settings import LiveSettings
from hypermap.ros.port import Port
from hypermap.ros.throttle import Throttle

_PERIOD = 0.5  # s between looks at new frames
_JUMP = 0.05  # m by which what a camera sees must move, from one frame to the next
_AHEAD = 3.0  # m from the camera to what it sees


class TfCorrections:
    """Moves the map when the frame of odometry jumps in it, as after a loop closure.

    tf contains only the present pose. The frames since the jump before are taken to have
    drifted evenly along their way, so that each moves by its share of the jump.
    """

    def __init__(
        self, port: Port, settings: LiveSettings, live_map: LiveMap, log: Throttle
    ) -> None:
        self._port, self._map = port, live_map
        self._frames = clean_frame(settings.map_frame), clean_frame(settings.odom_frame)
        self._offset = settings.time_offset
        stamps, _ = live_map.logged_poses()  # of an earlier run
        self._newest = float(stamps[-1]) if len(stamps) else -np.inf
        self._begin = np.inf  # stamp of the first frame since the last jump
        self._map_T_odom: NDArray[np.float64] | None = None
        self._repeating = Repeating("tf jump", self.look, _PERIOD, log, "poses were not corrected")

    def close(self) -> None:
        """Correct no more."""
        self._repeating.close()

    def look(self) -> None:
        """Look where odometry was in the map at each new frame, and correct poses by its jumps."""
        if self._map.corrects_poses:
            return
        stamps, poses = self._map.logged_poses()
        if len(stamps) == 0 or stamps[-1] < self._newest:  # cleared, or the clock has jumped back
            self._newest = float(stamps[-1]) if len(stamps) else -np.inf
            self._map_T_odom = None
        for row in np.flatnonzero(stamps > self._newest).tolist():
            self._newest = float(stamps[row])
            self._follow(stamps[: row + 1], poses[: row + 1])

    def _follow(self, stamps: NDArray[np.float64], poses: NDArray[np.float64]) -> None:
        """Correct the frames since the last jump if there is one right before the newest."""
        try:
            at = round((stamps[-1] + self._offset) * 1e9)
            map_T_odom = self._port.lookup(*self._frames, at)
        except FrameError:  # there is no odometry, or tf has forgotten it
            return
        before, self._map_T_odom = self._map_T_odom, map_T_odom
        if before is None:
            self._begin = float(stamps[-1])
            return
        jump = map_T_odom @ invert(before)
        if moves_by(jump, poses[-1]) < _JUMP:
            return
        since = (stamps >= self._begin) & (stamps < stamps[-1])
        self._begin = float(stamps[-1])
        corrected = np.concatenate([spread(poses[since], jump), poses[-1:]])
        trajectory = trajectory_of(np.append(stamps[since], stamps[-1]), corrected)
        correction = self._map.correct(trajectory, least=0.0)
        if correction is not None:
            self._port.log("info", f"{self._frames[1]} has jumped: {correction.sentence()}")


def moves_by(motion: NDArray[np.float64], map_T_camera: NDArray[np.float64]) -> float:
    """Return how far a motion of the map moves what a camera sees over the floor [m]."""
    seen = map_T_camera @ [0.0, 0.0, _AHEAD, 1.0]
    return float(np.linalg.norm((motion @ seen - seen)[:2]))


def spread(poses: NDArray[np.float64], jump: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return poses that have drifted more and more, until a jump has corrected what came next.

    Each moves by that share of the jump which is its share of the way. Where the camera has stood
    still, all of them have been off by the whole jump.

    Args:
        poses: map_T_camera as they were, in order, shape (N, 4, 4), N > 0.
        jump: takes points of the map where the robot was to where it is, shape (4, 4).

    Returns:
        Shape (N, 4, 4).
    """
    steps = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    way = np.append(0.0, np.cumsum(steps))
    shares = way / way[-1] if way[-1] > 0 else np.ones(len(way))
    # The robot turns about itself, not about the distant origin of the map.
    to_map = np.eye(4)
    to_map[:3, 3] = poses[-1, :3, 3]
    whole = invert(to_map) @ jump @ to_map
    parts = trajectory_of(np.array([0.0, 1.0]), np.stack([np.eye(4), whole])).at(shares)
    return np.asarray(to_map @ parts @ invert(to_map) @ poses)
