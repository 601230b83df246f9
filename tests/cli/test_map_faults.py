"""Recordings with faults: what `hypermap map` leaves out, refuses, warns of and mends."""

from __future__ import annotations

import re
import tempfile
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from hypermap import Hypermap, HypermapError, SemanticLayer
from hypermap.cli.map_result import save_result
from hypermap.formats import open_map
from hypermap.perception.frame import Camera
from hypermap.simulation import SimulatedRecording, demo_world, write_tum
from hypermap.testing import assert_same_objects, square

from .conftest import INTRINSICS, assert_one_error, objects_in, write_drive

SMALL = Camera.from_intrinsics(131.25, 131.25, 79.5, 59.5, width=160, height=120)


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
    assert "nothing to map: no frame of 3 can be used; the first one: half of its" in last
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
    assert "warning: left out for the same reasons: 3 frames more (-v lists them)" in reported.err
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


def test_a_world_that_is_not_level_is_reported_with_the_option_that_levels_it(hypermap, tmp_path):
    room = tmp_path / "room"
    write_tum(SimulatedRecording(demo_world(), camera=SMALL, rate=0.5), room)
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
    for option, value in (
        ("--level", "manual"),
        ("--time-offset", "soon"),
        ("--rotate", "45"),
        ("--pose-convention", "robot"),
    ):
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


def test_a_map_that_cannot_be_saved_where_it_should_be_is_not_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Such as after a drive of hours onto a disk that is full by then."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    made = Hypermap([SemanticLayer("semantic", "map", [square("cup", 0, 0)])])
    with pytest.raises(HypermapError, match=r"no such folder.*; this map is in (.*) instead") as no:
        save_result(made, tmp_path / "gone" / "office.hmap", evidence=True, onto=None)
    rescued = Path(str(no.value).split("this map is in ")[1].removesuffix(" instead"))
    assert rescued.name == "office.hmap"
    assert_same_objects(open_map(rescued).semantic(), made.semantic())
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "none"))
    with pytest.raises(HypermapError, match=r"no such folder to save in$"):
        save_result(made, tmp_path / "gone" / "office.hmap", evidence=True, onto=None)
