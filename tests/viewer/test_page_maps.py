"""The page of real maps and of a simulated one: what it shows, and what it answers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray

from hypermap.core.found import Found
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import EMPTY, SemanticLayer
from hypermap.formats import open_map

from .page_tools import Window, a_server
from .screen_colors import Expected

pytestmark = pytest.mark.xdist_group("page")

PANEL_LEFT = 770  # pixels; further right, the panel of an answer comes to lie
MAPS = ("lab", "office", "floor", "example", "simulated")


@dataclass
class Shown:
    """A map, and a window that shows it: its objects, from near."""

    hypermap: Hypermap
    window: Window
    metres_per_pixel: float

    def places(self, count: int) -> NDArray[np.float64]:
        """Return points that nothing but the map covers, half of them on objects, shape (N, 2)."""
        pixels = self.window.bare_pixels()
        pixels = pixels[pixels[:, 0] < PANEL_LEFT]
        np.random.default_rng(0).shuffle(pixels)
        points = self.window.points_at(pixels)
        semantic = next(layer for layer in self.hypermap if isinstance(layer, SemanticLayer))
        on_object = self.hypermap.label_at(semantic.name, points) != EMPTY
        return np.concatenate([points[on_object][:count], points[~on_object][:count]])


@pytest.fixture(params=MAPS)
def shown(
    request: pytest.FixtureRequest, map_named: Callable[[str], Path], empty_window: Window
) -> Iterator[Shown]:
    path = map_named(request.param)
    with a_server(path) as url:
        empty_window.load(url)
        yield zoomed(open_map(path), empty_window)


def zoomed(hypermap: Hypermap, window: Window) -> Shown:
    """Return a window that shows the middle of its map's objects from near."""
    things = [found.object.footprint for found in hypermap.objects() if found.object]
    x0, y0, x1, y1 = shapely.total_bounds(things)
    scale = min(max((x1 - x0) / 500, (y1 - y0) / 600, 0.005), 0.02)
    x, y = np.median(shapely.get_coordinates(shapely.centroid(things)), axis=0)
    window.look_at(x, y, scale)
    return Shown(hypermap, window, scale)


def test_a_map_is_shown_and_answers(shown: Shown) -> None:
    check_colors(shown)
    check_clicks(shown)
    check_area(shown)
    check_names(shown)
    assert shown.window.hosts() == {"127.0.0.1"}
    assert shown.window.complaints == []


def check_colors(shown: Shown) -> None:
    shown.window.page.locator("#show-labels").uncheck()
    shown.window.wait_until_drawn()
    expected = Expected(shown.hypermap)
    points = [
        point for point in shown.places(60) if expected.is_plain(*point, shown.metres_per_pixel)
    ]
    assert len(points) >= 20
    wanted = np.array([expected.color(*point) for point in points])
    off_grid = np.isnan(wanted).any(axis=1)
    seen = shown.window.colors_at(points)
    assert np.abs(seen - wanted)[~off_grid].max() <= 3
    assert len(np.unique(wanted[~off_grid].round(), axis=0)) >= 3  # colors, not a blank page


def check_clicks(shown: Shown) -> None:
    for point in shown.places(3):
        clicked = shown.window.ask_at(*point)
        for layer in shown.hypermap:
            label = shown.hypermap.label_at(layer.name, [clicked])[0]
            said = shown.window.said(layer.name)
            assert said == ("No object here" if label == EMPTY else label), (layer.name, clicked)


def check_area(shown: Shown) -> None:
    left, bottom = shown.window.points_at([[340, 690]])[0]
    right, top = shown.window.points_at([[760, 110]])[0]
    shown.window.page.locator("#tool-rectangle").click()
    shown.window.drag((left, bottom), (right, top))
    shown.window.page.get_by_role("heading", name="In this area").wait_for()
    area = shapely.box(left, bottom, right, top)
    wanted = names_and_ids(shown.hypermap.objects(area=area))
    assert len(wanted) > 0
    assert Counter(shown.window.rows()) == Counter(wanted)
    # The mouse meets whole pixels, and a row of cells may end within one.
    pixel = (right - left) / (760 - 340)
    least, most = (
        Counter(shown.hypermap.labels_in("occupancy", area.buffer(by, join_style="mitre")).values)
        for by in (-pixel, pixel)
    )
    counts = shown.window.cell_counts()
    assert counts.keys() == most.keys()
    off = {k: (least[k], c, most[k]) for k, c in counts.items() if not least[k] <= c <= most[k]}
    assert not off


def check_names(shown: Shown) -> None:
    names = [name for name, _ in names_and_ids(shown.hypermap.objects())]
    name = Counter(names).most_common(1)[0][0]
    clicked = shown.window.ask_at(*shown.places(1)[-1])
    shown.window.find(name)
    wanted = shown.hypermap.objects(name, near=clicked)
    assert shown.window.found_ids() == [number for _, number in names_and_ids(wanted)][:100]


def names_and_ids(things: list[Found]) -> list[tuple[str, int]]:
    objects = [found.object for found in things]
    return [(thing.name, int(thing.id or 0)) for thing in objects if thing is not None]
