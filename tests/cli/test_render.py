from __future__ import annotations

import xml.etree.ElementTree as ET

import pytest
from PIL import Image

from .conftest import assert_one_error


def test_a_map_is_drawn_as_png(hypermap, room_map, tmp_path):
    out = tmp_path / "room.png"
    result = hypermap("render", room_map, "-o", out, "--size", "500")
    assert (result.code, result.out, result.err) == (0, "", f"saved {out}\n")
    with Image.open(out) as image:
        assert image.format == "PNG"
        assert max(image.size) > 500


def test_the_title_is_the_files_name_unless_one_is_given(hypermap, room_map, tmp_path):
    out = tmp_path / "x.svg"
    for arguments, title in [([], "room"), (["--title", "My home"], "My home")]:
        assert hypermap("render", room_map, "-o", out, *arguments).code == 0
        texts = ["".join(t.itertext()) for t in ET.parse(out).iter()]
        assert title in texts


def test_what_is_drawn_can_be_chosen(hypermap, room_map, tmp_path):
    out = tmp_path / "x.svg"
    arguments = ["--layer", "semantic", "--name", "chair", "--hide-labels", "--in", "8,0,11,6"]
    assert hypermap("render", room_map, "-o", out, *arguments).code == 0
    text = out.read_text()
    assert "chair" in text
    assert "potted plant" not in text
    assert "Occupied" not in text


def test_a_picture_is_replaced(hypermap, room_map, tmp_path):
    out = tmp_path / "x.png"
    out.write_text("old")
    assert hypermap("render", room_map, "-o", out).code == 0
    assert out.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["-o", "x.jpg"], "x.jpg: a picture is saved as .png or .svg"),
        (["-o", "no/x.png"], "does not exist; create it first"),
        (["-o", "x.png", "--layer", "rooms"], "there is no layer 'rooms'"),
        (["-o", "x.png", "--name", "chiar"], "did you mean 'chair'?"),
        (["-o", "x.png", "--in", "1,2"], "--in '1,2': an area is a rectangle"),
    ],
)
def test_what_cannot_be_drawn_is_said_so(
    hypermap, room_map, tmp_path, monkeypatch, arguments, reason
):
    monkeypatch.chdir(tmp_path)
    assert_one_error(hypermap("render", room_map, *arguments), reason)
    assert list(tmp_path.iterdir()) == []


def test_the_picture_of_a_grid_is_not_drawn_over(hypermap, room_map, tmp_path):
    assert hypermap("convert", room_map, tmp_path / "map.yaml", "--layer", "occupancy").code == 0
    before = (tmp_path / "map.png").read_bytes()
    result = hypermap("render", tmp_path / "map.yaml", "-o", tmp_path / "map.png")
    assert_one_error(
        result, "map.png: this is the picture of the grid map.yaml; it is not replaced"
    )
    assert (tmp_path / "map.png").read_bytes() == before
