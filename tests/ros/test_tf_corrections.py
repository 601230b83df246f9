"""When localization corrects itself in tf, the map of a live node moves along."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from hypermap.core.errors import FrameError
from hypermap.core.trajectory import invert, pose_from_rpy
from hypermap.perception.frame import RgbdFrame
from hypermap.ros.mapper.live_map import LiveMap
from hypermap.ros.mapper.settings import LiveSettings
from hypermap.ros.mapper.tf_corrections import TfCorrections, moves_by, spread
from hypermap.ros.throttle import Throttle

from . import live_camera as camera
from .conftest import wait_for
from .semantic_mapper_tools import RAW, Room, drive, room

__all__ = ["drive", "room"]

Poses = NDArray[np.float64]


def at(x: float, y: float = 0.0, yaw: float = 0.0) -> Poses:
    return pose_from_rpy(x, y, 0, 0, 0, yaw)


def test_a_jump_is_spread_over_the_way_before_it() -> None:
    poses = np.stack([at(0), at(1), at(1), at(4)])
    moved = spread(poses, at(0.4, -0.2))
    assert (moved - poses)[:, 0, 3].tolist() == pytest.approx([0, 0.1, 0.1, 0.4])
    assert (moved - poses)[:, 1, 3].tolist() == pytest.approx([0, -0.05, -0.05, -0.2])


def test_drift_that_grows_evenly_is_undone_far_from_the_origin() -> None:
    truth = np.stack([at(500 + x, 300) for x in np.linspace(0, 10, 21)])
    center = at(510, 300)
    whole = center @ at(0.5, 0.3, 0.1) @ invert(center)
    drifted = np.stack(
        [
            center @ at(0.5 * s, 0.3 * s, 0.1 * s) @ invert(center) @ pose
            for s, pose in zip(np.linspace(0, 1, 21), truth, strict=True)
        ]
    )
    assert np.abs(spread(drifted, invert(whole)) - truth)[:, :2, 3].max() < 0.05
    assert np.abs(drifted - truth)[:, :2, 3].max() > 0.4


def test_who_stands_still_was_off_by_the_whole_jump() -> None:
    jump = at(1, 2, 0.5)
    assert spread(np.stack([at(3)] * 4), jump) == pytest.approx(np.stack([jump @ at(3)] * 4))


def test_a_turn_moves_what_the_camera_sees() -> None:
    ahead = pose_from_rpy(7, 0, 1, -np.pi / 2, 0, -np.pi / 2)  # looks along x
    assert moves_by(at(0.03, -0.04), ahead) == pytest.approx(0.05)
    about_the_robot = at(7) @ at(0, 0, 0.01) @ invert(at(7))
    assert moves_by(about_the_robot, ahead) == pytest.approx(0.03, rel=0.01)


class Followed:
    """The live map of a robot whose odometry drifts, and which knows better from some frame on."""

    def __init__(self, drive: list[RgbdFrame], jumps: dict[int, Poses]) -> None:
        self.map = LiveMap(LiveSettings(depth_topic="/depth", detections_topic="/boxes"))
        self.lines: list[str] = []
        self._drive, self._jumps = drive, jumps
        self.has_odometry = True
        port: Any = SimpleNamespace(lookup=self._lookup, log=self._log)
        settings = LiveSettings(depth_topic="/depth", detections_topic="/boxes")
        self.corrections = TfCorrections(port, settings, self.map, Throttle(port.log))
        self.corrections.close()  # its thread; here the test says when it looks

    def _log(self, _: str, text: str) -> None:
        self.lines.append(text)

    def _odom_at(self, stamp: float) -> Poses:
        number = [frame.stamp for frame in self._drive].index(stamp)
        past = [jump for first, jump in sorted(self._jumps.items()) if number >= first]
        return past[-1] if past else np.eye(4)

    def _lookup(self, target: str, source: str, stamp: int) -> Poses:
        assert (target, source) == ("map", "odom")
        if not self.has_odometry:
            raise FrameError("no odometry")
        return self._odom_at(stamp / 1e9)

    def show(self, frames: list[RgbdFrame], odom_T_true: Poses) -> None:
        for frame in frames:
            pose = self._odom_at(frame.stamp) @ odom_T_true @ frame.map_T_camera
            self.map.add(frame.moved_to(pose))

    def off_by(self) -> NDArray[np.float64]:
        """How far each logged frame is from where it was taken [m]."""
        stamps, poses = self.map.logged_poses()
        true = {frame.stamp: frame.map_T_camera for frame in self._drive}
        return np.array(
            [
                np.linalg.norm((pose - true[stamp])[:2, 3])
                for stamp, pose in zip(stamps.tolist(), poses, strict=True)
            ]
        )


def test_the_frames_since_the_last_jump_move(drive: list[RgbdFrame]) -> None:
    off = at(0.3, -0.2)
    followed = Followed(drive, {6: invert(off)})
    followed.show(drive[:6], off)
    followed.corrections.look()
    assert followed.lines == []
    before = followed.off_by()
    followed.show(drive[6:9], off)
    followed.corrections.look()
    assert ["odom has jumped: corrected the poses of" in line for line in followed.lines] == [True]
    after = followed.off_by()
    assert after[5:].max() < 1e-6  # the last one before the jump, and those after it
    assert (np.diff(after[:6]) < 1e-9).all()  # by then the whole jump, before that its part
    assert after[0] == pytest.approx(before[0])
    followed.corrections.look()
    assert len(followed.lines) == 1


def test_small_steps_of_localization_change_nothing(drive: list[RgbdFrame]) -> None:
    followed = Followed(drive, {n: at(0.01 * n) for n in range(1, 6)})
    followed.show(drive[:6], np.eye(4))
    followed.corrections.look()
    assert followed.lines == []


def test_without_odometry_in_tf_nothing_is_corrected(drive: list[RgbdFrame]) -> None:
    followed = Followed(drive, {3: at(1.0)})
    followed.has_odometry = False
    followed.show(drive[:6], np.eye(4))
    followed.corrections.look()
    assert followed.lines == []


def test_after_the_map_was_cleared_the_next_jump_counts_anew(drive: list[RgbdFrame]) -> None:
    followed = Followed(drive, {3: at(1.0), 5: at(1.5)})
    followed.show(drive[:3], np.eye(4))
    followed.corrections.look()
    followed.map.clear()
    followed.corrections.look()
    followed.show(drive[3:5], np.eye(4))
    followed.corrections.look()
    assert followed.lines == []
    followed.show(drive[5:6], np.eye(4))
    followed.corrections.look()
    assert len(followed.lines) == 1


@pytest.mark.slow
@pytest.mark.xdist_group("ros")
def test_a_jump_of_tf_on_a_real_roscore_moves_the_map(
    room: Callable[..., Room], rospy: Any, drive: list[RgbdFrame]
) -> None:
    off = at(0.4, -0.3)
    map_T_odom = np.eye(4)

    def transforms(frame: RgbdFrame) -> Any:
        message = camera.tf(frame.moved_to(off @ frame.map_T_camera), parent="odom")
        odom = camera.tf(frame.moved_to(map_T_odom)).transforms[0]
        odom.child_frame_id = "odom"
        message.transforms.append(odom)
        return message

    node = room(camera.INFO, camera.DARKNET, camera.DEPTH, **RAW)
    node.camera._make[camera.TF] = transforms
    node.show_camera_info(drive[0])
    node.map(drive[:6])
    map_T_odom = invert(off)
    node.camera.show(drive[6])
    wait_for(lambda: node.logged("odom has jumped: corrected the poses of 7 frames"), "a new map")
    stamps, poses = node.live_map.logged_poses()
    true = {frame.stamp: frame.map_T_camera for frame in drive}
    for stamp, pose in list(zip(stamps.tolist(), poses, strict=True))[-2:]:
        assert pose == pytest.approx(true[stamp], abs=1e-6)
