"""A simulated recording as files, read back by the recordings' own reader."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hypermap.core.errors import FileMissing, FormatError
from hypermap.perception.detectors.recorded import RecordedDetections
from hypermap.recordings import open_recording
from hypermap.simulation import SimulatedRecording, write_tum
from hypermap.simulation.bad_frames import FAULTS
from hypermap.simulation.trajectory import DrivePlan
from hypermap.simulation.world import FloorPlan, World, WorldObject
from hypermap.simulation.writer import depth_units

WORLD = World(
    "test",
    FloorPlan((0, 0, 6, 4)),
    objects=(WorldObject("table", (3, 2)), WorldObject("plant", (3, 3.2))),
    drive=DrivePlan(((0.5, 2), (0.9, 2, 20)), speed=0.4, turn_rate_deg=30),
)


def test_a_written_recording_is_read_back_as_it_was(tmp_path: Path) -> None:
    recording = SimulatedRecording(WORLD, rate=3)
    write_tum(recording, tmp_path / "drive")
    again = open_recording(tmp_path / "drive")
    detections = RecordedDetections.load(tmp_path / "drive" / "detections.json")
    assert len(again) == len(recording)
    for was, now in zip(recording.frames(), again.frames(), strict=True):
        assert now.stamp == pytest.approx(was.stamp, abs=1e-6)
        assert np.allclose(now.camera.K, was.camera.K)
        # Steps of 1 / 5000 m.
        np.testing.assert_allclose(now.depth, was.depth, rtol=0, atol=1.01e-4)
        assert (now.color == was.color).all()
        assert now.map_T_camera == pytest.approx(was.map_T_camera, abs=1e-6)
        found = detections.at(now.color_stamp)
        assert found.names.tolist() == was.detections.names.tolist()
        assert (found.xyxy == was.detections.xyxy).all()
    assert again.info().missing == ()


def test_every_fault_can_be_written_and_a_missing_pose_is_no_line(tmp_path: Path) -> None:
    recording = SimulatedRecording(WORLD, rate=60, bad_frames=1, seed=2)
    assert set(recording.faults.values()) == set(FAULTS)
    write_tum(recording, tmp_path / "drive")
    lines = (tmp_path / "drive" / "groundtruth.txt").read_text().splitlines()
    kinds = list(recording.faults.values())
    poses = len(recording) - kinds.count("lost") - kinds.count("without pose")
    assert len([line for line in lines if not line.startswith("#")]) == poses
    for frame in open_recording(tmp_path / "drive").frames():
        assert not np.isinf(frame.depth).any()


def test_nothing_is_written_over_and_nothing_is_left_behind(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(FormatError, match="it already exists; name a new or an empty"):
        write_tum(SimulatedRecording(WORLD), tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_a_recording_that_breaks_leaves_no_half_folder(tmp_path: Path) -> None:
    class WithoutColor(SimulatedRecording):
        def frames(self):
            first, *_ = super().frames()
            yield first
            yield replace(first, stamp=1.0, color=None, color_stamp=None)

    with pytest.raises(FormatError, match=r"test: 1\.000000 s: it has no color"):
        write_tum(WithoutColor(WORLD, rate=1), tmp_path / "drive")
    assert list(tmp_path.iterdir()) == []


def test_a_missing_parent_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileMissing, match="there is no such folder"):
        write_tum(SimulatedRecording(WORLD), tmp_path / "no" / "drive")


def test_depth_that_16_bits_cannot_hold_becomes_no_return() -> None:
    depth = np.array([[np.nan, 1.0, 0.00011, 13.1, 13.2]], dtype=np.float32)
    assert depth_units(depth).tolist() == [[0, 5000, 1, 65500, 0]]
