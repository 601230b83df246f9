"""`hypermap map --onto`: continue a map of earlier drives."""

from __future__ import annotations

import re
import shlex

import pytest
import shapely

from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.formats import open_map, save_map

from .conftest import INTRINSICS, assert_one_error, objects_in, write_drive


def test_a_drive_in_two_parts_gives_the_map_of_the_whole_drive(hypermap, tmp_path):
    whole = write_drive(tmp_path / "drive", frames=8)
    part = tmp_path / "part"
    part.mkdir()
    for file in whole.iterdir():
        if file.name in ("depth.txt", "rgb.txt"):
            (part / file.name).write_text("\n".join(file.read_text().splitlines()[:5]) + "\n")
        else:
            (part / file.name).symlink_to(file)
    options, out, one_go = ("--intrinsics", INTRINSICS), tmp_path / "o.hmap", tmp_path / "w.hmap"
    assert hypermap("map", part, *options, "-o", out).code == 0
    goes_on = hypermap("map", whole, *options, "--onto", out, "-o", out)
    assert hypermap("map", whole, *options, "-o", one_go).code == 0
    assert goes_on.code == 0
    assert "frames already in the map, not counted again" in goes_on.err
    assert "does not continue it" not in goes_on.err
    layers = [hypermap("info", path, "--json").json["layers"] for path in (out, one_go)]
    assert layers[0] == layers[1]
    assert objects_in(out) == objects_in(one_go)

    before = out.read_bytes()
    again = hypermap("map", whole, *options, "--onto", out, "-o", out)
    assert again.code == 0
    assert f"{out} already contains drive: nothing new, the map is unchanged" in again.err
    assert out.read_bytes() == before


def test_a_map_in_a_frame_of_another_name_is_continued_if_the_poses_are_in_it(
    hypermap, drive, tmp_path
):
    out, options = tmp_path / "out.hmap", ("--intrinsics", INTRINSICS)
    frame = ("--map-frame", "map_2")  # as `align` renames that of the second map
    assert hypermap("map", drive, *options, *frame, "-o", out).code == 0
    other = write_drive(tmp_path / "other", frames=7)
    arguments = ("map", other, *options, "--onto", out, "-o", out)
    refused = hypermap(*arguments)
    assert refused.code == 2
    assert "in that one, too, give --map-frame map_2" in refused.err
    assert hypermap(*arguments, "--same-place").code == 0
    assert open_map(out).base_frame == "map_2"
    assert hypermap(*arguments, *frame).code == 0


def test_rooms_and_zones_of_the_map_are_not_counted_as_objects(hypermap, drive, tmp_path):
    out, options = tmp_path / "out.hmap", ("--intrinsics", INTRINSICS)
    first = hypermap("map", drive, *options, "-o", out)
    office = open_map(out)
    zone = SemanticObject("cleaning", shapely.box(0, 0, 1, 1))
    office.add(SemanticLayer("zones", "map", [zone]))
    save_map(office, out)
    other = write_drive(tmp_path / "other", frames=7)
    again = hypermap("map", other, *options, "--onto", out, "-o", out)
    assert again.code == 0
    (counts,) = (line for line in first.err.splitlines() if "1 object" in line)
    assert counts in again.err.splitlines()


def test_a_map_that_replaces_another_says_how_to_continue_it(hypermap, drive, tmp_path):
    out = tmp_path / "out.hmap"
    arguments = ["map", drive, "--intrinsics", INTRINSICS, "-o", out]
    assert "does not continue it" not in hypermap(*arguments).err
    assert f"the new map does not continue it (--onto {out} would)" in hypermap(*arguments).err


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (["--profile", "thesis"], "was made with perception: method: enclosed, not organised"),
        (["--score", "0.7"], "was made with perception: min_score: "),
        (["--map", "MAP"], "mapping continues with the occupancy layer of"),
    ],
)
def test_what_does_not_go_together_with_onto_is_one_error(
    hypermap, drive, room_map, tmp_path, options, reason
):
    out, given = tmp_path / "out.hmap", tmp_path / "given.yaml"
    assert hypermap("convert", room_map, given, "--layer", "occupancy").code == 0
    options = [given if option == "MAP" else option for option in options]
    common = ["map", drive, "--intrinsics", INTRINSICS, "-o", out]
    assert hypermap(*common).code == 0
    before = out.read_bytes()
    result = hypermap(*common, "--onto", out, *options)
    assert_one_error(result, str(out), reason)
    assert out.read_bytes() == before


def test_mapping_does_not_continue_a_map_that_it_has_not_made(hypermap, drive, room_map, tmp_path):
    common = ["map", drive, "--intrinsics", INTRINSICS, "-o", tmp_path / "out.hmap", "--onto"]
    assert_one_error(hypermap(*common, room_map), str(room_map), "this map was not made by mapping")
    assert_one_error(hypermap(*common, tmp_path / "none.hmap"), "none.hmap", "there is no such")
    dropped = tmp_path / "dropped.hmap"
    arguments = ["map", drive, "--intrinsics", INTRINSICS, "-o", dropped, "--drop-evidence"]
    assert hypermap(*arguments).code == 0
    assert_one_error(hypermap(*common, dropped), str(dropped), "for example after --drop-evidence")


def test_info_lists_the_drives_of_a_map(hypermap, drive, tmp_path):
    out = tmp_path / "out.hmap"
    assert hypermap("map", drive, "--intrinsics", INTRINSICS, "-o", out).code == 0
    result = hypermap("info", out)
    (listed,) = (line for line in result.out.splitlines() if line.startswith("drive "))
    assert re.fullmatch(r"drive drive( from \S+Z to \S+Z)?: 6 frames", listed)
    assert "map_version" in result.out


def shifted(trajectory, by: float) -> str:
    """A trajectory in TUM format, moved along x."""
    rows = [line.split() for line in trajectory.read_text().splitlines() if line[:1] != "#"]
    return "".join(f"{row[0]} {float(row[1]) + by} {' '.join(row[2:])}\n" for row in rows)


def test_corrected_poses_move_the_map_without_its_recording(hypermap, drive, tmp_path):
    out, poses = tmp_path / "out.hmap", tmp_path / "corrected.txt"
    assert hypermap("map", drive, "--intrinsics", INTRINSICS, "-o", out).code == 0
    before = open_map(out).objects()
    poses.write_text(shifted(drive / "groundtruth.txt", by=0.5))
    result = hypermap("map", "--onto", out, "--poses", poses, "-o", out)
    assert result.code == 0
    assert re.search(r"corrected the poses of \d+ frames by 0\.50 m on average", result.err)
    moved = [one.object.footprint.centroid.x for one in open_map(out).objects()]
    assert moved == pytest.approx([o.object.footprint.centroid.x + 0.5 for o in before], abs=0.02)
    assert re.search(r"since \S+: \d+ corrected by 0\.50 m\n", result.err)
    told = hypermap("changes", out).out
    assert re.search(r"corrected +\d+ objects? +- +0\.50 m +corrected poses", told)
    assert "moved" not in told
    each = hypermap("changes", out, "--all").out  # one by one
    assert len(re.findall(r"corrected  .* 0\.50 m ", each)) == len(open_map(out).semantic())


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (["--onto", "MAP", "--poses", "LATER"], "LATER: the poses, from 1000000000.000000"),
        (["--onto", "MAP", "--poses", "SPARSE"], "100.500000 s: there are gaps of more than 1 s"),
        (["--onto", "MAP", "--poses", "BROKEN"], "expected 8 numbers"),
        (["--onto", "MAP"], "give a RECORDING, or --onto MAP with --poses FILE"),
        (["--poses", "LATER"], "corrects the frames of a map; name it with --onto"),
        (["--onto", "MAP", "--poses", "LATER", "--correct-poses", "graph"], "give the RECORDING"),
        (["--onto", "MAP", "--poses", "LATER", "--save-poses", "x"], "--save-poses: give the"),
        (["--onto", "ROOM", "--poses", "LATER"], "was not made by mapping"),
    ],
)
def test_poses_that_are_not_of_the_map_change_nothing(
    hypermap, drive, room_map, tmp_path, options, reason
):
    out = tmp_path / "out.hmap"
    assert hypermap("map", drive, "--intrinsics", INTRINSICS, "-o", out).code == 0
    before = out.read_bytes()
    files = {"MAP": out, "ROOM": room_map, "LATER": tmp_path / "LATER", "BROKEN": tmp_path / "B"}
    files["LATER"].write_text("1e9 0 0 0 0 0 0 1\n1000000001 0 0 0 0 0 0 1\n")
    files["SPARSE"] = tmp_path / "SPARSE"
    files["SPARSE"].write_text("99 0 0 0 0 0 0 1\n102 0 0 0 0 0 0 1\n")
    files["BROKEN"].write_text("1 2 3\n")
    result = hypermap("map", *(files.get(one, one) for one in options), "-o", out)
    assert_one_error(result, reason)
    assert out.read_bytes() == before


def test_a_drive_in_another_frame_is_refused_with_the_commands_that_join_the_two(
    hypermap, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    rate = ("--rate", "0.3", "--seed", "3")
    assert hypermap("simulate", "demo", *rate, "-o", "mon").code == 0
    assert hypermap("simulate", "demo", *rate, "--day", "2", "-o", "tues day").code == 0
    assert hypermap("map", "mon", "-o", "mon.hmap").code == 0
    before = (tmp_path / "mon.hmap").read_bytes()
    moved = ("map", "tues day", "--world-transform", "50,0,0,0,0,0")
    refused = hypermap(*moved, "--onto", "mon.hmap", "-o", "mon.hmap")
    assert refused.code == 2
    assert "mon.hmap: tues day does not fit the map: the two have no floor in common" in refused.err
    assert (tmp_path / "mon.hmap").read_bytes() == before
    assert "-o 'tues day-alone.hmap'" in refused.err
    (merge,) = re.findall("hypermap (merge .*)", refused.err)
    assert hypermap(*moved, "-o", "tues day-alone.hmap").code == 0
    assert hypermap(*shlex.split(merge)).code == 0
