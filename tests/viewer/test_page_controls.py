"""The controls of the page: layers, classes, labels, themes, coordinates, scale, grid lines."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from hypermap.colors import class_colors
from hypermap.core.semantic import SemanticLayer
from hypermap.formats import save_map
from hypermap.testing import square

from .page_tools import Window, a_server
from .screen_colors import Expected
from .small_map import (
    CHAIR,
    CUP,
    DESK,
    EVIL,
    FLOOR,
    METRES_PER_PIXEL,
    PLACES,
    saved_small_map,
    small_map,
)

pytestmark = pytest.mark.xdist_group("page")

EXPECTED = Expected(small_map())
WHITE = np.array([255.0] * 3)


@pytest.fixture(scope="module")
def url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with a_server(saved_small_map(tmp_path_factory.mktemp("room"))) as url:
        yield url


def color_beside_the_label(window: Window, thing: int) -> NDArray[np.float64]:
    """Return the color of an object near its upper left corner, where no label is."""
    x, y = PLACES[thing]
    color: NDArray[np.float64] = window.colors_at([[x - 0.4, y + 0.4]])[0].astype(float)
    return color


def color_of(thing: int) -> NDArray[np.float64]:
    x, y = PLACES[thing]
    return EXPECTED.color(x - 0.4, y + 0.4)


def assert_alike(seen: NDArray[np.float64], wanted: NDArray[np.float64]) -> None:
    assert np.abs(seen - wanted).max() <= 3, (seen, wanted)


def test_a_layer_and_a_class_can_be_switched_off_and_on(window: Window) -> None:
    page = window.page
    assert_alike(color_beside_the_label(window, CHAIR), color_of(CHAIR))

    page.get_by_label("Show layer semantic").uncheck()
    window.wait_until_drawn()
    assert_alike(color_beside_the_label(window, CHAIR), WHITE)
    page.get_by_label("Show layer semantic").check()
    window.wait_until_drawn()
    assert_alike(color_beside_the_label(window, CHAIR), color_of(CHAIR))

    page.locator('[data-class="chair"] input').uncheck()
    window.wait_until_drawn()
    assert_alike(color_beside_the_label(window, CHAIR), WHITE)
    assert_alike(color_beside_the_label(window, DESK), color_of(DESK))

    page.get_by_role("button", name="None", exact=True).click()
    window.wait_until_drawn()
    assert_alike(color_beside_the_label(window, DESK), WHITE)
    page.get_by_role("button", name="All", exact=True).click()
    window.wait_until_drawn()
    for thing in (CHAIR, DESK):
        assert_alike(color_beside_the_label(window, thing), color_of(thing))


def test_opacity_mixes_a_layer_with_what_is_below(window: Window) -> None:
    window.page.get_by_label("Opacity of layer semantic").fill("50")
    window.wait_until_drawn()
    assert_alike(color_beside_the_label(window, CHAIR), (color_of(CHAIR) + WHITE) / 2)


def test_labels_grow_and_can_be_left_out(window: Window) -> None:
    def picture() -> NDArray[np.int64]:
        window.wait_until_drawn()
        column, row = (round(value) for value in window.pixel_of(*PLACES[CHAIR]))
        return window.picture()[row - 60 : row + 60, column - 60 : column + 150].astype(np.int64)

    def ink(seen: NDArray[np.int64]) -> int:
        return int((np.abs(seen - bare).max(axis=2) > 30).sum())

    window.page.locator("#show-labels").uncheck()
    bare = picture()
    window.page.locator("#show-labels").check()
    inks = []
    for size in ("9", "13", "24"):
        window.page.locator("#label-size").fill(size)
        inks.append(ink(picture()))
    assert 20 < inks[0] < inks[1] < inks[2]


def test_the_page_is_dark_or_light_as_asked_and_stays_so(window: Window) -> None:
    def lightness() -> float:
        picture = window.picture()[200:600, 8:250]  # the list of layers
        return float(np.median(picture))

    def switch() -> None:
        window.page.locator("#theme").click()
        window.wait_until_drawn()

    light = lightness()
    switch()
    dark = lightness()
    assert light > 200 > 80 > dark
    ground = window.colors_at([FLOOR])[0].astype(float)  # at night the floor is dark
    assert ground.max() < 80
    own = 255 * np.array(class_colors(["chair"])["chair"])
    assert_alike(color_beside_the_label(window, CHAIR), own)
    window.page.reload()
    window.wait_until_drawn()
    assert lightness() == pytest.approx(dark, abs=5)
    switch()
    assert lightness() == pytest.approx(light, abs=5)


def test_coordinates_and_scale_are_those_of_the_map(window: Window) -> None:
    page = window.page
    column, row = np.round(window.pixel_of(*FLOOR)).tolist()
    page.mouse.move(column - 1, row)
    page.mouse.move(column, row)
    x, y = window.points_at([[column, row]])[0]
    window.wait_for(
        """(wanted) => {
            const said = document.querySelector("#coordinates").textContent;
            const numbers = said.replaceAll("\u2212", "-").match(/-?\\d+\\.\\d+/g) ?? [];
            return numbers.length === 2 &&
                numbers.every((number, i) => Math.abs(number - wanted[i]) < 0.01);
        }""",
        [x, y],
    )

    length, unit = re.fullmatch(
        r"([\d.]+) (\w+)", page.locator("#scale-text").inner_text()
    ).groups()
    bar = page.locator("#scale-bar").bounding_box()
    meters = float(length) * {"m": 1, "cm": 0.01, "km": 1000}[unit]
    assert bar is not None
    assert bar["width"] * METRES_PER_PIXEL == pytest.approx(meters, rel=0.05)


def test_grid_lines_lie_at_whole_metres(window: Window) -> None:
    def along(y: float) -> NDArray[np.int64]:
        row = round(window.pixel_of(0, y)[1])
        return window.picture()[row].astype(np.int64)

    window.page.locator("#show-labels").uncheck()
    window.wait_until_drawn()
    y = 6.63  # between two lines, and no object is here
    before = along(y)
    window.page.locator("#show-grid").check()
    window.wait_until_drawn()
    changed = np.abs(along(y) - before).max(axis=1) > 5
    assert changed[round(window.pixel_of(5, y)[0]) + np.arange(-1, 2)].any()
    lines = window.points_at([[column, 0] for column in np.flatnonzero(changed)])[:, 0]
    steps = np.abs(lines - np.round(lines * 2) / 2)
    assert (steps < 2 * METRES_PER_PIXEL).all()


def test_a_name_is_text_and_never_runs(window: Window) -> None:
    page = window.page
    window.ask_at(*PLACES[3])
    assert window.said("semantic") == EVIL
    assert page.locator("#panel h2").inner_text() == EVIL
    assert page.locator("#layers [data-class] .name").all_inner_texts().count(EVIL) == 1
    page.locator("#search").fill("img")
    assert EVIL in page.locator("#suggestions .name").all_inner_texts()
    page.locator("#search").press("Enter")
    page.locator("#panel ol.found button").click()
    assert page.locator("img, script:not([src])").count() == 0
    assert page.evaluate("window.hacked") is None


def test_found_things_come_into_view_if_none_of_them_is(window: Window) -> None:
    def place() -> list[float]:
        said: list[float] = window.page.evaluate(
            "() => [...window.hypermapPage.map.getView().getCenter(), "
            "window.hypermapPage.map.getView().getResolution()]"
        )
        return said

    before = place()
    window.find("chair")
    window.wait_until_drawn()
    assert place() == before  # it was in view

    window.look_at(200, -100, 0.002)
    window.find("desk")
    window.wait_until_at_rest()
    window.wait_until_drawn()
    pixel = window.pixel_of(*PLACES[DESK])
    assert place()[2] == pytest.approx(0.01)  # near enough, and not nearer
    assert any(np.hypot(*(window.bare_pixels() - pixel).T) < 20)  # no panel covers it


def test_a_thing_on_another_of_about_its_size_is_seen_whole(
    empty_window: Window, tmp_path: Path
) -> None:
    things = [square("a mat", 5, 4, 1.5), square("rug", 5, 4, 1.9)]
    hypermap = small_map()
    hypermap.remove("semantic")
    hypermap.add(SemanticLayer("semantic", "map", things))
    save_map(hypermap, tmp_path / "room.hmap")
    own = {name: 255 * np.array(color) for name, color in class_colors(["a mat", "rug"]).items()}
    with a_server(tmp_path / "room.hmap") as url:
        window = empty_window
        window.load(url, (5, 4, METRES_PER_PIXEL))
        window.page.locator("#show-labels").uncheck()
        window.wait_until_drawn()
        on_mat, on_rug = window.colors_at([(5, 4), (5, 4.85)]).astype(float)
        along = np.linspace(5.7, 5.8, 30)
        across = window.colors_at(np.column_stack([along, np.full(30, 4.0)])).astype(float)
    assert_alike(on_mat, own["a mat"])
    assert_alike(on_rug, own["rug"])
    brightness = [color.sum() for color in (on_mat, on_rug)]
    assert across.sum(axis=1).min() < 0.8 * min(brightness), "an outline parts them"


def test_the_name_of_a_small_thing_stands_beside_it_and_not_on_it(window: Window) -> None:
    page = window.page

    def box(x: float, y: float) -> NDArray[np.int64]:
        """Return what is seen of the cup, less its outline."""
        window.wait_until_drawn()
        column, row = (round(value) for value in window.pixel_of(x, y))
        return window.picture()[row - 7 : row + 8, column - 7 : column + 8].astype(np.int64)

    def around(x: float, y: float) -> NDArray[np.int64]:
        column, row = (round(value) for value in window.pixel_of(x, y))
        return window.picture()[row - 30 : row + 30, column - 60 : column + 60].astype(np.int64)

    page.locator("#show-labels").uncheck()
    bare = box(*PLACES[CUP])
    page.locator("#show-labels").check()
    named = box(*PLACES[CUP])
    assert np.abs(named - bare).max() <= 3, "no letter lies on the cup"
    page.locator('[data-class="desk"] input').uncheck()  # and with it, its name
    page.locator("#show-labels").uncheck()
    window.wait_until_drawn()
    ground = around(*PLACES[CUP])
    page.locator("#show-labels").check()
    window.wait_until_drawn()
    ink = np.abs(around(*PLACES[CUP]) - ground).max(axis=2) > 30
    assert ink.sum() > 20, "its name is there"
