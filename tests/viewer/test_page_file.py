"""The page in one file, from disk and offline: it shows and answers as the server does."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
import shapely
from playwright.sync_api import Browser

from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.formats import open_map
from hypermap.viewer.live.embedded_raster import MAX_PIXELS
from hypermap.viewer.live.export import export_page

from ..prepared import run
from .page_tools import Window, a_window
from .small_map import EVIL, METRES_PER_PIXEL, PLACES, saved_small_map
from .test_page_maps import Shown, check_area, check_clicks, check_colors, check_names, zoomed

pytestmark = pytest.mark.xdist_group("page")


def export(path: Path) -> Path:
    html = path.with_suffix(".html")
    done = run("view", path, "--html", html)
    assert done.returncode == 0, done.stderr
    assert f"saved {html}" in done.stderr
    return html


def assert_nothing_was_fetched(window: Window) -> None:
    assert {urlsplit(url).scheme for url in window.asked} <= {"file", "data", "blob"}
    assert window.complaints == []


@pytest.fixture(params=["lab", "simulated"])
def shown(
    request: pytest.FixtureRequest, map_named: Callable[[str], Path], browser: Browser
) -> Iterator[Shown]:
    path = map_named(request.param)
    url = export(path).as_uri()
    hypermap = open_map(path)
    path.unlink()
    with a_window(browser, url, offline=True) as window:
        yield zoomed(hypermap, window)
        assert_nothing_was_fetched(window)


def test_a_file_shows_and_answers_without_a_network(shown: Shown) -> None:
    check_colors(shown)
    check_clicks(shown)
    check_area(shown)
    check_names(shown)
    assert shown.window.page.locator("#tool-edit").is_hidden()


def test_names_in_a_file_are_text(browser: Browser, tmp_path: Path) -> None:
    url = export(saved_small_map(tmp_path)).as_uri()
    with a_window(browser, url, offline=True) as window:
        window.look_at(5, 4, METRES_PER_PIXEL)
        window.ask_at(*PLACES[3])
        assert window.said("semantic") == EVIL
        assert window.page.evaluate("window.hacked") is None
        assert_nothing_was_fetched(window)


def test_an_existing_file_stays_without_force(tmp_path: Path) -> None:
    path = saved_small_map(tmp_path)
    html = tmp_path / "out.html"
    html.write_text("mine")
    done = run("view", path, "--html", html)
    assert done.returncode == 2
    assert done.stderr.strip().endswith("out.html exists already; give --force to replace it")
    assert html.read_text() == "mine"


@pytest.mark.parametrize("max_pixels", [MAX_PIXELS, 2000], ids=["whole", "reduced"])
def test_a_turned_or_reduced_grid_counts_the_cells_of_an_area(
    browser: Browser, tmp_path: Path, max_pixels: int
) -> None:
    cells = np.zeros((40, 60), dtype=np.int8)
    cells[:, ::4] = 100
    cells[30:] = -1
    yaw = 0.3 if max_pixels == MAX_PIXELS else 0.0
    grid = GridGeometry(60, 40, 0.1, Pose2D(1.0, 0.5, yaw))
    layer = OccupancyLayer("occupancy", "map", grid, cells)
    html = tmp_path / "turned.html"
    export_page(Hypermap([layer]), "turned.hmap", html, max_pixels=max_pixels)
    with a_window(browser, html.as_uri(), offline=True) as window:
        window.look_at(3, 3, 0.012)
        window.page.locator("#tool-rectangle").click()
        corners = window.points_at([[400, 600], [700, 200]])
        window.drag(*map(tuple, corners.tolist()))
        window.page.get_by_role("heading", name="In this area").wait_for()
        area = shapely.box(*corners.ravel())
        wanted = Counter(layer.labels_in(area).values)
        counts = window.cell_counts()
        said = window.page.locator("#panel ul.cells").inner_text()
        assert_nothing_was_fetched(window)
    assert min(wanted.values()) > 50
    if max_pixels == MAX_PIXELS:
        assert counts == wanted
        assert "about" not in said
    else:  # four cells are one, with their highest value
        assert sum(counts.values()) == pytest.approx(sum(wanted.values()), rel=0.1)
        assert counts["Occupied"] > wanted["Occupied"]
        assert said.count("about") == len(counts)
