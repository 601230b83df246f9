"""Lifts and stairs between the maps of a building, and paths that use them."""

from __future__ import annotations

import numpy as np
import pytest

from hypermap import GridGeometry, Hypermap, OccupancyLayer, Pose2D, save_map

from .conftest import assert_one_error


@pytest.fixture
def maps(tmp_path):
    """Return the files of two halls of 10 x 4 m, the upper one in a folder of its own."""
    files = tmp_path / "ground.hmap", tmp_path / "above" / "upper.hmap"
    files[1].parent.mkdir()
    for file in files:
        cells = np.zeros((80, 200), dtype=np.int8)
        grid = GridGeometry(200, 80, 0.05, Pose2D(-5.0, 0.0))
        save_map(Hypermap([OccupancyLayer("occupancy", "map", grid, cells)]), file)
    return files


def test_a_path_leads_over_a_lift_both_ways(hypermap, maps):
    ground, upper = maps
    names = ("--called", "lift A", "--counts-as", "5", "--floor", "ground floor")
    result = hypermap("connect", ground, "-4,1", upper, "-4,3", *names)
    assert (result.code, result.out) == (0, "")
    assert result.err == f"saved {ground}\nsaved {upper}\n"
    assert (ground.parent / "ground.hmap.bak").exists()
    reported = hypermap("info", ground).out
    assert "floor: ground floor\nlift A leads to above/upper.hmap\n" in reported
    assert "made with" not in reported

    result = hypermap("path", ground, "-1,1", "-1,3", "--goal-map", upper)
    assert result.out.splitlines() == [
        "11.00 m",
        "ground floor (ground.hmap):",
        "  3.00 m",
        "  -1.00,1.00  -4.00,1.00",
        "-- lift A, counts for 5 m --",
        "upper.hmap:",
        "  3.00 m",
        "  -4.00,3.00  -1.00,3.00",
    ]
    back = hypermap("path", upper, "-1,3", "-1,1", "--goal-map", ground, "--json").json
    assert back["length"] == pytest.approx(11)
    assert [part["map"] for part in back["parts"]] == [str(upper), str(ground)]
    assert back["connectors"] == [{"kind": "lift", "name": "lift A", "length": 5.0}]


def test_a_copy_in_another_folder_leads_to_the_same_maps(hypermap, maps, tmp_path):
    ground, upper = maps
    assert hypermap("connect", ground, "-4,1", upper, "-4,3", "--called", "lift A").code == 0
    (tmp_path / "copies" / "new").mkdir(parents=True)
    copy = tmp_path / "copies" / "new" / "hall.hmap"
    assert hypermap("convert", ground, copy).code == 0
    assert "lift A leads to ../../above/upper.hmap\n" in hypermap("info", copy).out
    assert hypermap("path", copy, "-1,1", "-1,3", "--goal-map", upper).code == 0


def test_a_copy_in_a_folder_or_by_a_linked_one_leads_to_the_same_maps(hypermap, maps, tmp_path):
    ground, upper = maps
    assert hypermap("connect", ground, "-4,1", upper, "-4,3").code == 0
    (tmp_path / "far" / "away").mkdir(parents=True)
    (tmp_path / "link").symlink_to(tmp_path / "far" / "away")
    folder, linked = tmp_path / "folder", tmp_path / "link" / "hall.hmap"
    assert hypermap("convert", ground, folder).code == 0
    assert hypermap("convert", folder, linked).code == 0
    for copy in (folder, linked):
        assert "lift leads to ../above/upper.hmap\n" in hypermap("info", copy).out
        assert hypermap("path", copy, "-1,1", "-1,3", "--goal-map", upper).code == 0


def test_a_map_that_is_gone_is_named_with_what_led_there(hypermap, maps):
    ground, upper = maps
    assert hypermap("connect", ground, "1,1", upper, "1,1", "--kind", "stairs").code == 0
    upper.unlink()
    result = hypermap("path", ground, "1,2", "1,3", "--goal-map", upper)
    assert_one_error(result, "ground.hmap, stairs: ", "upper.hmap: there is no such file")


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (
            ["ground.hmap", "1,9", "above/upper.hmap", "1,1"],
            "ground.hmap: the place (1.00, 9.00) is",
        ),
        (["ground.hmap", "1,1", "ground.hmap", "1,1"], "a lift or stairs must lead to another map"),
        (["ground.hmap", "1;1", "above/upper.hmap", "1,1"], "MAP '1;1': a point is X,Y in meters"),
        (["ground.hmap", "1,1", "map.yaml", "1,1"], "map.yaml: only .hmap files can contain lifts"),
        (["ground.hmap", "1,1", "none.hmap", "1,1"], "none.hmap: there is no such file"),
    ],
)
def test_what_cannot_be_connected_leaves_both_maps(hypermap, maps, monkeypatch, arguments, reason):
    monkeypatch.chdir(maps[0].parent)
    before = [file.read_bytes() for file in maps]
    assert_one_error(hypermap("connect", *arguments), reason)
    assert [file.read_bytes() for file in maps] == before


def test_a_floor_to_which_nothing_leads_is_reported(hypermap, maps):
    result = hypermap("path", maps[0], "1,1", "1,1", "--goal-map", maps[1])
    assert_one_error(result, "no lift or stairs leads to", "upper.hmap")
