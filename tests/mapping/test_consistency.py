"""What depth images and poses say of each other where no two images show the same things."""

from __future__ import annotations

import numpy as np

from hypermap.core.trajectory import compose, pose_from_rpy
from hypermap.mapping.agreement import Agreement, now_worse
from hypermap.mapping.consistency import Consistency, PoseReading
from hypermap.perception.frame import Camera, RgbdFrame

CAMERA = Camera.from_intrinsics(80, 80, 39.5, 29.5, 80, 60)
AHEAD = np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 1], [0, 0, 0, 1.0]])


def frames_far_apart(count: int) -> list[RgbdFrame]:
    """Return frames of walls 2 m ahead, each taken 5 m beside the one before."""
    depth = np.full((60, 80), 2.0, dtype=np.float32)
    places = [
        compose(pose_from_rpy(0, 5.0 * i, 0, roll=0, pitch=0, yaw=0), AHEAD) for i in range(count)
    ]
    return [RgbdFrame(0.4 * i, depth, CAMERA, pose) for i, pose in enumerate(places)]


def test_frames_with_nothing_in_common_say_nothing() -> None:
    consistency, agreement = Consistency(), Agreement()
    frames = frames_far_apart(24)
    for frame in frames:
        consistency.add(frame)
        agreement.add(frame, frame.map_T_camera)
    assert consistency.time_offset() is None
    assert consistency.depth_scale() is None
    assert consistency.reading() == PoseReading()
    assert consistency.gain_of({frame.stamp: frame.map_T_camera for frame in frames}) is None
    assert not agreement.is_worse


def test_whether_corrected_poses_are_worse_does_not_change_by_chance() -> None:
    assert now_worse(-2.5, was_worse=False)
    assert not now_worse(-1.0, was_worse=False)
    assert now_worse(-1.0, was_worse=True)
    assert now_worse(1.0, was_worse=True)
    assert not now_worse(2.5, was_worse=True)
    assert not now_worse(None, was_worse=True)
