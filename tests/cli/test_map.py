from __future__ import annotations

import json
import shlex
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hypermap.cli.recording_options import OPTIONS
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.formats import open_map, save_map
from hypermap.recordings import RecordingOptions
from hypermap.testing import square
from hypermap.viewer.live.document import MapDocument

from ..prepared import Command
from .conftest import INTRINSICS, answered, assert_one_error, objects_in, write_drive


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


def renamed_in_python(path: Path) -> None:
    """Rename an object in a program, and save the map."""
    found = open_map(path)
    found.semantic().rename(found.semantic().ids[0], "throne")
    save_map(found, path)


def drawn(path: Path) -> None:
    """Save a map that was never made of a recording."""
    save_map(Hypermap([SemanticLayer("semantic", "map", [square("zone", 0, 0)])]), path)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (edited, "it was edited by hand, with hypermap view"),
        (renamed_in_python, "it was edited by hand"),
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
    command = ["map", drive, "--intrinsics", INTRINSICS, "-o", out]
    ended, said = answered(command, answer)
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


def test_there_is_an_option_for_every_field_of_the_recording_options():
    fields = set(RecordingOptions.__dataclass_fields__)
    assert set(OPTIONS) == fields | {"level"}  # which is always measured


def from_a_terminal(*words: object) -> Command:
    return Command(*words, stderr=subprocess.PIPE)


def as_a_job_of_a_script(*words: object) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "hypermap", *map(str, words)],
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN),
    )


@pytest.mark.parametrize(
    ("started", "numbers", "name"),
    [
        (from_a_terminal, [signal.SIGINT], "Ctrl-C"),
        # `timeout` sends it to its child and to the child's group.
        (from_a_terminal, [signal.SIGTERM, signal.SIGTERM], "SIGTERM"),
        (as_a_job_of_a_script, [signal.SIGINT, signal.SIGTERM], "SIGTERM"),
        (from_a_terminal, [signal.SIGHUP], "SIGHUP"),
    ],
)
def test_who_ends_it_early_gets_what_there_is(tmp_path, started, numbers, name):
    drive, out = write_drive(tmp_path / "drive", frames=3000), tmp_path / "out.hmap"
    with started("map", drive, "-o", out, "--intrinsics", INTRINSICS) as process:
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


def test_live_says_how_poses_that_drift_are_corrected(hypermap):
    run = hypermap("live", "--depth-topic", "/depth", "--correct-poses", "graph")
    assert_one_error(run, "hypermap map BAG --correct-poses graph")
