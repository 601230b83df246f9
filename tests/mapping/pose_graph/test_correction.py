"""Poses of a recording corrected without a map."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from hypermap.mapping.corrections import NO_MATCHES, sentence
from hypermap.mapping.pose_graph import CorrectedPoses, CorrectedRecording, correct_poses
from hypermap.perception.frame import RgbdFrame
from hypermap.perception.recording import PendingFrame
from hypermap.recordings.tum import read_trajectory
from hypermap.simulation.pose_noise import PoseNoise
from hypermap.simulation.trajectory import camera_poses

from .rooms import AROUND, drive, seen_from

pytestmark = pytest.mark.xdist_group("pose_graph")  # they share what takes long to make

ODOMETRY = PoseNoise(odometry=0.01, odometry_yaw_deg=0.1, odometry_turn=0.01)


class Drive:
    """A recording of frames that are at hand."""

    def __init__(self, frames: list[RgbdFrame]) -> None:
        self.all = frames

    def frames(self, _on_bad: object = None) -> Iterator[RgbdFrame]:
        yield from self.all

    def pending(self, _on_bad: object = None) -> Iterator[PendingFrame]:
        for frame in self.all:
            yield PendingFrame(frame.stamp, frame.map_T_camera, _At(frame))


class _At:
    def __init__(self, frame: RgbdFrame) -> None:
        self.frame = frame

    def __call__(self) -> RgbdFrame:
        return self.frame


@pytest.fixture(scope="module")
def around() -> SimpleNamespace:
    """A drive around the room and a little on: exact frames, drifted ones, and the correction."""
    stamps, planar, true = drive()
    exact = [seen_from(pose, stamp) for stamp, pose in zip(stamps.tolist(), true, strict=True)]
    noise = ODOMETRY.estimate(stamps, planar, np.random.default_rng(10))
    poses = camera_poses(noise, AROUND)
    drifted = [frame.moved_to(pose) for frame, pose in zip(exact, poses, strict=True)]
    return SimpleNamespace(
        exact=exact, true=true, drifted=drifted, corrected=correct_poses(Drive(drifted))
    )


def error_of(poses: np.ndarray, true: np.ndarray) -> float:
    """Return the root mean square of the distances to the true positions [m]."""
    return float(np.sqrt(np.sum((poses - true)[:, :2, 3] ** 2, axis=1).mean()))


def matrices(corrected: CorrectedPoses) -> np.ndarray:
    return np.array(list(corrected.poses.values()))


def test_a_drive_that_drifts_comes_to_lie_where_it_was(around: SimpleNamespace) -> None:
    before = error_of(np.array([frame.map_T_camera for frame in around.drifted]), around.true)
    after = error_of(matrices(around.corrected), around.true)
    assert before > 0.25
    assert after < before / 10
    assert (matrices(around.corrected)[0] == around.true[0]).all()
    assert matrices(around.corrected)[:, 2] == pytest.approx(around.true[:, 2])
    assert around.corrected.loops > 5


def test_exact_poses_stay(around: SimpleNamespace) -> None:
    corrected = correct_poses(Drive(around.exact))
    assert (matrices(corrected) == around.true).all()
    told = sentence(corrected.summary())
    assert told.startswith(f"poses: 0 of {len(around.exact)} corrected by a pose graph with ")
    assert told.endswith(
        ": frames match about as well by the recorded poses, as where these are exact"
    )


def test_poses_stay_where_nothing_can_be_matched(around: SimpleNamespace) -> None:
    bare = [
        seen_from(frame.map_T_camera, frame.stamp, room=((-50, -50, 0), (50, 50, 2.5)), boxes=())
        for frame in around.drifted[:10]
    ]
    corrected = correct_poses(Drive(bare))
    assert list(corrected.poses.values()) == [pytest.approx(frame.map_T_camera) for frame in bare]
    assert corrected.summary()["as_recorded"] == {NO_MATCHES: 10}


def test_frames_between_keyframes_move_with_them(around: SimpleNamespace) -> None:
    """Of which a hundredth of the way is none."""
    first = around.drifted[0]
    step = np.eye(4)
    step[2, 3] = 0.03  # ahead
    again = RgbdFrame(first.stamp + 0.1, first.depth, first.camera, first.map_T_camera @ step)
    frames = [first, again, *around.drifted[1:]]
    corrected = list(correct_poses(Drive(frames)).poses.values())
    assert len(corrected) == len(frames)
    ahead = np.linalg.inv(corrected[0]) @ corrected[1]
    assert ahead[:3, 3] == pytest.approx([0, 0, 0.03], abs=0.01)


def test_the_same_recording_gives_the_same_poses(around: SimpleNamespace) -> None:
    again = correct_poses(Drive(around.drifted))
    assert (matrices(again) == matrices(around.corrected)).all()


def test_a_corrected_recording_has_the_corrected_poses(around: SimpleNamespace) -> None:
    recording = CorrectedRecording(Drive(around.drifted), around.corrected.poses)  # type: ignore[arg-type]
    expected = matrices(around.corrected)
    assert (np.array([frame.map_T_camera for frame in recording.frames()]) == expected).all()
    pending = list(recording.pending())
    assert (pending[5].map_T_camera == expected[5]).all()
    loaded = pickle.loads(pickle.dumps(pending[5].load))()
    assert (loaded.map_T_camera == expected[5]).all()
    assert (loaded.depth == around.drifted[5].depth).all()
    unknown = CorrectedRecording(Drive(around.drifted[:1]), {})  # type: ignore[arg-type]
    assert next(unknown.frames()) is around.drifted[0]


def test_corrected_poses_are_a_trajectory_file(around: SimpleNamespace, tmp_path: Path) -> None:
    file = tmp_path / "corrected.txt"
    file.write_text(around.corrected.tum())
    read, _ = read_trajectory(file, 10.0)
    assert read.positions == pytest.approx(matrices(around.corrected)[:, :3, 3], abs=1e-5)


def test_a_step_that_never_was_does_not_tear_the_map_apart(around: SimpleNamespace) -> None:
    """As where wheels slip: matches are right then, and odometry is not."""
    slip = np.eye(4)
    slip[0, 3] = 0.15
    slipped = [
        frame.moved_to(slip @ frame.map_T_camera if i > 30 else frame.map_T_camera)
        for i, frame in enumerate(around.exact)
    ]
    corrected = correct_poses(Drive(slipped))
    assert error_of(matrices(corrected), around.true) < 0.02
