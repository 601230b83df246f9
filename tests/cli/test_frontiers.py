from __future__ import annotations

import math
import xml.etree.ElementTree as ET

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

from .conftest import assert_one_error


@pytest.fixture
def half(tmp_path):
    """Return the file of a hall whose right half is unknown, with a cup that was seen once."""
    cells = np.full((80, 200), -1, dtype=np.int8)
    cells[:, :100] = 0
    cells[[0, -1], :100] = cells[:, 0] = 100
    cup = SemanticObject("cup", shapely.box(1.0, 1.0, 1.1, 1.1), 7, existence=2.4)
    layers = [
        OccupancyLayer("occupancy", "map", GridGeometry(200, 80, 0.05, Pose2D(-2.0, 0.0)), cells),
        SemanticLayer("things", "map", [cup]),
    ]
    file = tmp_path / "half.hmap"
    save_map(Hypermap(layers), file)
    return file


def test_frontiers_are_reported_as_a_table(hypermap, half):
    result = hypermap("frontiers", half, "-1,2", "--robot-radius", "0.2")
    assert (result.code, result.err) == (0, "")
    (row,) = [line.split() for line in result.out.splitlines() if line.strip().startswith("1 ")]
    assert float(row[1]) == pytest.approx(2.98, abs=0.01)  # x of the border
    assert float(row[3]) == pytest.approx(3.9, abs=0.1)  # its length
    assert "cup" not in result.out


def test_programs_read_frontiers_and_views_as_json(hypermap, half):
    answer = hypermap(
        "frontiers", half, "-1,2", "--robot-radius", "0.2", "--next-views", "--json"
    ).json
    assert answer["frame_id"] == "map"
    (border,) = answer["frontiers"]
    assert border["size"] == pytest.approx(0.05 * len(border["points"]))
    assert border["pose"]["x"] < 2.8
    assert border["distance"] == pytest.approx(border["pose"]["x"] + 1, abs=0.3)
    (view,) = answer["next_views"]
    assert (view["layer"], view["object"], view["name"]) == ("things", 7, "cup")
    assert (view["is_weak"], view["is_one_sided"], view["turn"]) == (True, False, math.pi)
    assert "next_views" not in hypermap("frontiers", half, "-1,2", "--json").json


def test_people_read_why_an_object_is_uncertain(hypermap, half):
    answer = hypermap("frontiers", half, "0,2", "--next-views")
    assert "cup 7" in answer.out
    assert "few observations" in answer.out
    answer = hypermap("frontiers", half, "0,2", "--next-views", "--sure-from", "2")
    assert "no uncertain object can be seen from a new side" in answer.out
    assert (
        "no frontier can be reached" in hypermap("frontiers", half, "0,2", "--least-gain", "99").out
    )


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["99,2"], "the start (99.00, 2.00) is off the grid"),
        (["-1.99,2"], "the start (-1.99, 2.00) is in a wall"),
        (["mug"], "there is no object or room 'mug'; known: cup"),
        (["0,2", "--fov", "0"], "--fov must be above 0 and at most 360"),
        (["0,2", "--max-range", "-1"], "--max-range must be above 0"),
        (["0,2", "--min-range", "9"], "--min-range must be 0 or more, and below max_range"),
        (["0,2", "--occupancy", "grid"], "there is no layer 'grid'"),
        (["0,2", "--keepout", "cup"], "keepout: 'cup' is not a zone"),
    ],
)
def test_what_cannot_be_explored_is_one_error(hypermap, half, arguments, reason):
    assert_one_error(hypermap("frontiers", half, *arguments), reason)


def test_frontiers_are_drawn_with_their_numbers(hypermap, half, tmp_path):
    out = tmp_path / "next.svg"
    arguments = ["-o", out, "--frontiers", "-1,2", "--robot-radius", "0.2"]
    assert hypermap("render", half, *arguments).code == 0
    texts = ["".join(text.itertext()) for text in ET.parse(out).iter() if text.tag.endswith("text")]
    assert {"frontiers", "frontier", "1", "1 object of 1 class, frame map"} <= set(texts)
