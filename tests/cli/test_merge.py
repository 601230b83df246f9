"""`hypermap merge`: from maps of several drives to one map."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from hypermap import Pose2D, open_map, save_map
from hypermap.cli import merge, progress
from hypermap.mapping.config import profile
from hypermap.mapping.mapper import Mapper
from hypermap.mapping.merging import Merged
from hypermap.perception.detectors.sources import detections_from_recording
from hypermap.perception.frame import Camera
from hypermap.simulation import EXACT_DETECTOR, SimulatedRecording, demo_world

from .conftest import Result, assert_one_error

pytestmark = pytest.mark.xdist_group("merge")  # they share what takes long to make

Run = Callable[..., Result]

SMALL = Camera.from_intrinsics(131.25, 131.25, 79.5, 59.5, width=160, height=120)
POSE = Pose2D(2.0, 1.0, np.pi / 2)
"""Where the second robot's map frame is in that of the first one."""


@pytest.fixture(scope="module")
def maps(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, Path]:
    """Return three maps of a room; the second is in a frame of its own."""
    folder = tmp_path_factory.mktemp("maps")
    recording = SimulatedRecording(
        demo_world(),
        detector_noise=EXACT_DETECTOR,
        has_masks=True,
        has_occupancy=False,
        camera=SMALL,
        rate=1.0,
    )
    frames = list(recording.frames())
    turned = np.eye(4)
    turned[np.ix_([0, 1, 3], [0, 1, 3])] = POSE.inverse().matrix()
    paths = []
    for day, matrix in enumerate((np.eye(4), turned, np.eye(4))):
        mapper = Mapper(profile("default"), detections_from_recording(), drive=f"day {day}")
        for frame in frames:
            pose, stamp = matrix @ frame.map_T_camera, frame.stamp + 86_400 * day
            mapper.add(dataclasses.replace(frame, stamp=stamp, map_T_camera=pose))
        paths.append(folder / f"day{day}.hmap")
        save_map(mapper.hypermap(), paths[-1])
    return paths[0], paths[1], paths[2]


def test_maps_are_aligned_and_become_one(
    hypermap: Run, maps: tuple[Path, ...], tmp_path: Path
) -> None:
    out = tmp_path / "week.hmap"
    result = hypermap("merge", *maps, "-o", out)
    assert result.code == 0, result.err
    where, counts, *third = result.out.splitlines()
    found = re.fullmatch(
        rf"{re.escape(str(maps[1]))}: x (\S+) m, y (\S+) m, yaw (\S+) degrees", where
    )
    assert found is not None
    assert [float(number) for number in found.groups()] == pytest.approx([2, 1, 90], abs=0.5)
    count = len(open_map(maps[0]).semantic())
    for line in (counts, third[1]):
        # What one drive shows too seldom, two may show often enough.
        new = re.fullmatch(rf"  {count} objects in both, 0 only before, ([01]) new, 0 gone", line)
        assert new is not None
        count += int(new[1])
    assert f"saved {out}" in result.err
    merged = open_map(out)
    assert len(merged.semantic()) == count
    assert [drive["name"] for drive in merged.metadata["drives"]] == ["day 0", "day 1", "day 2"]
    assert "drive day 2: " in hypermap("info", out).out


def test_a_long_merge_says_that_it_goes_on(
    hypermap: Run, maps: tuple[Path, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress, "_EVERY", 0.0)
    result = hypermap("merge", *maps[::2], "-o", tmp_path / "week.hmap", "--same-frame")
    assert f"merging {maps[2]} ..." in result.err


def test_a_map_that_align_has_aligned_is_not_aligned_again(
    hypermap: Run, maps: tuple[Path, ...], tmp_path: Path
) -> None:
    aligned, out = tmp_path / "aligned.hmap", tmp_path / "out.hmap"
    assert hypermap("align", *maps[:2], "--initial", "2,1,90", "-o", aligned).code == 0
    pose = open_map(aligned).frames.lookup("map", "map_2")
    rows = hypermap("merge", maps[0], aligned, "-o", out, "--json").json["maps"]
    assert [(row["x"], row["y"], row["yaw"]) for row in rows] == [(pose.x, pose.y, pose.yaw)]
    # To another map than it was aligned to, it is aligned anew.
    rows = hypermap("merge", aligned, maps[0], "-o", out, "--json").json["maps"]
    assert rows[0]["yaw"] == pytest.approx(-np.pi / 2, abs=0.02)


def test_maps_in_one_frame_need_not_be_aligned(
    hypermap: Run, maps: tuple[Path, ...], tmp_path: Path
) -> None:
    out = tmp_path / "out.hmap"
    answer = hypermap("merge", maps[0], maps[2], "--same-frame", "-o", out, "--json").json
    assert answer["maps"][0] | {"map": "", "both": 0} == {
        "map": "", "x": 0, "y": 0, "yaw": 0, "both": 0, "first": 0, "second": 0, "gone": 0,
        "left_out": 0, "deleted": [], "conflicts": [], "renamed": {}, "settings": [],
    }  # fmt: skip
    assert answer["objects"] == answer["maps"][0]["both"] > 3


def test_the_first_map_may_be_replaced_and_stays_as_a_backup(
    hypermap: Run, maps: tuple[Path, ...], tmp_path: Path
) -> None:
    out = tmp_path / "floor.hmap"
    out.write_bytes(maps[0].read_bytes())
    result = hypermap("merge", out, maps[2], "--same-frame", "-o", out)
    assert result.code == 0
    assert "floor.hmap.bak" in result.err
    assert (tmp_path / "floor.hmap.bak").read_bytes() == maps[0].read_bytes()
    again = hypermap("merge", out, maps[2], "--same-frame", "-o", out)
    assert_one_error(again, "frames of the drive 'day 2', which would count twice")


def test_what_only_the_other_map_had_is_left_out_not_gone(
    maps: tuple[Path, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    counts = {"both": 13, "first": 4, "second": 3, "gone": 0, "left_out": 2}
    deleted = {5: "chair", 17: "cup"}
    merged = Merged(open_map(maps[0]), **counts, conflicts=(), renamed={}, deleted=deleted)
    merge._show(merge._described(merged, Pose2D(), Path("old.hmap")))
    said = "13 objects in both, 4 only before, 3 new, 0 gone; 2 of old.hmap left out"
    output = capsys.readouterr()
    assert said in output.out
    by_hand = "left out, because deleted by hand in one of the maps: 2 objects (chair 5, cup 17)"
    assert by_hand in output.err


def test_wrong_input_is_one_error_and_nothing_is_saved(
    hypermap: Run, maps: tuple[Path, ...], room_map: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out.hmap"
    for arguments, words in [
        ([maps[0], room_map, "--same-frame"], [str(room_map), "not made by mapping"]),
        ([room_map, maps[0], "--same-frame"], [str(room_map), "not made by mapping"]),
        ([maps[0], tmp_path / "none.hmap"], ["none.hmap: there is no such file"]),
        ([*maps, "--initial", "1,2,90"], ["--initial is for one OTHER"]),
        ([*maps[:2], "--initial", "north"], ["--initial"]),
    ]:
        assert_one_error(hypermap("merge", *arguments, "-o", out), *words)
        assert not out.exists()
    assert_one_error(hypermap("merge", *maps[:2], "-o", tmp_path / "out.yaml"), "saved as .hmap")
