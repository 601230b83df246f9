"""A map that others change, in a real browser: changes show by themselves, areas are covered."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
import shapely
from playwright.sync_api import Browser, expect
from shapely.geometry.base import BaseGeometry

from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.exploration.coverage import LAYER, AreaToMap, Coverage
from hypermap.testing import square
from hypermap.viewer.live.app import MapApp
from hypermap.viewer.live.followed_map import FollowedMap
from hypermap.viewer.live.serving import listen, serving, url_of

from .page_tools import Window, a_window

pytestmark = pytest.mark.xdist_group("page")


class Robot:
    """A robot on a free floor of 10 x 8 m with a cup, which maps what it is told to."""

    name, address = "robot.hmap", "/maps/robot.hmap"

    def __init__(self) -> None:
        cells = np.zeros((80, 100), dtype=np.int8)
        grid = OccupancyLayer("occupancy", "map", GridGeometry(100, 80, 0.1), cells)
        things = SemanticLayer("semantic", "map", [square("cup", 2, 2, 0.5)])
        self.hypermap = Hypermap([grid, things])
        self._area: AreaToMap | None = None

    def begin(self, area: BaseGeometry) -> None:
        self._area, layer = AreaToMap.begun(self.hypermap, area)
        self.hypermap = self.hypermap.with_layers([*self.hypermap, layer])

    def coverage(self) -> Coverage | None:
        return None if self._area is None else self._area.coverage(self.hypermap)

    def see(self, area: BaseGeometry) -> None:
        assert self._area is not None
        layer = self._area.covered(area, self.hypermap, self.hypermap[LAYER])
        self.hypermap = self.hypermap.with_layer(layer)

    def find(self, name: str, x: float, y: float) -> None:
        known = self.hypermap["semantic"]
        assert isinstance(known, SemanticLayer)
        things = [known.get(number) for number in known.ids.tolist()]
        new = SemanticLayer("semantic", "map", [*things, square(name, x, y, 0.5)])
        self.hypermap = self.hypermap.with_layer(new)


@pytest.fixture
def robot() -> Robot:
    return Robot()


@pytest.fixture
def window(browser: Browser, robot: Robot) -> Iterator[Window]:
    app = MapApp(FollowedMap(robot), areas=robot)
    with (
        listen("127.0.0.1", 0) as listening,
        serving(app, listening),
        a_window(browser, url_of(app, listening)) as window,
    ):
        window.look_at(5, 4, 0.015)
        yield window
        assert window.complaints == []


def test_what_the_camera_covers_of_an_area_is_seen_as_it_grows(window: Window, robot: Robot):
    page = window.page
    expect(page.locator("#tool-edit")).to_be_hidden()
    page.locator("#tool-cover").click()
    corners = [(3, 2), (7, 2), (7, 6), (3, 6)]
    for corner in corners:
        window.click_at(*corner)
        window.wait_until_no_double_click()
    page.keyboard.press("Enter")
    summary = page.locator("#panel .head p")
    expect(summary).to_have_text("0 % of the area is covered")
    assert robot.hypermap[LAYER]
    area = robot.coverage()
    assert area is not None
    assert area.area.symmetric_difference(shapely.Polygon(corners)).area < 0.5

    inside = [(4, 5), (6, 5)]
    window.wait_until_drawn()
    before = window.colors_at(inside).astype(int)
    robot.see(shapely.box(0, 0, 5, 8))
    expect(summary).to_have_text("50 % of the area is covered")
    window.wait_until_drawn()
    left, right = np.abs(window.colors_at(inside).astype(int) - before).max(axis=1)
    assert (left > 40, right < 8) == (True, True)  # what is covered is marked no more

    page.keyboard.press("Escape")
    page.locator("#tool-cover").click()  # says again how far it is
    expect(summary).to_have_text("50 % of the area is covered")


def test_what_others_find_shows_by_itself(window: Window, robot: Robot):
    expect(window.page.locator("#subtitle")).to_contain_text("1 object")
    robot.find("lamp", 6, 4)
    expect(window.page.locator("#subtitle")).to_contain_text("2 objects")
    window.find("lamp")
    assert window.found_ids() == [1]
