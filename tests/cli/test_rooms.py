from __future__ import annotations

import numpy as np
import pytest
import shapely
from PIL import Image

from hypermap import (
    GridGeometry,
    Hypermap,
    OccupancyLayer,
    SemanticLayer,
    SemanticObject,
    open_map,
    save_map,
)

from .conftest import assert_one_error


@pytest.fixture
def flat(tmp_path):
    """Return the file of a map of two rooms with a door of 0.9 m between."""
    cells = np.full((100, 180), 100, dtype=np.int8)
    cells[10:90, 8:88] = cells[10:90, 92:172] = cells[41:59, 88:92] = 0
    file = tmp_path / "flat.hmap"
    save_map(
        Hypermap([OccupancyLayer("occupancy", "map", GridGeometry(180, 100, 0.05), cells)]), file
    )
    return file


def test_rooms_and_doors_are_printed(hypermap, flat):
    result = hypermap("rooms", flat, "--robot-radius", "0.6")
    assert (result.code, result.err) == (0, "")
    assert "room 2" in result.out
    assert "too narrow" in result.out
    assert "no path connects these 2 groups of rooms" in result.out
    assert "from every room to every other" in hypermap("rooms", flat, "--robot-radius", "0.3").out


def test_rooms_become_a_layer(hypermap, flat, tmp_path):
    out = tmp_path / "out.hmap"
    assert hypermap("rooms", flat, "-o", out).err.endswith(f"saved {out}\n")
    assert open_map(out).semantic("rooms").names.tolist() == ["room", "room 2"]
    assert open_map(out).semantic("rooms").label_at([[1, 1]]).tolist() == ["room"]
    assert_one_error(hypermap("rooms", flat, "-o", out), "give --force to replace it")


def test_rooms_as_json(hypermap, flat):
    content = hypermap("rooms", flat, "--json", "--robot-radius", "0.6").json
    assert [room["area"] for room in content["rooms"]] == pytest.approx([16, 16], abs=0.3)
    assert [room["part"] for room in content["rooms"]] == [0, 1]
    (door,) = content["doors"]
    assert (door["rooms"], door["passes"]) == ([0, 1], False)


def test_rooms_are_drawn(hypermap, flat, tmp_path):
    out = tmp_path / "rooms.png"
    assert hypermap("render", flat, "-o", out, "--rooms", "--size", "400").code == 0
    plain = tmp_path / "plain.png"
    hypermap("render", flat, "-o", plain, "--size", "400")
    with Image.open(out) as image, Image.open(plain) as other:
        assert len(image.getcolors(1 << 20)) > len(other.getcolors(1 << 20))


def test_doors_are_drawn_where_rooms_meet(hypermap, flat, tmp_path):
    drawn = []
    for name, doors in (
        ("with", ({"to": 1, "line": [[4.5, 2], [4.5, 3]], "width": 1},)),
        ("no", ()),
    ):
        rooms = SemanticLayer("rooms", "map")
        boxes = shapely.box(0.4, 0.5, 4.5, 4.5), shapely.box(4.5, 0.5, 8.6, 4.5)
        rooms.add([SemanticObject("a", boxes[0], 0, attributes={"doors": list(doors)})])
        rooms.add([SemanticObject("b", boxes[1], 1)])
        save_map(Hypermap([open_map(flat)["occupancy"], rooms]), tmp_path / f"{name}.hmap")
        out = tmp_path / f"{name}.png"
        assert hypermap("render", tmp_path / f"{name}.hmap", "-o", out, "--title", "").code == 0
        with Image.open(out) as image:
            drawn.append(np.asarray(image.convert("L"), dtype=int))
    rows, cols = np.nonzero(drawn[0] != drawn[1])
    assert np.ptp(cols) < 20 < 100 < np.ptp(rows)  # an upright line ...
    assert drawn[0][rows, cols].max() > 250 > 100 > drawn[0][rows, cols].min()  # white and dark


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--least-area", "0"], "--least-area must be a positive number, got 0.0"),
        (["-o", "x.png"], "x.png: a map is saved as .hmap"),
        (["--kinds", "none.yaml"], "none.yaml: there is no such file"),
        (["--occupancy", "semantic"], "there is no layer 'semantic'"),
    ],
)
def test_what_cannot_be_is_said_so(hypermap, flat, arguments, reason):
    assert_one_error(hypermap("rooms", flat, *arguments), reason)


def test_a_room_is_drawn_alone(hypermap, flat, tmp_path):
    out = tmp_path / "room.svg"
    assert hypermap("render", flat, "-o", out, "--rooms", "--in", "room 2").code == 0
    text = out.read_text()
    assert "room 2" in text
    result = hypermap("render", flat, "-o", out, "--rooms", "--in", "attic")
    assert_one_error(result, "there is no room or kind of room 'attic'; known: room, room 2")
