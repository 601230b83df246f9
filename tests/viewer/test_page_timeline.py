"""The timeline of the page, in a browser: the map as it was, and what changed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, expect

from hypermap import GridGeometry
from hypermap.core.value_layer import ValueLayer
from hypermap.formats import save_map

from .editing_tools import Edited
from .page_tools import Window, a_server, a_window
from .past_map import CHAIR_AFTER, CHAIR_BEFORE, PLANT_PLACE, past_map, saved_past_map
from .small_map import DESK, METRES_PER_PIXEL, PLACES

# Whether a sentence on what changed lies within its place, and not cut off.
ALL_SAID = """sentence => {
  const said = document.getElementById("what-changed");
  said.textContent = sentence;
  const text = document.createRange();
  text.selectNodeContents(said);
  const [{ left, right }, place] = [text, said.parentElement].map((e) => e.getBoundingClientRect());
  return left >= place.left - 1 && right <= place.right + 1;
}"""

pytestmark = pytest.mark.xdist_group("page")


@pytest.fixture(scope="module")
def url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    hypermap = past_map()
    undated = ValueLayer("warmth", "map", GridGeometry(4, 4, 1.0), np.full((4, 4), np.nan))
    path = tmp_path_factory.mktemp("past") / "room.hmap"
    save_map(hypermap.with_layers([*hypermap, undated]), path)
    with a_server(path) as url:
        yield url


def go_back(window: Window, steps: int) -> None:
    for _ in range(steps):
        window.page.keyboard.press("ArrowLeft")
    window.wait_until_drawn()


def what_is_at(window: Window, place: tuple[float, float]) -> str:
    window.ask_at(*place)
    return window.said("semantic")


def test_the_keyboard_leads_through_the_versions(window: Window) -> None:
    page = window.page
    expect(page.locator("#tool-history")).to_be_visible()
    page.keyboard.press("t")
    expect(page.locator("#version")).to_be_focused()
    expect(page.locator("#when")).to_contain_text("Now")
    go_back(window, 2)
    expect(page.locator("#when")).to_have_text("2025-11-25 08:00 tuesday")
    expect(page.locator("#what-changed")).to_have_text("1 moved, 1 gone, 1 added")
    expect(page.locator("#subtitle")).to_have_text("4 objects · 2025-11-25 08:00")
    assert page.evaluate(ALL_SAID, "1 gone, 2 first seen, 2 moved, 1 reshaped, 1 added")
    page.keyboard.press("Home")
    expect(page.locator("#when")).to_contain_text("2025-11-24 08:00 monday")
    expect(page.locator("#tool-edit")).to_be_hidden()
    of_today = page.locator("#values .of-today")  # in the card of measured values
    expect(of_today).not_to_have_attribute("hidden", "")
    page.keyboard.press("Escape")
    expect(of_today).to_have_attribute("hidden", "")
    expect(page.locator("#timebar")).to_be_hidden()
    expect(page.locator("#tool-edit")).to_be_visible()
    expect(page.locator("#subtitle")).to_have_text("4 objects · 10.0 × 8.0 m")


def test_answers_follow_the_version_that_is_shown(window: Window) -> None:
    assert what_is_at(window, CHAIR_BEFORE) == "No object here"
    window.page.locator("#tool-history").click()
    go_back(window, 3)
    assert what_is_at(window, CHAIR_BEFORE) == "chair"
    expect(window.page.locator("#panel pre code")).to_contain_text("at_version(")
    window.page.get_by_role("button", name="The next version").click()
    expect(window.page.locator("#panel h2")).not_to_have_text("chair")  # it is asked again


def test_the_map_shows_what_there_was_and_marks_what_changed(window: Window) -> None:
    places = [PLANT_PLACE, CHAIR_BEFORE, CHAIR_AFTER]
    now = window.colors_at(places).astype(int)
    window.page.locator("#tool-history").click()
    go_back(window, 3)
    window.look_at(5, 4, METRES_PER_PIXEL)
    first = window.colors_at(places).astype(int)
    assert np.abs(first - now).max(axis=1).min() > 60  # no plant, the chair where it was
    window.page.get_by_role("button", name="The next version").click()
    expect(window.page.locator("#what-changed")).to_have_text("1 moved, 1 gone, 1 added")
    window.wait_until_drawn()
    edge = (CHAIR_BEFORE[0], CHAIR_BEFORE[1] + 0.5)  # of the place where the chair was
    line = np.linspace((edge[0] - 0.4, edge[1]), (edge[0] + 0.4, edge[1]), 40)
    blue = np.abs(window.colors_at(line).astype(int) - [0, 115, 179]).max(axis=1) < 40
    assert 5 < blue.sum() < 40  # a dashed outline in the color of what was moved


def test_the_changes_of_a_version_are_listed_and_found_on_the_map(window: Window) -> None:
    page = window.page
    page.locator("#tool-history").click()
    go_back(window, 2)
    page.locator("#what-changed").click()
    rows = page.locator("#panel ol.changed button")
    expect(rows).to_have_count(3)
    assert [" ".join(text.split()) for text in rows.all_inner_texts()] == [
        "chair moved · by 2.50 m · 100 % sure",
        "cup gone",
        "plant added",
    ]
    rows.first.click()
    window.wait_until_at_rest()
    width, height = 1200, 800
    column, row = window.pixel_of(*CHAIR_AFTER)
    assert 0 < column < width
    assert 0 < row < height
    page.get_by_role("button", name="The next version").click()
    expect(rows).to_have_count(1)
    expect(rows).to_contain_text("desk → table")


def test_playing_ends_in_the_present(browser: Browser, url: str) -> None:
    with a_window(browser, url) as window:
        window.look_at(5, 4, METRES_PER_PIXEL)  # and stay there: other times end no movement
        page = window.page
        page.locator("#tool-history").click()
        page.clock.install()
        page.keyboard.press(" ")
        expect(page.locator("#when")).to_contain_text("monday")
        for text in ("tuesday", "2025-11-26 08:00", "Now"):
            page.clock.run_for(1300)
            expect(page.locator("#when")).to_contain_text(text)
        expect(page.get_by_role("button", name="Play (space)")).to_be_visible()
        assert window.complaints == []


def test_a_map_without_a_past_offers_none(edited: Edited) -> None:
    expect(edited.window.page.locator("#tool-history")).to_be_hidden()
    edited.window.page.keyboard.press("t")
    expect(edited.window.page.locator("#timebar")).to_be_hidden()


def test_saving_adds_a_version(empty_window: Window, tmp_path: Path) -> None:
    with a_server(saved_past_map(tmp_path)) as url:
        window = empty_window
        window.load(url, (5, 4, METRES_PER_PIXEL))
        page = window.page
        page.locator("#tool-edit").click()
        window.click_at(*PLACES[DESK])
        page.locator("#object-name").fill("bench")
        page.locator("#object-name").press("Enter")
        expect(page.locator("#subtitle")).to_contain_text("not saved")
        page.keyboard.press("Control+s")
        expect(page.locator("#subtitle")).not_to_contain_text("not saved")
        page.locator("#tool-history").click()
        expect(page.locator("#what-changed")).to_have_text("1 renamed")
        go_back(window, 1)
        expect(page.locator("#what-changed")).to_have_text("1 edited")
        assert window.complaints == []
