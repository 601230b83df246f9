"""One recording by many workers: the same map, byte for byte."""

from __future__ import annotations

import logging
import os
import signal
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from hypermap.core.errors import HypermapError
from hypermap.core.occupancy import OccupancyLayer
from hypermap.fleet.ahead import LookedAtAhead
from hypermap.fleet.looking import Looked, look_at
from hypermap.fleet.workers import Processes
from hypermap.formats import save_map
from hypermap.mapping.config import MappingConfig, profile
from hypermap.mapping.recording_to_map import Progress, map_recording
from hypermap.mapping.stages import KeyframeConfig
from hypermap.perception.detectors.origin import DetectionOrigin
from hypermap.perception.recording import PendingRecording
from hypermap.recordings import RecordingOptions, open_recording
from hypermap.simulation import SimulatedRecording, write_bag, write_tum
from hypermap.simulation.levels import errors_of_level
from hypermap.simulation.world import built_in_world

pytestmark = pytest.mark.xdist_group("workers")


@pytest.fixture(scope="module")
def workers() -> Iterator[Processes]:
    with Processes(2) as workers:
        yield workers


@pytest.fixture(scope="module")
def simulated() -> SimulatedRecording:
    """A drive with all errors, and frames of sensors that are broken in thirteen ways."""
    return SimulatedRecording.with_errors(
        built_in_world("lab"),
        errors_of_level("fair", "kinect_v1"),
        rate=0.3,
        bad_frames=0.3,
        seed=59,
    )


@pytest.fixture(scope="module")
def folder(simulated: SimulatedRecording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recordings") / "lab"
    write_tum(simulated, path)
    depth = sorted((path / "depth").iterdir())
    depth[5].write_bytes(b"no picture")  # a frame that cannot be read
    return path


def made(
    recording: PendingRecording,
    config: MappingConfig,
    origin: DetectionOrigin | None,
    workers: Processes | None,
    **options: Any,
) -> Any:
    ahead = None if workers is None else LookedAtAhead(recording, workers, origin)
    source = None if origin is None else origin.open()
    return map_recording(ahead or recording, source, config, ahead=ahead, **options)


def saved(hypermap: Any, path: Path) -> bytes:
    save_map(hypermap, path)
    return path.read_bytes()


def assert_same(
    path: Path,
    workers: Processes,
    tmp_path: Path,
    config: MappingConfig,
    origin: DetectionOrigin | None,
    options: RecordingOptions | None = None,
    **others: Any,
) -> Any:
    recordings = [open_recording(path, options) for _ in range(2)]
    one = made(recordings[0], config, origin, None, **others)
    many = made(recordings[1], config, origin, workers, **others)
    assert saved(many, tmp_path / "many.hmap") == saved(one, tmp_path / "one.hmap")
    return many


@pytest.mark.parametrize("name", ["default", "thesis"])
def test_the_map_is_that_of_one_process(
    folder: Path, workers: Processes, tmp_path: Path, name: str
) -> None:
    origin = DetectionOrigin(file=folder / "detections.json")
    hypermap = assert_same(folder, workers, tmp_path, profile(name), origin)
    assert hypermap.metadata["frames"]["unusable"] > 0
    assert len(hypermap["semantic"]) > 2


def test_the_map_is_the_same_where_a_known_map_corrects_poses(
    folder: Path, simulated: SimulatedRecording, workers: Processes, tmp_path: Path
) -> None:
    occupancy = simulated.occupancy()
    assert isinstance(occupancy, OccupancyLayer)
    origin = DetectionOrigin(file=folder / "detections.json")
    hypermap = assert_same(
        folder, workers, tmp_path, profile("default"), origin, occupancy=occupancy
    )
    assert hypermap.metadata["poses"] == "corrected by the occupancy map"


def test_the_map_is_the_same_without_objects_from_turned_images(
    folder: Path, workers: Processes, tmp_path: Path
) -> None:
    options = RecordingOptions(rotate=90, every=2)
    assert_same(folder, workers, tmp_path, profile("default"), None, options)


def test_the_map_of_a_bag_is_the_same(
    simulated: SimulatedRecording, workers: Processes, tmp_path: Path
) -> None:
    path = tmp_path / "lab.bag"
    write_bag(simulated, path)
    assert_same(path, workers, tmp_path, profile("default"), DetectionOrigin())


def test_a_map_is_continued_as_by_one_process(
    folder: Path, workers: Processes, tmp_path: Path
) -> None:
    origin = DetectionOrigin(file=folder / "detections.json")
    part = RecordingOptions(every=4)
    base = made(open_recording(folder, part), profile("default"), origin, None)
    assert_same(folder, workers, tmp_path, profile("default"), origin, onto=base)


def test_the_map_of_a_real_desk_by_a_network_is_the_same(
    shared_data: Path, workers: Processes, tmp_path: Path
) -> None:
    origin = DetectionOrigin(str(shared_data / "models" / "yolox_nano.onnx"))
    options = RecordingOptions(every=10)
    assert_same(shared_data / "desk", workers, tmp_path, profile("default"), origin, options)


def test_a_worker_that_is_killed_does_not_change_the_map(
    folder: Path, workers: Processes, tmp_path: Path
) -> None:
    def kill_one(progress: Progress) -> None:
        if progress.done == 5:
            os.kill(workers.pids[0], signal.SIGKILL)

    before = set(workers.pids)
    origin = DetectionOrigin(file=folder / "detections.json")
    recordings = [open_recording(folder, RecordingOptions(every=2)) for _ in range(2)]
    one = made(recordings[0], profile("default"), origin, None)
    many = made(recordings[1], profile("default"), origin, workers, on_progress=kill_one)
    assert saved(many, tmp_path / "many.hmap") == saved(one, tmp_path / "one.hmap")
    assert set(workers.pids) != before


def test_only_a_few_frames_are_ahead_of_the_mapper(folder: Path) -> None:
    """Also for a recording without end: what waits is bounded by the number of workers."""

    class Counting(Processes):
        begun = 0

        def submit(self, function: Any, *arguments: Any) -> Any:
            self.begun += 1
            return super().submit(function, *arguments)

    with Counting(1) as workers:
        ahead = LookedAtAhead(open_recording(folder), workers, None)
        most = 0

        def count(progress: Progress) -> None:
            nonlocal most
            most = max(most, workers.begun - progress.done)

        map_recording(ahead, None, profile("default"), ahead=ahead, on_progress=count)
    assert 0 < most <= 8  # of them, some are sent again where a frame could not be used


def test_a_frame_that_fails_stops_a_strict_run(folder: Path, workers: Processes) -> None:
    with pytest.raises(HypermapError, match="not a picture"):
        made(open_recording(folder), profile("default"), None, workers, max_bad=0)


def test_what_workers_warn_of_is_said_once(
    folder: Path, workers: Processes, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    empty = tmp_path / "none.json"
    empty.write_text('{"frames": {}}')
    with caplog.at_level(logging.WARNING, "hypermap"):
        made(open_recording(folder), profile("default"), DetectionOrigin(file=empty), workers)
    lines = [record.getMessage() for record in caplog.records]
    assert sum("no entry for the image" in line for line in lines) == 1


def test_a_warning_with_a_longer_stamp_is_of_the_same_kind(
    folder: Path, workers: Processes, caplog: pytest.LogCaptureFixture
) -> None:
    """The first that a second worker warns of may be a later image."""
    ahead = LookedAtAhead(open_recording(folder), workers, None)
    lines = [f"no entry for the image at {stamp:.6f}" for stamp in (0, 10, 1700000000)]
    with caplog.at_level(logging.WARNING, "hypermap"):
        for line in [*lines, "another line"]:
            ahead._log_warnings(Looked(warnings=(line,)))
    assert [record.getMessage() for record in caplog.records] == [lines[0], "another line"]


def test_frames_that_are_not_keyframes_are_only_read(folder: Path, workers: Processes) -> None:
    pending = next(iter(open_recording(folder).pending()))
    ahead = LookedAtAhead(open_recording(folder), workers, None)
    seen: list[Looked] = []

    def keep(_progress: Progress) -> None:
        seen.append(ahead._current)

    config = replace(profile("default"), keyframes=KeyframeConfig(100.0, 180.0, 0.0))
    map_recording(ahead, None, config, ahead=ahead, on_progress=keep)
    assert pending.map_T_camera is not None
    assert sum(looked.perceived is not None for looked in seen) == 1
    assert look_at(pending, ahead._look, is_keyframe=False).perceived is None
