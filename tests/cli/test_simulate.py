"""`hypermap simulate`, from a world file to a map of the recording."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest
from rosbags.rosbag1 import Reader

from hypermap.formats import open_map
from hypermap.recordings import open_recording

from ..prepared import run

WORLD = """
name: studio
floor: {rectangle: [0, 0, 5, 4]}
walls: [{rectangle: [-0.05, -0.05, 5.05, 4.05]}]
objects: [{model: table, at: [3.2, 2]}, {model: chair, at: [2.2, 3.2], yaw_deg: -60}]
drive: {waypoints: [[0.5, 1], [1.2, 1.6, 30]], speed: 0.5}
"""


@pytest.fixture
def world(tmp_path: Path) -> Path:
    path = tmp_path / "studio.yaml"
    path.write_text(WORLD, encoding="utf-8")
    return path


def hypermap(*words: str | Path) -> subprocess.CompletedProcess[str]:
    return run(*words)


def test_a_folder_can_be_mapped_and_compared_with_the_truth(world: Path, tmp_path: Path) -> None:
    out = tmp_path / "studio"
    done = hypermap("simulate", world, "-o", out, "--errors", "none", "--rate", "2")
    assert done.returncode == 0, done.stderr
    assert "2 objects" in done.stdout
    detections = out / "detections.json"
    mapped = hypermap("map", out, "--detections", detections, "-o", tmp_path / "m.hmap")
    assert mapped.returncode == 0, mapped.stderr
    score = hypermap("evaluate", tmp_path / "m.hmap", out / "truth.hmap", "--json")
    assert score.returncode == 0, score.stderr
    assert json.loads(score.stdout)
    truth = open_map(out / "truth.hmap")
    assert sorted(thing.name for thing in truth["semantic"].objects()) == ["chair", "table"]
    assert truth.metadata["world"] == "studio"


def test_another_day_has_other_things_and_later_stamps(world: Path, tmp_path: Path) -> None:
    out = tmp_path / "tuesday"
    done = hypermap(
        "simulate", world, "-o", out, "--rate", "1", "--start", "2026-11-24T08:00Z", "--day", "2"
    )
    assert done.returncode == 0, done.stderr
    assert "since day 1  " in done.stdout
    stamps = [frame.stamp for frame in open_recording(out).frames()]
    assert stamps[0] == 1795507200.0
    assert stamps[-1] > stamps[0]
    truth = open_map(out / "truth.hmap")["semantic"].objects()
    (table,) = (thing for thing in truth if thing.name == "table")
    told = [line for line in done.stdout.splitlines() if "table" in line and "moved" in line]
    x, y = table.footprint.centroid.coords[0]
    assert bool(told) == (abs(x - 3.2) > 0.01 or abs(y - 2) > 0.01)
    wrong = hypermap("simulate", world, "-o", tmp_path / "w", "--start", "someday")
    assert wrong.returncode == 2
    assert "--start 'someday': expected a time" in wrong.stderr


@pytest.mark.parametrize("name", ["drive", "drive.bag"])
def test_bad_frames_are_reported_and_the_rest_is_mapped(
    world: Path, tmp_path: Path, name: str
) -> None:
    out = tmp_path / name
    done = hypermap(
        "simulate", world, "-o", out, "--bad-frames", "0.4", "--rate", "5", "--seed", "9"
    )
    assert done.returncode == 0, done.stderr
    assert "bad frames " in done.stdout
    assert "2 infinite" in done.stdout
    assert "1 saturated" in done.stdout
    mapped = hypermap("map", out, "-o", tmp_path / "m.hmap")
    assert mapped.returncode == 0, mapped.stderr
    assert "left out" in mapped.stderr
    assert len(open_map(tmp_path / "m.hmap").layers) == 2


def test_a_bag_of_large_images_with_errors_from_a_file(world: Path, tmp_path: Path) -> None:
    errors = tmp_path / "errors.yaml"
    errors.write_text("poses: {drift: 0.1}\ndetector: {miss: 1.0}\n", encoding="utf-8")
    out = tmp_path / "studio.bag"
    done = hypermap(
        "simulate", world, "-o", out, "--image-size", "640x480", "--rate", "1", "--errors", errors
    )
    assert done.returncode == 0, done.stderr
    frame = next(open_recording(out).frames())
    assert frame.depth.shape == (480, 640)
    # The same view as at half the size: a pixel's corner stays where it was.
    assert frame.camera.K[0].tolist() == [525, 0, 319.5]
    assert not len(frame.detections.names)
    assert open_map(tmp_path / "studio.truth.hmap")["semantic"]
    with Reader(out) as bag:  # as SLAM has its topic, so that `rosbag play` plays it so
        latched = [each.topic for each in bag.connections if each.ext.latching]
    assert latched == ["/map"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["ofice"], "there is no world 'ofice'; did you mean 'office'?; or name a world file"),
        (["still.yaml"], "still.yaml: drive: is missing, so there is nothing to record"),
        (["nowhere.yaml"], "nowhere.yaml: there is no such world file"),
        (["demo", "--errors", "robt"], "there is no level of errors 'robt'"),
        (["demo", "--sensor", "kinect"], "there is no preset of a depth camera 'kinect'; did you"),
        (["demo", "--image-size", "1x1"], "--image-size 1x1: images are 320x240 or 640x480"),
        (["demo", "--errors", "e.yaml"], "e.yaml: detector.mis: unknown key; did you mean 'miss'?"),
    ],
)
def test_what_cannot_be_simulated_is_said(
    options: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("e.yaml").write_text("detector: {mis: 1}", encoding="utf-8")
    Path("still.yaml").write_text("".join(WORLD.splitlines(True)[:-1]), encoding="utf-8")
    done = hypermap("simulate", *options, "-o", "out")
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert not Path("out").exists()


def test_an_existing_recording_is_kept(world: Path, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    done = hypermap("simulate", world, "-o", tmp_path / "out")
    assert done.returncode == 2
    assert "out exists already; name a new one" in done.stderr
