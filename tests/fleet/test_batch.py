"""Many recordings: which jobs there are, what becomes of them, and the table of results."""

from __future__ import annotations

import csv
import dataclasses
import json
import os
import signal
from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from hypermap.core.errors import HypermapError
from hypermap.fleet.batch.batch import Result, run_batch
from hypermap.fleet.batch.jobs import jobs_in, swept
from hypermap.fleet.batch.running import key_of
from hypermap.fleet.batch.table import write_tables
from hypermap.fleet.workers import Processes
from hypermap.formats import open_map, save_map
from hypermap.mapping.pose_graph import correct_poses
from hypermap.mapping.recording_to_map import map_recording
from hypermap.perception.detectors.origin import DetectionOrigin
from hypermap.recordings import open_recording

from ..cli.conftest import write_drive

pytestmark = pytest.mark.xdist_group("workers")


class Here:
    """A worker that is this process."""

    count = 1
    threads = 2

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            future.set_result(function(*arguments))
        except Exception as error:
            future.set_exception(error)
        return future

    def close(self) -> None:
        pass


@pytest.fixture
def recordings(tmp_path: Path) -> Path:
    """Two drives, one that cannot be mapped, and a file that is no recording."""
    folder = tmp_path / "recordings"
    folder.mkdir()
    for name in ("monday", "tuesday"):
        write_drive(folder / name, frames=4)
    (folder / "broken").mkdir()
    (folder / "broken" / "depth.txt").touch()
    (folder / "notes.txt").write_text("none")
    return folder


def states(results: list[Result]) -> dict[str, str]:
    return {result.job.name: result.state for result in results}


def test_each_recording_of_a_folder_is_mapped_and_one_that_fails_leaves_the_others(
    recordings: Path, tmp_path: Path
) -> None:
    results = run_batch(jobs_in(recordings), tmp_path / "out", Here())
    assert states(results) == {"broken": "failed", "monday": "done", "tuesday": "done"}
    assert "depth.txt: the list is empty" in results[0].error
    path = recordings / "monday"
    origin = DetectionOrigin(file=path / "detections.json")
    alone = map_recording(open_recording(path), origin.open(), jobs_in(recordings)[1].config)
    save_map(alone, tmp_path / "alone.hmap")
    made = (tmp_path / "out" / "monday.hmap").read_bytes()
    assert made == (tmp_path / "alone.hmap").read_bytes()


def test_poses_that_drift_are_corrected_as_by_map(recordings: Path, tmp_path: Path) -> None:
    (job, _) = jobs_in(recordings, {"correct_poses": "auto"})[1:]
    assert key_of(job) != key_of(jobs_in(recordings)[1])
    (result,) = run_batch([job], tmp_path / "out", Here())
    assert result.state == "done"
    corrections = open_map(tmp_path / "out" / "monday.hmap").metadata["pose_corrections"]
    assert corrections == correct_poses(open_recording(job.recording)).summary()


@pytest.mark.parametrize(
    ("way", "message"),
    [("grap", r"unknown way 'grap'; did you mean 'graph'"), ("map", "no occupancy map is known")],
)
def test_a_wrong_way_to_correct_poses_is_refused(recordings: Path, way: str, message: str) -> None:
    with pytest.raises(HypermapError, match=rf"job 1: correct_poses.*{message}"):
        jobs_in(recordings, {"correct_poses": way})


def test_only_what_has_changed_is_done_again(recordings: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    first = run_batch(jobs_in(recordings), out, Here())
    again = run_batch(jobs_in(recordings), out, Here())
    assert states(again) == {"broken": "failed", "monday": "unchanged", "tuesday": "unchanged"}
    assert again[1].figures == first[1].figures
    (out / "tuesday.hmap").unlink()
    (recordings / "monday" / "rgb.txt").write_text(
        (recordings / "monday" / "rgb.txt").read_text() + "# changed\n"
    )
    states_now = states(run_batch(jobs_in(recordings), out, Here()))
    assert states_now == {"broken": "failed", "monday": "done", "tuesday": "done"}


def test_the_key_of_a_job_is_of_all_that_its_map_depends_on(recordings: Path) -> None:
    job = jobs_in(recordings)[1]
    (other,) = swept([job], ["evidence.loss=0.123"])
    assert key_of(other) != key_of(job) == key_of(dataclasses.replace(job, name="another"))
    assert key_of(dataclasses.replace(job, objects=False)) != key_of(job)
    assert key_of(dataclasses.replace(job, truth=recordings / "notes.txt")) != key_of(job)


def test_a_worker_that_is_killed_does_not_end_a_batch(recordings: Path, tmp_path: Path) -> None:
    with Processes(1) as workers:
        os.kill(workers.pids[0], signal.SIGKILL)
        results = run_batch(jobs_in(recordings)[1:], tmp_path / "out", workers)
    assert states(results) == {"monday": "done", "tuesday": "done"}


def test_a_batch_that_is_stopped_goes_on_with_the_rest(recordings: Path, tmp_path: Path) -> None:
    out, ended = tmp_path / "out", [0]

    def count(_result: Result) -> None:
        ended[0] += 1

    jobs = jobs_in(recordings)[1:]
    stopped = run_batch(jobs, out, Here(), count, lambda: ended[0] == 1)
    assert sorted(states(stopped).values()) == ["done", "not begun"]
    assert len(list(out.glob("*.hmap"))) == 1
    assert sorted(states(run_batch(jobs, out, Here())).values()) == ["done", "unchanged"]


def test_settings_vary_in_each_combination(recordings: Path) -> None:
    jobs = swept(jobs_in(recordings)[:1], ["evidence.loss=0.1,0.2", "evidence.fusion=votes"])
    assert [job.name for job in jobs] == [
        "broken@evidence.loss=0.1,evidence.fusion=votes",
        "broken@evidence.loss=0.2,evidence.fusion=votes",
    ]
    assert [job.config.evidence.loss for job in jobs] == [0.1, 0.2]


def test_the_table_says_what_became_of_each_job(recordings: Path, tmp_path: Path) -> None:
    job = jobs_in(recordings)[1]
    results = run_batch([job], tmp_path / "out", Here())
    truth = tmp_path / "out" / "monday.hmap"  # a map is like itself
    jobs = swept([dataclasses.replace(job, truth=truth)], ["evidence.loss=0.1,0.2"])
    results = run_batch([*jobs, jobs_in(recordings)[0]], tmp_path / "other", Here())
    write_tables(results, tmp_path / "other")
    rows = list(csv.DictReader((tmp_path / "other" / "results.csv").read_text().splitlines()))
    assert [row["evidence.loss"] for row in rows] == ["0.1", "0.2", ""]
    assert [row["f1"] for row in rows] == ["1.0", "1.0", ""]
    assert float(rows[0]["frames_per_second"]) > 0
    assert json.loads((tmp_path / "other" / "results.json").read_text())[2]["state"] == "failed"
    page = (tmp_path / "other" / "results.html").read_text()
    assert "2 done, 1 failed" in page
    assert '<tr class="failed">' in page


def test_a_jobs_file_says_how_each_recording_is_mapped(recordings: Path, tmp_path: Path) -> None:
    (recordings / "lower.yaml").write_text("evidence: {loss: 0.05}\n")
    content = {
        "profile": "thesis",
        "jobs": [
            {"recording": "monday", "options": {"every": 2, "intrinsics": [100, 100, 80, 60]}},
            {"recording": "tuesday", "name": "no objects", "objects": False, "profile": "default"},
            {"recording": "tuesday", "config": "lower.yaml", "detector": "yolox-nano"},
        ],
    }
    (recordings / "jobs.yaml").write_text(yaml.safe_dump(content))
    first, second, third = jobs_in(recordings / "jobs.yaml")
    assert first.config.evidence.association == "jaccard"
    assert first.recording == recordings / "monday"
    assert (first.options.every, first.options.intrinsics) == (2, (100, 100, 80, 60))
    assert (second.name, second.objects) == ("no_objects", False)
    assert second.config.evidence.association != "jaccard"
    assert (third.config.evidence.loss, third.detector) == (0.05, "yolox-nano")
    (done,) = run_batch([second], tmp_path / "out", Here())
    assert [layer.name for layer in open_map(tmp_path / "out" / "no_objects.hmap")] == ["occupancy"]
    assert np.isfinite(done.figures["seconds"])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("jobs: []", "jobs: there are no jobs"),
        ("recordings: [a]", "expected a list `jobs:`"),
        ("jobs: [monday]", "job 1: expected `recording: PATH`"),
        ("jobs: [{recording: monday, detecter: x}]", "job 1: unknown key 'detecter'; did you mean"),
        ("jobs: [{recording: 3}]", "job 1: recording: expected a text, found 3"),
        ("jobs: [{recording: null}]", "job 1: expected `recording: PATH`"),
        (f"jobs: [{{recording: {'a' * 300}}}]", "job 1: recording: no file can have this name"),
        ('jobs: [{recording: a, config: "\\0"}]', "job 1: config: no file can have this name"),
        ('jobs: [{recording: a, detector: "\\0"}]', "job 1: detector: no file can have"),
        (f"jobs: [{{recording: a, options: {{depth_scale: {10**400}}}}}]", "depth_scale must be"),
        ("jobs: [{recording: a, objects: 1}]", "job 1: objects: expected true or false"),
        ("jobs: [{recording: a, profile: best}]", "job 1: profile: there is no profile 'best'"),
        ("jobs: [{recording: a, options: {evry: 2}}]", "unknown key 'evry'; did you mean 'every'?"),
        ("jobs: [{recording: a, options: {every: 0}}]", "every must be at least 1"),
        ("jobs: [{recording: a, config: none.yaml}]", "none.yaml: there is no such configuration"),
        ("profil: thesis\njobs: [{recording: a}]", "for all jobs: unknown key 'profil'"),
        ("jobs: [{recording: a}, {recording: b, name: A}]", "two jobs would write A.hmap"),
    ],
)
def test_what_is_wrong_in_a_jobs_file_is_said(tmp_path: Path, content: str, message: str) -> None:
    (tmp_path / "jobs.yaml").write_text(content)
    with pytest.raises(HypermapError) as caught:
        jobs_in(tmp_path / "jobs.yaml")
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("sweeps", "message"),
    [
        (["evidence.los=1"], "--set evidence.los: unknown key; did you mean 'loss'?"),
        (["evidnce.loss=1"], "--set evidnce: unknown key; did you mean 'evidence'?"),
        (["evidence.loss=high"], "--set evidence.loss: must be a number; found 'high'"),
        (["loss=0.1"], "expected STAGE.KEY=VALUE"),
        (["evidence.loss=0.1", "evidence.loss=0.2"], "given twice"),
    ],
)
def test_settings_that_cannot_vary_so_are_refused(
    recordings: Path, sweeps: list[str], message: str
) -> None:
    with pytest.raises(HypermapError) as caught:
        swept(jobs_in(recordings), sweeps)
    assert message in str(caught.value)


def test_one_recording_is_one_job(recordings: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bag = recordings / "bag"
    bag.mkdir()
    for name in ("metadata.yaml", "bag_0.db3", "bag_1.db3"):
        (bag / name).touch()
    monkeypatch.chdir(recordings / "monday")
    for source, name in ((".", "monday"), ("../bag", "bag"), ("../bag/bag_0.db3", "bag_0")):
        [job] = jobs_in(Path(source))
        assert (job.name, job.recording) == (name, Path(source))
    (bag / "metadata.yaml").unlink()
    assert [job.name for job in jobs_in(bag)] == ["bag_0", "bag_1"]


def test_an_empty_folder_is_no_batch(tmp_path: Path) -> None:
    with pytest.raises(HypermapError, match="there is no recording in this folder"):
        jobs_in(tmp_path)


def test_a_map_that_cannot_be_saved_ends_the_batch(
    recordings: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(path: Path, content: bytes) -> None:
        raise HypermapError(f"{path}: No space left on device")

    monkeypatch.setattr("hypermap.fleet.batch.batch.write_file", full)
    with pytest.raises(HypermapError, match="No space left"):
        run_batch(jobs_in(recordings)[1:], tmp_path / "out", Here())
    assert list((tmp_path / "out").iterdir()) == []
