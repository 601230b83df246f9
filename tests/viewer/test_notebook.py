from __future__ import annotations

import base64
import io
import re
from pathlib import Path

import pytest
from PIL import Image

from hypermap import Hypermap, SemanticLayer, save_map
from hypermap.core.opaque import OpaqueLayer
from hypermap.testing import square

from .small_map import EVIL, small_map


def test_a_notebook_shows_a_table_of_the_layers_and_the_picture() -> None:
    html = small_map()._repr_html_()
    cells = re.findall(r"<t[hd]>(.*?)</t[hd]>", html)
    assert cells[:8] == [
        *("layer", "kind", "holds", "frame"),
        *("occupancy", "OccupancyLayer", "100 x 80 cells of 0.1 m (10 x 8 m)", "map"),
    ]
    picture = re.search(r'src="data:image/png;base64,([^"]+)"', html)
    assert picture is not None
    assert base64.b64decode(picture.group(1)) == small_map()._repr_png_()


def test_the_picture_is_a_png_of_a_size_for_notebooks() -> None:
    content = small_map()._repr_png_()
    assert content is not None
    with Image.open(io.BytesIO(content)) as image:
        assert image.format == "PNG"
        assert 500 < image.width < 1200


def test_names_in_a_foreign_map_are_text_in_a_notebook() -> None:
    assert EVIL in small_map().semantic().names
    html = Hypermap([SemanticLayer(EVIL, "map", [square(EVIL, 0, 0)])])._repr_html_()
    assert html.count("<img") == 1
    assert "<script" not in html
    assert "&lt;script&gt;" in html


@pytest.mark.parametrize(
    "hypermap",
    [
        Hypermap(),
        Hypermap([OpaqueLayer("RoomLayer", "rooms", "map")]),
        Hypermap([SemanticLayer("a", "map"), SemanticLayer("b", "moon", [square("x", 0, 0)])]),
    ],
    ids=["nothing", "unknown", "unconnected"],
)
def test_a_map_that_cannot_be_drawn_is_still_reported(hypermap: Hypermap) -> None:
    assert hypermap._repr_png_() is None
    html = hypermap._repr_html_()
    assert "<img" not in html
    assert re.search(r"<p>\w.*</p>", html)
    assert all(layer.name in html for layer in hypermap)


def test_a_map_saves_itself(tmp_path: Path) -> None:
    small_map().save(tmp_path / "room.hmap")
    save_map(small_map(), tmp_path / "same.hmap")
    assert (tmp_path / "room.hmap").read_bytes() == (tmp_path / "same.hmap").read_bytes()
