from __future__ import annotations

import json
import re
import shlex
import shutil
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from hypermap.cli.corrected_poses import PoseCorrection
from hypermap.cli.recording_options import OPTIONS
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.formats import open_map, save_map
from hypermap.perception.frame import Camera
from hypermap.perception.recording import SameRecording
from hypermap.recordings import RecordingOptions, open_recording
from hypermap.simulation import SimulatedRecording, demo_world, write_tum
from hypermap.testing import square
from hypermap.viewer.live.document import MapDocument

from .conftest import INTRINSICS, answered, assert_one_error, objects_in, write_drive

SMALL = Camera.from_intrinsics(131.25, 131.25, 79.5, 59.5, width=160, height=120)


def test_a_recording_becomes_a_map_that_holds_what_it_shows(hypermap, drive, tmp_path):
    out = tmp_path / "out.hmap"
    result = hypermap("map", drive, "--intrinsics", INTRINSICS, "-o", out)
    assert result.code == 0
    assert result.out == ""
    assert f"taking detections from {drive / 'detections.json'}" in result.err
    assert "6 used, 0 skipped" in result.err
    assert "1 object: 1 chair" in result.err
    assert f"saved {out}" in result.err
    assert f"hypermap view {out}\n" in result.err
    assert f"hypermap query {out} --name chair --nearest\n" in result.err
    [(name, x, y)] = objects_in(out)
    assert name == "chair"
    assert (x, y) == pytest.approx((1.5, 0.0), abs=0.1)
    wall = hypermap("query", out, "--layer", "occupancy", "--in", "2.4,0.5,2.6,1").out
    assert "Occupied" in wall


def test_the_configuration_in_force_is_saved_with_the_map(hypermap, drive, tmp_path):
    config, out = tmp_path / "config.yaml", tmp_path / "out.hmap"
    config.write_text("evidence: {loss: 0.3}\n")
    arguments = ["--intrinsics", INTRINSICS, "--profile", "thesis", "--config", config, "-o", out]
    assert hypermap("map", drive, *arguments).code == 0
    made_with = hypermap("info", out, "--json").json["metadata"]["config"]
    assert made_with["evidence"]["loss"] == 0.3
    assert made_with["evidence"]["association"] == "jaccard"


def test_detections_may_come_from_a_file(hypermap, tmp_path):
    drive = write_drive(tmp_path / "drive", frames=4)
    elsewhere = (drive / "detections.json").rename(tmp_path / "boxes.json")
    out = tmp_path / "out.hmap"
    arguments = ["--detections", elsewhere, "--intrinsics", INTRINSICS, "-o", out]
    assert hypermap("map", drive, *arguments).code == 0
    assert [name for name, _, _ in objects_in(out)] == ["chair"]


def test_a_given_occupancy_map_becomes_the_first_layer(hypermap, drive, room_map, tmp_path):
    given, out = tmp_path / "given.yaml", tmp_path / "out.hmap"
    assert hypermap("convert", room_map, given, "--layer", "occupancy").code == 0
    arguments = ["--map", given, "--intrinsics", INTRINSICS, "-o", out]
    assert hypermap("map", drive, *arguments).code == 0
    first = hypermap("info", out, "--json").json["layers"][0]
    assert (first["name"], first["width"], first["height"]) == ("occupancy", 30, 20)


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
    by_graph = hypermap(*common, drives[1], "--onto", out, "--correct-poses", "graph")
    assert by_graph.code == 0, by_graph.err
    assert "poses: 0 of 2 corrected by a pose graph" in by_graph.err
    by_map = hypermap(*common, drives[2], "--onto", out, "--correct-poses", "map")
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


def test_an_output_that_exists_is_replaced_and_stays_beside_it(hypermap, drive, tmp_path):
    out = tmp_path / "out.hmap"
    out.write_text("an older map")
    arguments = ["map", drive, "--intrinsics", INTRINSICS, "-o", out]
    result = hypermap(*arguments)
    assert result.code == 0
    assert f"the previous map is kept as {out}.bak" in result.err
    assert (tmp_path / "out.hmap.bak").read_text() == "an older map"
    assert len(objects_in(out)) == 1
    made = out.read_bytes()
    assert hypermap(*arguments, "--drop-evidence").code == 0  # it can be made again: none asks
    assert (tmp_path / "out.hmap.bak").read_bytes() == made


def edited(path: Path) -> None:
    """Rename an object, as someone does on the page, and save the map."""
    document = MapDocument(path)
    (item,) = document.current.hypermap["semantic"].objects()  # type: ignore[attr-defined]
    document.edit(
        document.current.version,
        lambda draft: draft.update("semantic", item.id, replace(item, name="throne")),
    )
    document.save()


def drawn(path: Path) -> None:
    """Save a map that was never made of a recording."""
    save_map(Hypermap([SemanticLayer("semantic", "map", [square("zone", 0, 0)])]), path)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (edited, "it was edited by hand, with hypermap view"),
        (drawn, "it was not made by mapping"),
    ],
)
def test_what_people_have_made_is_replaced_only_on_a_second_word(
    hypermap, drive, tmp_path, monkeypatch, change, reason
):
    out, backup = tmp_path / "out.hmap", tmp_path / "out.hmap.bak"
    arguments = ["map", drive, "--intrinsics", INTRINSICS, "-o", out]
    assert hypermap(*arguments).code == 0
    change(out)
    precious = out.read_bytes()
    reported = f"{out} exists already, and {reason}"
    assert_one_error(hypermap(*arguments), reported, "give --force to replace it", "out.hmap.bak")
    topics = ["--depth-topic", "/depth", "--detections-topic", "/boxes"]
    assert_one_error(hypermap("live", *topics, "-o", out), reported)
    assert out.read_bytes() == precious
    assert hypermap(*arguments, "--force").code == 0
    assert backup.read_bytes() == precious
    # A backup that no one could make again outlives a map that anyone can.
    assert hypermap(*arguments).code == 0
    assert backup.read_bytes() == precious


@pytest.mark.parametrize("reader", ["2>&1 | true", "2>&1 | head -1", "2>/dev/full"])
def test_a_map_is_saved_though_nobody_reads_the_notes(drive, tmp_path, reader):
    output = tmp_path / "out.hmap"
    command = [sys.executable, "-m", "hypermap", "map", str(drive), "-o", str(output)]
    subprocess.run(
        ["bash", "-c", f"{shlex.join(command)} {reader}"], check=True, capture_output=True
    )
    assert len(open_map(output).layers) == 2


@pytest.mark.parametrize(
    ("answer", "code", "name"), [("n\n", 2, "zone"), ("y\n", 0, "chair"), ("\x04", 130, "zone")]
)
def test_at_a_terminal_it_is_asked(drive, tmp_path, answer, code, name):
    out = tmp_path / "out.hmap"
    drawn(out)
    command = [sys.executable, "-m", "hypermap", "map", drive, "--intrinsics", INTRINSICS]
    ended, said = answered([*command, "-o", out], answer)
    assert ended == code, said
    assert b"it was not made by mapping. Replace it? It stays as out.hmap.bak." in said
    assert (tmp_path / "out.hmap.bak").exists() == (code == 0)
    assert [each for each, _, _ in objects_in(out)] == [name]


def test_a_failure_leaves_the_old_output(hypermap, drive, tmp_path):
    out = tmp_path / "out.hmap"
    out.write_text("precious")
    (tmp_path / "bad.json").write_text("{")
    result = hypermap("map", drive, "--detections", tmp_path / "bad.json", "-o", out)
    assert_one_error(result, "bad.json")
    assert out.read_text() == "precious"


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["-o", "out.zip"], "out.zip: a map is saved as .hmap"),
        (["-o", "nowhere/out.hmap"], "does not exist; create it first"),
        (["--detector", "a.onnx", "--detections", "b.json"], "either --detector or --detections"),
        (["--no-objects", "--detector", "a.onnx"], "--no-objects leaves no work for --detector"),
        (["--labels", "names.txt"], "--labels needs --detector"),
        (["--detector", "a.onnx"], "a.onnx"),
        (["--detections", "b.json"], "b.json: there is no such file"),
        (["--map", "m.yaml"], "m.yaml"),
        (["--config", "c.yaml"], "c.yaml: there is no such configuration file"),
        (["--every", "0"], "--every must be at least 1, got 0"),
        (["--intrinsics", "1,2,3"], "--intrinsics must be 4 numbers (fx, fy, cx, cy), got 3"),
        (["--intrinsics", "1,2,3,x"], "--intrinsics '1,2,3,x': expected numbers FX,FY,CX,CY"),
        (["--world-transform", "1,2"], "--world-transform must be 6 numbers"),
        (["--max-time-difference", "5"], "--max-time-difference must be 0 .. 1 s"),
    ],
)
def test_bad_options_are_said_so(hypermap, drive, tmp_path, monkeypatch, arguments, reason):
    monkeypatch.chdir(tmp_path)
    output = [] if "-o" in arguments else ["-o", "out.hmap"]
    assert_one_error(hypermap("map", drive, *arguments, *output), reason)
    assert list(tmp_path.iterdir()) == []


def test_without_detections_the_three_choices_are_reported(hypermap, tmp_path):
    drive = write_drive(tmp_path / "drive", frames=2, has_detections=False)
    result = hypermap("map", drive, "-o", tmp_path / "out.hmap")
    assert_one_error(
        result,
        "--detector MODEL.onnx",
        "hypermap detectors get yolox-nano",
        "--detections FILE",
        "detections.json",
        "--no-objects",
    )


def test_a_map_of_the_occupancy_alone_needs_no_detections(hypermap, tmp_path):
    drive = write_drive(tmp_path / "drive", frames=4, has_detections=False)
    out = tmp_path / "out.hmap"
    result = hypermap("map", drive, "--no-objects", "--intrinsics", INTRINSICS, "-o", out)
    assert result.code == 0
    assert f"saved {out}" in result.err
    assert "0 objects" not in result.err.partition("used")[2]
    assert [layer["name"] for layer in hypermap("info", out, "--json").json["layers"]] == [
        "occupancy"
    ]
    wall = hypermap("query", out, "--layer", "occupancy", "--in", "2.4,0.5,2.6,1").out
    assert "Occupied" in wall


def test_with_objects_the_occupancy_is_the_same_as_alone(hypermap, drive, tmp_path):
    both, alone = tmp_path / "both.hmap", tmp_path / "alone.hmap"
    assert hypermap("map", drive, "--intrinsics", INTRINSICS, "-o", both).code == 0
    assert hypermap("map", drive, "--no-objects", "--intrinsics", INTRINSICS, "-o", alone).code == 0
    one, other = (open_map(path)["occupancy"].cells for path in (both, alone))
    np.testing.assert_array_equal(one, other)


def spoil(drive: Path, line: int, fault: str) -> Path:
    """Give one line of a drive's depth.txt an image that cannot be used, and return its path."""
    bad = drive / "bad.png"
    whole = (drive / "depth.png").read_bytes()
    if fault == "another size":
        Image.fromarray(np.full((10, 20), 1000, np.uint16)).save(bad)
    elif fault != "missing":
        bad.write_bytes(whole[: int(float(fault) * len(whole))])
    lines = (drive / "depth.txt").read_text().splitlines()
    lines[line] = lines[line].replace("depth.png", bad.name)
    (drive / "depth.txt").write_text("\n".join(lines))
    return bad


@pytest.mark.parametrize("fault", ["0.0", "0.01", "0.9", "missing", "another size"])
@pytest.mark.parametrize("line", [0, 2])
def test_an_image_that_cannot_be_used_is_left_out_and_named(hypermap, tmp_path, fault, line):
    drive, out = write_drive(tmp_path / "drive", frames=4), tmp_path / "out.hmap"
    bad = spoil(drive, line, fault)
    arguments = ["map", drive, "--intrinsics", INTRINSICS, "-o", out]
    result = hypermap(*arguments)
    assert result.code == 0
    assert f" left out: {bad}: " in result.err
    assert "1 unusable" in result.err
    assert open_map(out).metadata["frames"]["unusable"] == 1
    assert objects_in(out)
    out.unlink()
    for strict in (["--strict"], ["--max-bad", "0.1"]):
        result = hypermap(*arguments, *strict)
        assert result.code == 2
        last = result.err.splitlines()[-1]
        assert last.startswith("hypermap: error: ")
        assert str(bad) in last
        assert not out.exists()


def test_depth_in_a_wrong_unit_is_reported_with_its_likely_cause(hypermap, tmp_path):
    drive, out = write_drive(tmp_path / "drive", frames=3), tmp_path / "out.hmap"
    result = hypermap("map", drive, "--intrinsics", INTRINSICS, "--depth-scale", "1", "-o", out)
    assert result.code == 2
    last = result.err.splitlines()[-1]
    assert "nothing to map: none of 3 frames can be used; the first one: half of its" in last
    assert "--depth-scale" in last
    assert not out.exists()


def test_what_is_wrong_with_many_frames_alike_is_reported_once_with_their_number(
    hypermap, tmp_path
):
    drive, out = write_drive(tmp_path / "drive", frames=6), tmp_path / "out.hmap"
    for line in range(4):
        spoil(drive, line, "missing")
    arguments = ["map", drive, "--intrinsics", INTRINSICS, "--max-bad", "1", "-o", out]
    reported = hypermap(*arguments)
    assert reported.code == 0
    assert reported.err.count(" left out: ") == 1
    assert (
        "warning: 3 more frames were left out for the same reasons (-v lists them)" in reported.err
    )
    assert "4 unusable" in reported.err
    assert hypermap(*arguments, "-v").err.count(" left out: ") == 4
    wrong_unit = hypermap(*arguments, "--depth-scale", "1")
    assert wrong_unit.err.count("half of its depth is beyond") == 1


@pytest.mark.parametrize("name", ["cut.bag", "cut.mcap"])
def test_map_and_info_find_the_same_damage(hypermap, tmp_path, name):
    bag = tmp_path / name
    bag.write_bytes(b"#ROSBAG V2.0\nE\x00" if name == "cut.bag" else b"\x89MCAP0\r\n\x01\x00")
    (missing,) = hypermap("info", bag, "--json").json["missing"]
    assert "cannot be read" in missing
    result = hypermap("map", bag, "-o", tmp_path / "out.hmap")
    assert_one_error(result, missing)


@pytest.mark.parametrize("kind", ["nothing", "a file", "an empty folder"])
def test_what_is_no_recording_is_said_so(hypermap, tmp_path, kind):
    path = tmp_path / "recording"
    if kind == "a file":
        path.write_text("hello")
    if kind == "an empty folder":
        path.mkdir()
    assert_one_error(hypermap("map", path, "-o", tmp_path / "out.hmap"), str(path))


def test_there_is_an_option_for_every_field_of_the_recording_options():
    fields = set(RecordingOptions.__dataclass_fields__)
    assert set(OPTIONS) == fields | {"level"}  # which is always measured


def as_from_a_terminal() -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def as_a_job_of_a_script() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@pytest.mark.parametrize(
    ("before", "numbers", "name"),
    [
        (as_from_a_terminal, [signal.SIGINT], "Ctrl-C"),
        # `timeout` sends it to its child and to the child's group.
        (as_from_a_terminal, [signal.SIGTERM, signal.SIGTERM], "SIGTERM"),
        (as_a_job_of_a_script, [signal.SIGINT, signal.SIGTERM], "SIGTERM"),
        (as_from_a_terminal, [signal.SIGHUP], "SIGHUP"),
    ],
)
def test_who_ends_it_early_gets_what_there_is(tmp_path, before, numbers, name):
    drive, out = write_drive(tmp_path / "drive", frames=3000), tmp_path / "out.hmap"
    command = [sys.executable, "-m", "hypermap", "map", drive, "-o", out]
    with subprocess.Popen(
        [*command, "--intrinsics", INTRINSICS],
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=before,
    ) as process:
        assert process.stderr is not None
        said = ""
        while "mapping: 1 of 3000 frames" not in said:
            line = process.stderr.readline()
            assert line, f"ended before the first frame: {said}"
            said += line
        for number in numbers:
            process.send_signal(number)
        said += process.stderr.read()
    assert process.returncode == 128 + numbers[-1]
    assert "stopping; saving the map so far" in said
    assert ("Ctrl-C again gives up" in said) == (name == "Ctrl-C")
    assert f"saved {out}" in said
    assert f"stopped early by {name}" in said
    assert "Traceback" not in said
    frames = open_map(out).metadata["frames"]
    assert 1 <= frames["used"] < 3000


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


def test_info_tells_what_a_recording_holds(hypermap, drive):
    result = hypermap("info", drive, "--intrinsics", INTRINSICS, "--json")
    assert result.code == 0
    content = result.json
    assert content["kind"] == "recording"
    assert content["path"] == str(drive)
    assert (content["frames"], content["image_size"]) == (6, [160, 120])
    assert content["missing"] == []
    assert {stream["name"] for stream in content["streams"]} >= {"depth.txt", "groundtruth.txt"}
    text = hypermap("info", drive).out
    assert "depth images" in text
    assert "TUM" in text


def test_info_tells_what_is_missing_and_still_ends_well(hypermap, tmp_path):
    drive = write_drive(tmp_path / "drive", frames=2)
    (drive / "groundtruth.txt").unlink()
    result = hypermap("info", drive)
    assert result.code == 0
    assert "missing: " in result.out
    assert "groundtruth.txt" in result.out
    assert hypermap("info", drive, "--json").json["missing"]


def test_a_real_recording_becomes_a_map(hypermap, shared_data, tmp_path):
    out = tmp_path / "desk.hmap"
    result = hypermap("map", shared_data / "desk", "--every", "12", "-o", out)
    assert result.code == 0
    assert "10 frames in" in result.err
    assert json.loads(hypermap("info", out, "--json").out)["metadata"]["recording"] == "desk"


def test_what_is_less_sure_than_the_score_is_left_out(hypermap, drive, tmp_path):
    out = tmp_path / "out.hmap"
    arguments = ["map", drive, "--intrinsics", INTRINSICS, "-o", out, "--score"]
    for score, objects in [("0.85", 1), ("0.95", 0)]:  # the detections' own is 0.9
        assert hypermap(*arguments, score).code == 0
        assert len(objects_in(out)) == objects
        metadata = hypermap("info", out, "--json").json["metadata"]
        assert metadata["config"]["perception"]["min_score"] == float(score)


@pytest.mark.parametrize(
    ("arguments", "in_file", "score", "objects"),
    [
        ([], "", 0.3, 0),
        (["--score", "0"], "", 0.0, 1),
        (["--score", "0.15"], "", 0.15, 1),
        (["--score", "0.25"], "min_score: 0", 0.25, 0),
        ([], "min_score: 0", 0.0, 1),
        (["--profile", "thesis"], "", 0.3, 0),
        (["--profile", "thesis"], "min_score: 0", 0.0, 1),
    ],
)
def test_a_network_is_asked_from_the_score_on_that_is_saved(
    hypermap, drive, unsure_network, tmp_path, arguments, in_file, score, objects
):
    config, out = tmp_path / "config.yaml", tmp_path / "out.hmap"
    config.write_text(f"evidence: {{publish_above: 0}}\nperception: {{{in_file}}}\n")
    common = ["--intrinsics", INTRINSICS, "--detector", unsure_network, "--config", config]
    assert hypermap("map", drive, *common, *arguments, "-o", out).code == 0
    assert len(objects_in(out)) == objects  # the network's own score is 0.2
    metadata = hypermap("info", out, "--json").json["metadata"]
    assert metadata["config"]["perception"]["min_score"] == score


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


def test_a_world_that_is_not_level_is_reported_with_the_option_that_levels_it(hypermap, tmp_path):
    room = tmp_path / "room"
    write_tum(SimulatedRecording(demo_world(), rate=0.5), room)
    map_room = ["map", room, "-o", tmp_path / "room.hmap", "--drop-evidence"]
    level = hypermap(*map_room)
    assert level.code == 0
    assert "warning" not in level.err
    tilted = hypermap(*map_room, "--world-transform", "1,0,-1,0.4,0.2,0.5")
    assert tilted.code == 0
    assert "the world of the recording is not level: its floor is tilted by 2" in tilted.err
    assert "  level: give --level auto, or --world-transform=" in tilted.err.splitlines()[-1]
    option = re.search(r"--world-transform=\S+", tilted.err)
    assert option is not None
    for mend in ([option[0]], ["--world-transform", "1,0,-1,0.4,0.2,0.5", "--level", "auto"]):
        mended = hypermap(*map_room, *mend)
        assert mended.code == 0
        assert "warning" not in mended.err
    assert "level: the floor is tilted by 2" in mended.err


def test_what_auto_measures_is_said_and_used(hypermap, tmp_path):
    room = tmp_path / "room"
    write_tum(SimulatedRecording(demo_world(), camera=SMALL, rate=3.0), room)
    poses = (room / "groundtruth.txt").read_text().splitlines()
    late = [f"{float(line.split()[0]) + 0.2:.6f} {line.partition(' ')[2]}" for line in poses[2:]]
    (room / "groundtruth.txt").write_text("\n".join(late))
    map_room = ["map", room, "-o", tmp_path / "room.hmap", "--no-objects"]
    reported = hypermap(*map_room)
    assert "images match each other best with the poses of 0.20 s later" in reported.err
    mended = hypermap(*map_room, "--time-offset", "auto", "--level", "auto")
    assert "time offset: 0.20 s" in mended.err
    assert "level: within 0.0 degrees, so the world is unchanged" in mended.err
    assert "make the map worse" in reported.err
    assert "make the map worse" not in mended.err
    for option, value in (("--level", "manual"), ("--time-offset", "soon"), ("--rotate", "45")):
        assert_one_error(hypermap(*map_room, option, value), option)
    assert_one_error(hypermap(*map_room, "--color-intrinsics", "5,5,3,2"), "give register")


def test_a_real_kitchen_with_a_tilted_world_is_reported(hypermap, shared_data, tmp_path):
    nothing = tmp_path / "nothing.json"
    nothing.write_text('{"frames": {}}')
    kitchen = ["map", shared_data / "kitchen", "--detections", nothing, "-o", tmp_path / "k.hmap"]
    result = hypermap(*kitchen)
    assert "tilted by 27 degrees" in result.err
    assert "m below its origin" in result.err
    assert "tilted" not in hypermap(*kitchen, result.err.splitlines()[-1].strip()).err
