"""Poses that `hypermap map` corrects: by a known map, by a graph, or not at all."""

from __future__ import annotations

import re
import shutil
import signal

import numpy as np
import pytest

from hypermap.cli.corrected_poses import PoseCorrection
from hypermap.perception.recording import SameRecording
from hypermap.recordings import RecordingOptions, open_recording

from .conftest import INTRINSICS, assert_one_error, write_drive


def test_it_is_reported_that_poses_are_not_corrected(hypermap, drive, room_map, tmp_path):
    given, out = tmp_path / "given.yaml", tmp_path / "out.hmap"
    assert hypermap("convert", room_map, given, "--layer", "occupancy").code == 0
    reported = "poses were used as recorded; if they drift, --correct-poses graph corrects them"
    common = ["map", drive, "--intrinsics", INTRINSICS, "-o", out]
    assert reported in hypermap(*common).err
    assert reported not in hypermap(*common, "--map", given).err
    assert reported not in hypermap(*common, "--profile", "thesis").err  # which corrects none
    assert reported not in hypermap(*common, "--correct-poses", "none").err  # as they are asked to
    by_none = hypermap(*common, "--map", given, "--correct-poses", "none")
    assert "corrected by the map" not in by_none.err
    by_either = hypermap(*common, "--map", given, "--correct-poses", "auto")
    assert "corrected by the map" in by_either.err


def test_poses_are_corrected_without_a_map(hypermap, tmp_path):
    """The poses say that the camera moves toward the wall; all images are the same."""
    drive, out = write_drive(tmp_path / "drive", frames=6), tmp_path / "out.hmap"
    stamps = [line.split()[0] for line in (drive / "depth.txt").read_text().splitlines()]
    poses = [f"{stamp} {0.12 * i} 0 1 -0.5 0.5 -0.5 0.5" for i, stamp in enumerate(stamps)]
    (drive / "groundtruth.txt").write_text("\n".join(poses) + "\n")
    saved = tmp_path / "corrected.txt"
    arguments = ["map", drive, "--intrinsics", INTRINSICS, "-o", out, "--save-poses", saved]
    made = hypermap(*arguments, "--correct-poses", "auto")
    assert made.code == 0
    assert "poses: 5 of 6 corrected by a pose graph, by 36.0 cm" in made.err
    assert f"saved {saved}" in made.err
    metadata = hypermap("info", out, "--json").json["metadata"]
    assert metadata["poses"] == "corrected by a pose graph"
    assert metadata["pose_corrections"]["most_m"] == pytest.approx(0.6, abs=0.02)
    positions = np.loadtxt(saved)[:, 1]
    assert positions == pytest.approx(np.zeros(6), abs=0.02)
    assert "5 skipped because the camera had hardly moved" in made.err
    again = hypermap(*arguments, "--correct-poses", "graph")
    assert again.code == 2
    assert again.err.endswith("corrected.txt exists already; give --force to replace it\n")


@pytest.mark.parametrize(
    ("saved", "said"),
    [
        ("out.hmap", "the map is saved there"),
        ("drive/groundtruth.txt", "this is a file of"),
        ("drive", "drive, which is read"),
        ("before.hmap", "before.hmap, which is read"),
    ],
)
def test_corrected_poses_replace_no_other_file(hypermap, drive, tmp_path, saved, said):
    out, before = tmp_path / "out.hmap", tmp_path / "before.hmap"
    recording, common = tmp_path / "drive", ["--intrinsics", INTRINSICS, "--no-objects"]
    shutil.copytree(drive, recording)
    if saved == before.name:
        assert hypermap("map", recording, *common, "-o", before).code == 0
        common += ["--onto", before]
    kept = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    graph = ["--correct-poses", "graph", "--save-poses", tmp_path / saved, "--force"]
    assert_one_error(hypermap("map", recording, *common, *graph, "-o", out), "--save-poses", said)
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == kept


def test_another_drive_does_not_tell_of_corrections_of_the_first(hypermap, tmp_path):
    drives = [write_drive(tmp_path / name, frames=4) for name in "ab"]
    lists = [drives[1] / name for name in ("depth.txt", "rgb.txt", "groundtruth.txt")]
    for file in lists:  # a second drive, later than the first
        file.write_text(file.read_text().replace("100.", "200."))
    first, both = tmp_path / "first.hmap", tmp_path / "both.hmap"
    common = ["map", "--no-objects", "--intrinsics", INTRINSICS]
    graph = hypermap(*common, drives[0], "--correct-poses", "graph", "-o", first)
    assert "no frames could be matched" in graph.err
    assert "pose_corrections" in hypermap("info", first, "--json").json["metadata"]
    more = hypermap(*common, drives[1], "--onto", first, "-o", both)
    assert more.code == 0
    assert "pose_corrections" not in hypermap("info", both, "--json").json["metadata"]


def test_each_drive_onto_a_known_map_may_be_corrected_in_another_way(hypermap, room_map, tmp_path):
    given, out = tmp_path / "given.yaml", tmp_path / "out.hmap"
    assert hypermap("convert", room_map, given, "--layer", "occupancy").code == 0
    drives = [write_drive(tmp_path / name, frames=2) for name in "abc"]
    for folder, hundreds in zip(drives[1:], ("200.", "300."), strict=True):
        for name in ("depth.txt", "rgb.txt", "groundtruth.txt"):
            file = folder / name
            file.write_text(file.read_text().replace("100.", hundreds))
    common = ["map", "--no-objects", "--intrinsics", INTRINSICS, "-o", out]
    assert hypermap(*common, drives[0], "--map", given).code == 0
    common += ["--onto", out, "--same-place"]  # what they show is none of the known map
    by_graph = hypermap(*common, drives[1], "--correct-poses", "graph")
    assert by_graph.code == 0, by_graph.err
    assert "poses: 0 of 2 corrected by a pose graph" in by_graph.err
    by_map = hypermap(*common, drives[2], "--correct-poses", "map")
    assert by_map.code == 0, by_map.err
    assert "corrected by the map" in by_map.err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--correct-poses", "grap"], "--correct-poses grap: did you mean 'graph'?"),
        (["--correct-poses", "map"], "no occupancy map is known; give --map, or correct by graph"),
        (["--save-poses", "x.txt"], "--save-poses: needs --correct-poses graph"),
    ],
)
def test_poses_cannot_be_corrected_by_what_is_not_there(
    hypermap, drive, tmp_path, arguments, message
):
    common = ["map", drive, "--intrinsics", INTRINSICS, "-o", tmp_path / "out.hmap"]
    assert_one_error(hypermap(*common, *arguments), message)


class EndedByUser(SameRecording):
    """A recording during whose third frame somebody presses Ctrl-C."""

    def frames(self, on_bad=None):
        for number, frame in enumerate(self._recording.frames(on_bad)):
            if number == 2:
                signal.raise_signal(signal.SIGINT)
            yield frame

    def pending(self, on_bad=None):
        yield from self._recording.pending(on_bad)


def test_who_ends_the_correction_of_poses_gets_the_map_of_what_was_read(drive, tmp_path, capsys):
    recording = EndedByUser(open_recording(drive, RecordingOptions(intrinsics=(525, 525, 80, 60))))
    correction = PoseCorrection("graph", tmp_path / "poses.txt", has_map=False)
    job = correction.corrected(recording)
    assert job.stop.exit_code == 130
    assert (
        "mapping the 2 frames whose poses were corrected before Ctrl-C" in capsys.readouterr().err
    )
    assert len(np.loadtxt(tmp_path / "poses.txt")) == 2
    stamps = [frame.stamp for frame in job.recording.pending()]
    assert stamps == list(job.poses.poses)
    assert job.until == stamps[-1]


def test_a_given_map_lies_in_the_frame_of_the_recording(hypermap, drive, room_map, tmp_path):
    given, out = tmp_path / "given.yaml", tmp_path / "out.hmap"
    assert hypermap("convert", room_map, given, "--layer", "occupancy").code == 0
    arguments = ["--intrinsics", INTRINSICS, "--map-frame", "hall", "--map", given, "-o", out]
    made = hypermap("map", drive, *arguments)
    assert made.code == 0
    assert re.search(r"poses: 0 of 6 corrected by the map; \d+ as recorded: ", made.err)
    described = hypermap("info", out, "--json").json
    assert sum(described["metadata"]["pose_corrections"]["as_recorded"].values()) == 6
    layers = described["layers"]
    assert [layer["frame_id"] for layer in layers] == ["hall", "hall"]


def test_a_given_map_of_another_place_is_warned_of(hypermap, drive, room_map, tmp_path):
    given = tmp_path / "given.yaml"
    assert hypermap("convert", room_map, given, "--layer", "occupancy").code == 0
    text = given.read_text()
    warning = "warning: the map has no border of free space near any place of the camera; is it"
    for origin, is_warned in (("[500000, 5400000, 0]", True), (None, False)):
        moved = re.sub(r"origin:.*(\n- .*)*", f"origin: {origin}", text) if origin else text
        given.write_text(moved)
        arguments = ["--intrinsics", INTRINSICS, "--map", given, "-o", tmp_path / "out.hmap"]
        made = hypermap("map", drive, *arguments)
        assert made.code == 0
        assert (warning in made.err) == is_warned
