from __future__ import annotations

import json
import math

import numpy as np
import pytest
import shapely

from hypermap import (
    GridGeometry,
    Hypermap,
    OccupancyLayer,
    Pose2D,
    SemanticLayer,
    SemanticObject,
    save_map,
)
from hypermap.rooms import rooms_of_map, with_rooms

from .conftest import assert_one_error


@pytest.fixture
def flat(tmp_path):
    """Return the file of two rooms, a door of 0.9 m at the upper end of the wall, and two cups."""
    cells = np.full((100, 180), 100, dtype=np.int8)
    cells[10:90, 8:88] = cells[10:90, 92:172] = cells[70:88, 88:92] = 0
    grid = GridGeometry(180, 100, 0.05, Pose2D(-1.0, 0.0))
    names = [("cup", 3.0, 1.5), ("cup", 7.0, 4.0), ("refrigerator", 0.0, 1.0)]
    objects = [
        SemanticObject(name, shapely.box(x - 0.1, y - 0.1, x + 0.1, y + 0.1))
        for name, x, y in names
    ]
    layers = [
        OccupancyLayer("occupancy", "map", grid, cells),
        SemanticLayer("things", "map", objects),
    ]
    hypermap = Hypermap(layers)
    file = tmp_path / "flat.hmap"
    save_map(with_rooms(hypermap, rooms_of_map(hypermap)), file)
    return file


def test_a_path_is_reported_with_its_length_rooms_and_doors(hypermap, flat):
    result = hypermap("path", flat, "-0.5,2.5", "5.5,2.5")
    assert (result.code, result.err) == (0, "")
    length = math.hypot(3.9, 1) + 0.2 + math.hypot(1.9, 1)  # over (3.4, 3.5) and (3.6, 3.5)
    assert result.out.startswith(f"{length:.2f} m\n-0.50,2.50  3.40,3.50  3.60,3.50  5.50,2.50\n")
    assert "rooms: kitchen, room\ndoor at 3.5" in result.out


def test_a_path_to_an_object_ends_in_front_of_it(hypermap, flat):
    answer = hypermap("path", flat, "kitchen", "cup 1", "--distance", "0.5", "--json").json
    there = answer["approach"]
    assert (there["object"], there["name"]) == (1, "cup")
    assert answer["points"][-1] == [there["x"], there["y"]]
    assert there["distance"] == pytest.approx(0.5, abs=0.05)
    assert answer["length"] > 3
    assert [room["name"] for room in answer["rooms"]] == ["kitchen", "room"]
    assert "stand at " in hypermap("path", flat, "0,3", "1", "--robot-radius", "0.2").out


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["kitchen", "room", "--robot-radius", "0.6"], "no path leads from"),
        (
            ["3.5,1", "room"],
            "the start (3.50, 1.00) is in a wall (cell row 20, col 90); the nearest",
        ),
        (["0,3", "cup"], "2 objects are called 'cup'; ask for one of 'cup 0', 'cup 1'"),
        (["0,3", "mug"], "there is no object or room 'mug'; known: cup, refrigerator, kitchen"),
        (["0,3", "1,x"], "TO '1,x': a point is X,Y in meters"),
        (["0,3", "1,1", "--cost-scaling", "-1"], "--cost-scaling must be 0 or more"),
        (["0,3", "1,1", "--keepout", "cup"], "keepout: 'cup' is not a zone"),
    ],
)
def test_what_is_no_path_is_one_error(hypermap, flat, arguments, reason):
    assert_one_error(hypermap("path", flat, *arguments), reason)


def test_the_shell_tells_paths_and_whether_a_room_is_reachable(hypermap, flat):
    result = hypermap("shell", flat, stdin="path 0,3 room 0.3\npath kitchen room 0.6\npath 0,3\n")
    assert "rooms: kitchen, room" in result.out
    assert "no path leads from" in result.err
    assert "usage: path FROM TO [RADIUS]" in result.err
    assert result.code == 2


def test_a_class_to_keep_out_of_that_no_object_has_is_named(hypermap, flat, tmp_path):
    hint = "no object is called 'refridgerator'; did you mean 'refrigerator'?"
    wrong = ("--keepout", "refridgerator 0.1")
    assert hint in hypermap("path", flat, "0,3", "1,1", *wrong).err
    assert hint in hypermap("frontiers", flat, "0,3", *wrong).err
    assert hint in hypermap("convert", flat, tmp_path / "r.geojson", "--route-graph", *wrong).err
    assert hypermap("path", flat, "0,3", "1,1", "--keepout", "refrigerator 0.1").err == ""


def test_the_ways_between_rooms_become_a_file_for_nav2(hypermap, flat, tmp_path):
    out = tmp_path / "routes.geojson"
    result = hypermap("convert", flat, out, "--route-graph", "--robot-radius", "0.2")
    assert (result.code, result.out) == (0, "")
    assert "routes.geojson: " in result.err
    assert result.err.endswith(f"between 3 nodes; the frame is 'map'\nsaved {out}\n")
    features = json.loads(out.read_text())["features"]
    assert [feature["properties"]["metadata"]["type"] for feature in features[:3]] == [
        "door",
        "room",
        "room",
    ]
    around = (out, "--route-graph", "--keepout", "refrigerator 2.5", "--force")
    assert hypermap("convert", flat, *around).code == 0
    assert json.loads(out.read_text())["features"] != features


@pytest.mark.parametrize(
    ("target", "arguments", "reason"),
    [
        ("r.geojson", ["--robot-radius", "0.2"], "--robot-radius and --inflation-radius are for"),
        ("r.yaml", ["--route-graph"], "r.yaml: a route graph is saved as .geojson"),
        ("r.geojson", ["--route-graph", "--robot-radius", "3"], "no path between rooms and doors"),
        ("r.geojson", ["--route-graph", "--speed", "cup 1 9%"], "one file cannot be both"),
        ("r.geojson", ["--route-graph", "--keepout", "cup"], "keepout: 'cup' is not a zone"),
    ],
)
def test_what_is_no_route_graph_is_one_error(hypermap, flat, tmp_path, target, arguments, reason):
    assert_one_error(hypermap("convert", flat, tmp_path / target, *arguments), reason)
    assert not (tmp_path / target).exists()
