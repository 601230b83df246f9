"""The evidence panel of the page: observations of an object, and its shape by other methods."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from playwright.sync_api import Browser, Locator, expect

from .page_tools import Window, a_server, a_window
from .seen_map import HAS_NONE, saved_seen_map
from .small_map import CHAIR, CUP, DESK, METRES_PER_PIXEL, PLACES, saved_small_map
from .test_page_file import assert_nothing_was_fetched, export

pytestmark = pytest.mark.xdist_group("page")

HULL_EDGE = (8.0, 4.9)  # where only the hull of all looks has its outline
HULL_ONLY = (7.75, 5.2)  # what the last look alone shows


@pytest.fixture(scope="module")
def url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with a_server(saved_seen_map(tmp_path_factory.mktemp("seen"))) as url:
        yield url


def choose(window: Window, thing: int) -> None:
    """Click on an object, and choose it in the answer if it lies on another."""
    window.ask_at(*PLACES[thing])
    if thing == CUP:
        window.page.locator("#panel .object", has_text=f"id {thing} ").click()
    expect(window.page.locator("#panel .evidence .opener")).to_be_visible()


def open_evidence(window: Window, thing: int) -> Locator:
    choose(window, thing)
    window.page.locator("#panel .evidence .opener").click()
    expect(window.page.locator("#panel .outlines").first).to_be_visible()
    wait_until_still(window)
    return window.page.locator("#panel .evidence")


def wait_until_still(window: Window) -> None:
    """Wait for the end of the flight to the object, and for the drawing."""
    window.wait_until_at_rest()
    window.wait_until_drawn()


def switch(window: Window, outline: str) -> None:
    window.page.locator(f'#panel [data-outline="{outline}"] input').click()
    window.wait_until_drawn()


def color_at(window: Window, place: tuple[float, float]) -> NDArray[np.float64]:
    color: NDArray[np.float64] = window.colors_at([place])[0].astype(float)
    return color


def strokes_at(window: Window, place: tuple[float, float], color: str) -> int:
    """Return how many pixels near a place have a color of the style sheet, as "--votes"."""
    column, row = (round(value) for value in window.pixel_of(*place))
    near = window.picture()[row - 25 : row + 25, column - 25 : column + 25].astype(int)
    text = window.page.evaluate(
        "(name) => getComputedStyle(document.documentElement).getPropertyValue(name)", color
    )
    wanted = np.array([int(text.strip()[i : i + 2], 16) for i in (1, 3, 5)])
    return int((np.abs(near - wanted).max(axis=2) <= 6).sum())


def test_a_section_says_how_often_and_when_an_object_was_seen(window: Window) -> None:
    section = open_evidence(window, CHAIR)
    expect(section).to_contain_text("Seen 4 times")
    expect(section).to_contain_text("All 4 observations")
    assert section.locator(".timeline .look").count() == 4
    rows = {
        row.get_attribute("data-outline"): row.inner_text() for row in section.locator("li").all()
    }
    assert list(rows) == ["seen", "cameras", "in_map", "votes", "best_shape", "convex_hull"]
    assert "1 m²" in rows["in_map"]
    assert "the same" in rows["best_shape"]
    assert "1.5 m²" in rows["convex_hull"]
    assert "67 % overlap" in rows["convex_hull"]
    expect(section).to_contain_text("This map was made by: votes of the views.")
    expect(section.locator("pre code")).to_contain_text("evidence_of(1)")


def test_the_slider_and_a_click_choose_one_observation(window: Window) -> None:
    section = open_evidence(window, CHAIR)
    slider = section.get_by_label("Observation", exact=True)
    slider.fill("2")
    facts = section.locator(".look-facts")
    expect(facts).to_contain_text("Observation 2 of 4 at 0:02.0")
    expect(facts).to_contain_text("score 0.50, from 1.1 m away, 0.5 m²")
    assert section.locator(".timeline .look.chosen").count() == 1
    section.get_by_role("button", name="The next observation").click()
    expect(facts).to_contain_text("Observation 3 of 4 at 0:05.0")
    box = section.locator(".timeline").bounding_box()
    assert box is not None
    window.page.mouse.click(box["x"] + box["width"] - 6, box["y"] + 20)
    expect(facts).to_contain_text("Observation 4 of 4 at 1:05.0")
    expect(slider).to_have_value("4")
    section.get_by_role("button", name="The next observation").click()
    expect(facts).to_contain_text("All 4 observations")


def test_the_chosen_observation_stands_out_on_the_map(window: Window) -> None:
    section = open_evidence(window, CHAIR)
    edge = (8.0, 5.2)
    for outline in ("votes", "best_shape", "convex_hull", "in_map"):
        switch(window, outline)
    plain = strokes_at(window, edge, "--ink")
    section.get_by_label("Observation", exact=True).fill("4")
    window.wait_until_drawn()
    assert strokes_at(window, edge, "--ink") > plain + 60  # its outline
    section.get_by_label("Observation", exact=True).fill("1")
    window.wait_until_drawn()
    assert strokes_at(window, edge, "--ink") <= plain + 5


def test_seen_shapes_are_the_stronger_the_more_often_they_were_seen(window: Window) -> None:
    open_evidence(window, CHAIR)
    for outline in ("votes", "best_shape", "convex_hull", "in_map"):
        switch(window, outline)
    four, one = color_at(window, (6.75, 5.2)), color_at(window, HULL_ONLY)
    none = color_at(window, (8.2, 5.2))
    switch(window, "seen")
    assert np.abs(color_at(window, HULL_ONLY) - none).max() <= 2
    assert np.abs(one - none).max() > 3
    assert np.abs(four - color_at(window, (6.75, 5.2))).max() > 2 * np.abs(one - none).max()


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_each_outline_can_be_switched_off_and_on(window: Window, theme: str) -> None:
    if theme == "dark":
        window.page.locator("#theme").click()
    open_evidence(window, CHAIR)
    switch(window, "seen")
    shown = strokes_at(window, HULL_EDGE, "--convex-hull")
    assert shown > 40
    switch(window, "convex_hull")
    assert strokes_at(window, HULL_EDGE, "--convex-hull") == 0
    switch(window, "convex_hull")
    assert strokes_at(window, HULL_EDGE, "--convex-hull") == pytest.approx(shown, abs=10)


def test_cameras_stand_where_they_stood(window: Window) -> None:
    open_evidence(window, CHAIR)
    window.look_at(6.5, 5.5, 0.01)
    camera = (6.0, 7.0)
    before = color_at(window, camera)
    switch(window, "cameras")
    assert np.abs(before - color_at(window, camera)).max() > 60


def test_closing_puts_everything_away(window: Window) -> None:
    places = [(5.2, 6.3), PLACES[DESK], HULL_EDGE, HULL_ONLY]
    choose(window, CHAIR)
    window.wait_until_drawn()
    before = window.colors_at(places).astype(int)
    opener = window.page.locator("#panel .evidence .opener")
    opener.click()
    expect(window.page.locator("#panel .timeline")).to_be_visible()
    wait_until_still(window)
    window.look_at(5, 4, METRES_PER_PIXEL)
    behind = window.colors_at(places).astype(int)
    assert (np.abs(behind - before).max(axis=1)[:2] > 3).all()  # the rest of the map is veiled
    opener.click()
    window.wait_until_drawn()
    expect(window.page.locator("#panel .timeline")).to_be_hidden()
    assert np.abs(window.colors_at(places).astype(int) - before).max() <= 2

    opener.click()
    expect(window.page.locator("#panel .timeline")).to_be_visible()
    wait_until_still(window)
    window.page.get_by_role("button", name="Close (Esc)").click()
    window.look_at(5, 4, METRES_PER_PIXEL)
    after = window.colors_at(places).astype(int)
    assert np.abs(after - before).max() <= 2


def test_another_object_closes_what_was_open(window: Window) -> None:
    open_evidence(window, CHAIR)
    window.look_at(5, 4, METRES_PER_PIXEL)
    choose(window, DESK)
    expect(window.page.locator("#panel .timeline")).to_have_count(0)
    section = open_evidence(window, DESK)
    expect(section).to_contain_text("Seen once")
    expect(section.locator(".timeline .look")).to_have_count(1)


def test_an_object_without_evidence_says_so(window: Window) -> None:
    choose(window, HAS_NONE)
    window.page.locator("#panel .evidence .opener").click()
    expect(window.page.locator("#panel .evidence-body")).to_contain_text(
        "There is no evidence for this object; it may have been drawn by hand."
    )


def test_a_map_without_evidence_says_so(empty_window: Window, tmp_path: Path) -> None:
    with a_server(saved_small_map(tmp_path)) as url:
        window = empty_window
        window.load(url, (5, 4, METRES_PER_PIXEL))
        choose(window, CHAIR)
        window.page.locator("#panel .evidence .opener").click()
        expect(window.page.locator("#panel .evidence-body")).to_contain_text(
            "This map contains no evidence."
        )
        assert window.complaints == []


def test_what_is_open_stays_so_when_another_window_changes_the_map(
    browser: Browser, tmp_path: Path
) -> None:
    with (
        a_server(saved_seen_map(tmp_path)) as url,
        a_window(browser, url) as one,
        a_window(browser, url) as other,
    ):
        one.look_at(5, 4, METRES_PER_PIXEL)
        section = open_evidence(one, CHAIR)
        section.get_by_label("Observation", exact=True).fill("3")
        other.look_at(5, 4, METRES_PER_PIXEL)
        other.page.locator("#tool-edit").click()
        other.click_at(*PLACES[CHAIR])
        expect(other.page.locator("#object-name")).to_have_value("chair")
        other.page.locator("#object-name").fill("stool")
        other.page.locator("#object-name").press("Enter")
        expect(one.page.locator("#panel h2")).to_have_text("stool")
        expect(one.page.locator("#panel .look-facts")).to_contain_text("Observation 3 of 4")


def test_a_page_of_one_file_shows_evidence_too(browser: Browser, tmp_path: Path) -> None:
    url = export(saved_seen_map(tmp_path)).as_uri()
    with a_window(browser, url, offline=True) as window:
        window.look_at(5, 4, METRES_PER_PIXEL)
        section = open_evidence(window, CHAIR)
        expect(section).to_contain_text("Seen 4 times")
        expect(section.locator("pre code")).to_contain_text("evidence_of(1)")
        switch(window, "seen")
        assert strokes_at(window, HULL_EDGE, "--convex-hull") > 40
        window.look_at(5, 4, METRES_PER_PIXEL)
        choose(window, HAS_NONE)
        window.page.locator("#panel .evidence .opener").click()
        expect(window.page.locator("#panel .evidence-body")).to_contain_text("contains no evidence")
        assert_nothing_was_fetched(window)
