"""The one file: nothing in a map can end its script, and it is saved as a whole."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hypermap.core.errors import HypermapError
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.testing import occupancy_from_text, square
from hypermap.viewer.live.export import export_page

EVIL = "</script><script>alert(1)</script><!--\u2028\\ \" ' & {}"
INDEX = """<!doctype html><html><head><!-- hypermap:head -->
<link rel="stylesheet" href="page/app.css"></head><body><!-- hypermap:blob -->
<script type="module" src="page/app.js"></script></body></html>"""


class Elements(HTMLParser):
    """What a browser would see: each element, with its attributes and the text inside."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.seen: list[tuple[str, dict[str, str | None], list[str]]] = []
        self.feed(html)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append((tag, dict(attrs), []))

    def handle_data(self, data: str) -> None:
        if self.seen:
            self.seen[-1][2].append(data)

    def texts(self, tag: str) -> list[str]:
        return ["".join(text) for name, _, text in self.seen if name == tag]


@pytest.fixture
def page(tmp_path: Path) -> Path:
    folder = tmp_path / "page"
    folder.mkdir()
    (folder / "index.html").write_text(INDEX)
    (folder / "app.css").write_text("body {color: #222}")
    (folder / "app.js").write_text('console.log("<!-- hypermap:blob --></script>");')
    return folder


def a_map() -> Hypermap:
    occupancy = occupancy_from_text("#.?\n###")
    return Hypermap([occupancy, SemanticLayer(EVIL, "map", [square(EVIL, 1, 1)])])


def blob_in(path: Path) -> dict[str, Any]:
    blob: dict[str, Any] = json.loads(Elements(path.read_text()).texts("script")[0])
    return blob


def test_no_name_ends_the_script_and_all_come_back(page: Path, tmp_path: Path) -> None:
    done = export_page(a_map(), f"/home/me/{EVIL}", tmp_path / "out.html", page=page)
    html = (tmp_path / "out.html").read_text()
    assert done.size == (tmp_path / "out.html").stat().st_size
    elements = Elements(html)
    assert [tag for tag, _, _ in elements.seen] == [
        *("html", "head", "meta", "style", "body", "script", "script")
    ]
    blob = blob_in(tmp_path / "out.html")
    assert blob["map"]["path"] == blob["map"]["name"] == EVIL.rsplit("/")[-1]
    assert "/home/me" not in html
    assert [shape["name"] for shape in blob["shapes"][EVIL]] == [EVIL]
    assert list(blob["rasters"]) == ["occupancy"]
    assert "\u2028" not in html
    assert elements.texts("script")[1] == r'console.log("<\!-- hypermap:blob --><\/script>");'


def test_nothing_can_be_edited_and_nothing_else_is_fetched(page: Path, tmp_path: Path) -> None:
    export_page(a_map(), f"/home/me/{EVIL}", tmp_path / "out.html", page=page)
    blob = blob_in(tmp_path / "out.html")
    assert blob["map"]["editable"] is False
    assert [layer["editable"] for layer in blob["map"]["layers"]] == [False, False]
    html = (tmp_path / "out.html").read_text()
    assert not re.search(r"""(src|href)=["'](?!data:)""", html)
    assert "default-src 'none'" in html


def test_the_same_map_gives_the_same_file(page: Path, tmp_path: Path) -> None:
    for name in ("a.html", "b.html"):
        export_page(a_map(), f"/home/me/{EVIL}", tmp_path / name, page=page)
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()


def test_a_reduced_layer_is_named(page: Path, tmp_path: Path) -> None:
    grid = GridGeometry(300, 200, 0.05)
    hypermap = Hypermap([OccupancyLayer("occupancy", "map", grid, np.zeros((200, 300), np.int8))])
    done = export_page(hypermap, "lab.hmap", tmp_path / "out.html", page=page, max_pixels=15000)
    assert done.notes == (
        "layer 'occupancy' is reduced: 2 x 2 of its cells are one here, "
        "which has their highest value",
    )
    assert blob_in(tmp_path / "out.html")["map"]["notes"] == list(done.notes)


def test_numbers_that_json_does_not_know_become_text(page: Path, tmp_path: Path) -> None:
    odd = square("cup", 0, 0, attributes={"range": float("nan"), "since": Path("x"), "n": [1.5]})
    hypermap = Hypermap([SemanticLayer("semantic", "map", [odd])])
    export_page(hypermap, "lab.hmap", tmp_path / "out.html", page=page)
    shape = blob_in(tmp_path / "out.html")["shapes"]["semantic"][0]
    assert shape["attributes"] == {"range": "nan", "since": "x", "n": [1.5]}


def test_a_page_that_is_not_built_is_named(page: Path, tmp_path: Path) -> None:
    (page / "app.js").unlink()
    with pytest.raises(HypermapError, match=r"app\.js: the page is not built; .* make page"):
        export_page(a_map(), f"/home/me/{EVIL}", tmp_path / "out.html", page=page)
    assert not (tmp_path / "out.html").exists()


def test_a_page_without_a_place_for_the_map_is_refused(page: Path, tmp_path: Path) -> None:
    (page / "index.html").write_text(INDEX.replace("<!-- hypermap:blob -->", ""))
    with pytest.raises(HypermapError, match=r"index\.html: this must stand there once: <!-- "):
        export_page(a_map(), f"/home/me/{EVIL}", tmp_path / "out.html", page=page)
