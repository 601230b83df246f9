"""A simulated recording as a ROS bag, read back by the recordings' own reader."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hypermap.core.errors import FileMissing, FormatError
from hypermap.perception.detectors.sources import detections_from_recording
from hypermap.recordings import open_recording
from hypermap.simulation import SimulatedRecording, write_bag
from hypermap.simulation.trajectory import DrivePlan
from hypermap.simulation.world import FloorPlan, World, WorldObject

WORLD = World(
    "test",
    FloorPlan((0, 0, 6, 4)),
    objects=(WorldObject("table", (3, 2)), WorldObject("plant", (3, 3.2))),
    drive=DrivePlan(((0.5, 2), (0.9, 2, 20)), speed=0.4, turn_rate_deg=30),
)


def test_a_written_bag_is_read_back_as_it_was(tmp_path: Path) -> None:
    recording = SimulatedRecording(WORLD, rate=3)
    counted: list[None] = []
    write_bag(recording, tmp_path / "drive.bag", on_frame=lambda: counted.append(None))
    again = open_recording(tmp_path / "drive.bag")
    source = detections_from_recording()
    assert len(again) == len(recording) == len(counted)
    assert again.frame_id == "map"
    for was, now in zip(recording.frames(), again.frames(), strict=True):
        assert now.stamp == pytest.approx(was.stamp + 1, abs=1e-6)  # ROS takes 0 for no time
        assert np.allclose(now.camera.K, was.camera.K)
        assert np.array_equal(now.depth, was.depth, equal_nan=True)
        assert (now.color == was.color).all()
        assert now.map_T_camera == pytest.approx(was.map_T_camera, abs=1e-9)
        found = source(now)
        assert found.names.tolist() == was.detections.names.tolist()
        assert np.abs(found.xyxy - was.detections.xyxy).max(initial=0) <= 0.5
    was, now = recording.occupancy(), again.occupancy()
    assert (now.cells == was.cells).all()
    assert now.grid.resolution == pytest.approx(was.grid.resolution)
    assert now.grid.origin == was.grid.origin
    assert again.info().missing == ()


def test_a_bag_without_an_occupancy_map_has_none(tmp_path: Path) -> None:
    write_bag(SimulatedRecording(WORLD, rate=1, has_occupancy=False), tmp_path / "drive.bag")
    assert open_recording(tmp_path / "drive.bag").occupancy() is None


def test_nothing_is_written_over_and_nothing_is_left_behind(tmp_path: Path) -> None:
    class Breaks(SimulatedRecording):
        def frames(self):
            yield next(super().frames())
            raise FormatError("broken")

    with pytest.raises(FormatError, match="broken"):
        write_bag(Breaks(WORLD), tmp_path / "drive.bag")
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "drive.bag").write_text("mine", encoding="utf-8")
    with pytest.raises(FormatError, match="it already exists; name a new file"):
        write_bag(SimulatedRecording(WORLD), tmp_path / "drive.bag")
    assert (tmp_path / "drive.bag").read_text(encoding="utf-8") == "mine"
    with pytest.raises(FileMissing, match="there is no such folder"):
        write_bag(SimulatedRecording(WORLD), tmp_path / "no" / "drive.bag")


def test_frames_may_lack_color_and_detections(tmp_path: Path) -> None:
    class DepthAlone(SimulatedRecording):
        def frames(self):
            for frame in super().frames():
                yield replace(frame, color=None, color_stamp=None, detections=None)

    write_bag(DepthAlone(WORLD, rate=1), tmp_path / "drive.bag")
    topics = {stream.name for stream in open_recording(tmp_path / "drive.bag").info().streams}
    assert "/camera/rgb/image_color" not in topics
    assert "/camera/depth_registered/image_raw" in topics
