"""A drive through a world as a recording."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

from hypermap.mapping.pose_graph import CorrectedRecording
from hypermap.perception.frame import RgbdFrame
from hypermap.perception.recording import PendingRecording, Recording
from hypermap.simulation import (
    EXACT_DEPTH,
    EXACT_DETECTOR,
    DetectorNoise,
    PoseNoise,
    SimulatedRecording,
)
from hypermap.simulation.bad_frames import FAULTS
from hypermap.simulation.trajectory import DrivePlan
from hypermap.simulation.world import FloorPlan, Wall, World, WorldObject

WORLD = World(
    "test",
    FloorPlan((0, 0, 6, 4)),
    objects=(
        WorldObject("table", (3, 2)),
        WorldObject("cup", (3, 2), z=0.74),
        WorldObject("chair", (4.2, 2.7)),
    ),
    walls=(Wall(rectangle=(0, 0, 6, 4)),),
    drive=DrivePlan(((0.5, 2), (1.5, 2)), speed=0.5),
)


def frames(**options: object) -> list[RgbdFrame]:
    return list(SimulatedRecording(WORLD, **options).frames())


def assert_same(a: RgbdFrame, b: RgbdFrame) -> None:
    assert a.stamp == b.stamp
    assert (a.map_T_camera == b.map_T_camera).all()
    assert np.array_equal(a.depth, b.depth, equal_nan=True)
    assert (a.color == b.color).all()
    assert (a.detections.xyxy == b.detections.xyxy).all()
    assert (a.detections.scores == b.detections.scores).all()
    assert a.detections.names.tolist() == b.detections.names.tolist()


def test_it_is_a_recording_whose_frames_carry_all_that_mapping_needs() -> None:
    recording: Recording = SimulatedRecording(WORLD, rate=2)
    every = list(recording.frames())
    assert len(every) == len(recording) == 5
    assert [frame.stamp for frame in every] == [0, 0.5, 1, 1.5, 2]
    for frame in every:
        assert frame.depth.shape == (240, 320)
        assert frame.color_stamp == frame.stamp
        assert np.nanmin(frame.depth) >= 0.4
        assert len(frame.detections) > 0
    assert every[-1].map_T_camera[:3, 3].tolist() == [1.5, 2, 1.2]


def test_its_frames_can_be_corrected_like_those_of_files() -> None:
    simulated: PendingRecording = SimulatedRecording(WORLD, rate=2)
    moved = np.eye(4)
    corrected = CorrectedRecording(simulated, {0.5: moved})
    pending = list(corrected.pending())
    for one, frame in zip(pending, simulated.frames(), strict=True):
        assert one.stamp == frame.stamp
        expected = frame.moved_to(moved) if frame.stamp == 0.5 else frame
        assert np.array_equal(one.map_T_camera, expected.map_T_camera)
        assert_same(pickle.loads(pickle.dumps(one)).load(), expected)


def test_the_same_seed_gives_the_same_frames_each_time_they_are_asked_for() -> None:
    recording = SimulatedRecording(WORLD, rate=2, seed=7)
    for first, second, other in zip(
        recording.frames(), recording.frames(), frames(rate=2, seed=7), strict=True
    ):
        assert_same(first, second)
        assert_same(first, other)


def test_frames_that_are_rendered_once_are_those_that_are_rendered_anew() -> None:
    recording = SimulatedRecording(WORLD, rate=2, bad_frames=0.3, seed=4, renders_once=True)
    first, second = list(recording.frames()), list(recording.frames())
    assert len(first) == len(second) > 0
    assert all(one is other for one, other in zip(first, second, strict=True))
    for one, anew in zip(first, frames(rate=2, bad_frames=0.3, seed=4), strict=True):
        assert one.stamp == anew.stamp
        assert np.array_equal(one.depth, anew.depth, equal_nan=True)


def test_another_seed_gives_other_noise_in_the_same_world() -> None:
    a, b = frames(rate=1, seed=1)[0], frames(rate=1, seed=2)[0]
    assert (a.color == b.color).all()
    assert not np.array_equal(a.depth, b.depth, equal_nan=True)


def test_one_kind_of_noise_does_not_disturb_another() -> None:
    plain = frames(rate=1)
    other = frames(rate=1, pose_noise=PoseNoise(0.1, 5), detector_noise=DetectorNoise(miss=0.9))
    for a, b in zip(plain, other, strict=True):
        assert np.array_equal(a.depth, b.depth, equal_nan=True)
        assert not (a.map_T_camera == b.map_T_camera).all()


def test_exact_frames_hold_the_truth() -> None:
    *_, frame = frames(rate=1, depth_noise=EXACT_DEPTH, detector_noise=EXACT_DETECTOR)
    assert sorted(frame.detections.names) == ["chair", "cup", "table"]
    (box,) = frame.detections.xyxy[frame.detections.names == "cup"]
    xmin, ymin, xmax, ymax = box.astype(int)
    # The cup stands at (3, 2, 0.74), the camera at (1.5, 2, 1.2) looks 15 degrees down along +x.
    seen = frame.points()[ymin:ymax, xmin:xmax].reshape(-1, 3)
    in_map = seen @ frame.map_T_camera[:3, :3].T + frame.map_T_camera[:3, 3]
    near = np.hypot(*(in_map[:, :2] - [3, 2]).T) < 0.05
    assert (near & (in_map[:, 2] > 0.75)).sum() > 100


def test_it_tells_what_is_inside() -> None:
    info = SimulatedRecording(WORLD, rate=2).info()
    assert (info.format, info.frames, info.duration) == ("simulation", 5, 2.0)
    assert info.image_size == (320, 240)
    assert info.missing == ()
    assert [stream.name for stream in info.streams] == [
        "depth",
        "color",
        "detections",
        "poses",
        "map",
    ]


def test_the_occupancy_map_can_be_kept_back() -> None:
    assert SimulatedRecording(WORLD).occupancy().value_at([[3, 2]]).tolist() == [100]
    without = SimulatedRecording(WORLD, has_occupancy=False)
    assert without.occupancy() is None
    assert "map" not in [stream.name for stream in without.info().streams]


def test_a_share_of_the_frames_is_bad_and_the_others_stay_as_they_were() -> None:
    recording = SimulatedRecording(WORLD, rate=20, seed=3, bad_frames=0.2)
    worse = SimulatedRecording(WORLD, rate=20, seed=3, bad_frames=0.5)
    assert 0.1 * len(recording) < len(recording.faults) < 0.3 * len(recording)
    assert recording.faults.items() <= worse.faults.items()
    assert SimulatedRecording(WORLD, rate=20, seed=4, bad_frames=0.2).faults != recording.faults
    arrived = {frame.stamp: frame for frame in recording.frames()}
    for i, good in enumerate(SimulatedRecording(WORLD, rate=20, seed=3).frames()):
        if i not in recording.faults:
            assert_same(arrived[good.stamp], good)


@pytest.mark.parametrize("fault", FAULTS)
def test_each_fault_changes_a_frame_in_the_way_of_its_name(fault: str) -> None:
    before, good = frames(rate=2)[1:3]
    spoil = FAULTS[fault]
    bad = spoil(good, before, np.random.default_rng(1))
    again = spoil(good, before, np.random.default_rng(1))
    if fault == "lost":
        assert bad is None
        return
    assert np.array_equal(bad.depth, again.depth, equal_nan=True)
    assert (bad.stamp, bad.camera) == (good.stamp, good.camera)
    changed = {
        "depth": not np.array_equal(bad.depth, good.depth, equal_nan=True),
        "color": not (bad.color == good.color).all(),
        "pose": not (bad.map_T_camera == good.map_T_camera).all(),
        "detections": bad.detections is not good.detections,
    }
    assert {name for name, is_changed in changed.items() if is_changed} == {
        "covered": {"depth", "color", "detections"},
        "saturated": {"depth"},
        "infinite": {"depth"},
        "in another unit": {"depth"},
        "torn": {"depth", "color"},
        "noise": {"depth"},
        "frozen": {"depth", "color", "detections"},
        "upside down": {"depth", "color", "detections"},
        "without pose": {"pose"},
        "astray": {"pose"},
        "with a late pose": {"pose"},
        "with late detections": {"detections"},
        "with a mad detector": {"detections"},
    }[fault]


def test_upside_down_boxes_stay_on_their_objects() -> None:
    *_, good = frames(rate=1, depth_noise=EXACT_DEPTH, detector_noise=EXACT_DETECTOR)
    turned = FAULTS["upside down"](good, good, np.random.default_rng(0))
    for (xmin, ymin, xmax, ymax), box in zip(
        good.detections.xyxy.astype(int), turned.detections.xyxy.astype(int), strict=True
    ):
        seen = good.color[ymin:ymax, xmin:xmax]
        assert (turned.color[box[1] : box[3], box[0] : box[2]][::-1, ::-1] == seen).all()


@pytest.mark.parametrize("share", [-0.1, 1.1, float("nan")])
def test_a_share_of_bad_frames_is_a_share(share: float) -> None:
    with pytest.raises(ValueError, match="bad_frames must be a share from 0 to 1"):
        SimulatedRecording(WORLD, bad_frames=share)


def test_a_world_without_a_drive_is_no_recording() -> None:
    with pytest.raises(ValueError, match="the world 'test' has no drive, so there is no recording"):
        SimulatedRecording(replace(WORLD, drive=None))
