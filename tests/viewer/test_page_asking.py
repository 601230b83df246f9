"""Asking on the page: by the keyboard, near and inside things, in areas, and of unknown names."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from playwright.sync_api import Browser, Page, expect

from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.formats import open_map, save_map
from hypermap.testing import jpeg_picture, square

from .page_tools import Window, a_server, a_window
from .small_map import CHAIR, CUP, DESK, METRES_PER_PIXEL, PLACES, small_map
from .test_page_file import export
from .test_page_maps import names_and_ids

pytestmark = pytest.mark.xdist_group("page")

MONDAY = 1_779_112_920.0  # 2026-05-18 14:02 UTC, a Monday
WEDNESDAY = "2026-05-20T09:30:00Z"
ABROAD = {"timezone_id": "UTC", "locale": "de-DE"}  # the page speaks English anywhere


def a_room() -> Hypermap:
    """The small map, with a kitchen around desk and cup, and more known of the chair."""
    hypermap = small_map()
    things = hypermap.semantic()
    kitchen = square("kitchen", 3.0, 3.0, side=4.0)
    chair = replace(
        things.get(CHAIR),
        existence=5.0,
        first_seen=MONDAY - 3600,
        last_seen=MONDAY,
        tags=("seat",),
        confidence=(0.8,),
        attributes={"evidence": 39, "z_min": 0.0, "z_max": 0.9, "color": "red"},
    )
    things.update(CHAIR, chair)
    things.kept_pictures = {CHAIR: (jpeg_picture("red"), jpeg_picture("green", 2.0))}
    cups = [square("cup", x, 6.5, side=0.3) for x in (1.0, 8.0)]
    hypermap.add(SemanticLayer("more", "map", [kitchen, *cups]))
    return hypermap


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("asking") / "room.hmap"
    save_map(a_room(), path)
    return path


@pytest.fixture(scope="module")
def url(path: Path) -> Iterator[str]:
    with a_server(path) as url:
        yield url


@pytest.fixture(params=["served", "in a file"])
def either(
    browser: Browser, url: str, path: Path, request: pytest.FixtureRequest
) -> Iterator[Window]:
    """The page of a server, and that of one file, which answers by itself."""
    in_file = request.param == "in a file"
    html = path.with_suffix(".html")
    if in_file and not html.exists():
        export(path)
    with a_window(browser, html.as_uri() if in_file else url) as window:
        window.look_at(5, 4, METRES_PER_PIXEL)
        yield window
        assert window.complaints == []


@pytest.fixture
def empty_window(shared: Any) -> Iterator[Window]:
    with shared.window("abroad", partial(a_window, url=None, **ABROAD)) as window:
        yield window


def fill(page: Page, **fields: str) -> None:
    """Fill in the fields of a question, and ask."""
    if page.locator("#ask-fields").is_hidden():
        page.locator("#ask-more").click()
    for key in ("near", "within", "inside"):
        page.locator(f"#ask-{key}").fill(fields.get(key, ""))
    page.locator("#search").fill(fields.get("name", ""))
    page.locator("#ask-find").click()


def expect_title(page: Page, title: str) -> None:
    expect(page.locator("#panel h2")).to_have_text(title)


def test_combined_questions_are_answered_as_in_python(either: Window, path: Path) -> None:
    page, hypermap = either.page, open_map(path)
    start = either.ask_at(5.2, 6.3)
    page.keyboard.press("Escape")
    expect(page.locator("#panel")).to_be_hidden()
    start = either.ask_at(5.2, 6.3)  # the marked place

    def check(title: str, **asked: object) -> None:
        expect_title(page, title)
        wanted = hypermap.objects(**{"near": start, **asked})  # type: ignore[arg-type]
        assert either.found_ids() == [number for _, number in names_and_ids(list(wanted))]
        assert either.found_ids()

    fill(page, name="cup", near="chair")
    check("cup near chair", name="cup", near="chair")
    fill(page, name="cup", near="chair", within="1.6")
    check("cup within 1.6 m of chair", name="cup", near="chair", within=1.6)
    fill(page, name="cup", within="2.9")
    check("cup within 2.9 m of here", name="cup", within=2.9)
    fill(page, inside="kitchen")
    check("Anything inside kitchen", inside="kitchen")
    page.locator("#ask-rectangle").click()
    either.look_at(5, 4, METRES_PER_PIXEL)
    corners = either.points_at([[400, 700], [700, 300]])
    either.drag(*map(tuple, corners.tolist()))
    check(
        "Anything inside kitchen, in the area", inside="kitchen", area=shapely.box(*corners.ravel())
    )
    expect(page.locator("#panel pre code")).to_contain_text("inside=")
    page.locator("#ask-more").click()  # closed, the conditions hold no more
    either.find("cup")
    assert len(either.found_ids()) == 3


def test_of_an_unknown_name_the_page_offers_those_that_may_be_meant(either: Window) -> None:
    page = either.page
    fill(page, name="cup", near="ch")
    expect_title(page, "cup near ch")
    said = page.locator("#panel .unknown")
    expect(said).to_contain_text("No object is called “ch”. Did you mean:")
    assert said.get_by_role("button").all_inner_texts() == ["chair", "kitchen"]
    said.get_by_role("button", name="kitchen").click()
    expect_title(page, "cup near kitchen")
    expect(page.locator("#ask-near")).to_have_value("kitchen")
    assert len(either.found_ids()) == 3

    fill(page, name="cupp", near="chiar")
    expect_title(page, "cup near chair")
    expect(page.locator("#panel")).to_contain_text("No object is called “cupp”; showing “cup”.")
    expect(page.locator("#panel")).to_contain_text("“chiar”; showing “chair”.")
    fill(page, name="zebra")
    expect(said).to_contain_text("No object is called “zebra”. This map has:")
    said.get_by_role("button", name="desk").click()
    expect_title(page, "desk")
    expect(page.locator("#search")).to_have_value("desk")


@pytest.fixture
def on_wednesday(browser: Browser, url: str) -> Iterator[Window]:
    """A window of its own, as a clock that was set stays so."""
    with a_window(browser, url, **ABROAD) as window:
        window.look_at(5, 4, METRES_PER_PIXEL)
        window.page.clock.set_fixed_time(WEDNESDAY)
        yield window
        assert window.complaints == []


def test_one_hit_shows_its_facts_at_once_in_words_and_units(on_wednesday: Window) -> None:
    window, page = on_wednesday, on_wednesday.page
    facts = page.locator("#panel dl.facts")

    def shown() -> dict[str, str]:
        keys, values = (facts.locator(tag).all_inner_texts() for tag in ("dt", "dd"))
        return dict(zip(keys, values, strict=True))

    window.ask_at(*PLACES[CHAIR])
    expected = {
        "Certainty": "certainly there (log-odds 5)",
        "Seen": "39 times, last Monday 14:02",
        "First seen": "Monday 13:02",
        "Area": "1 m²",
        "Middle": "x 7.00, y 5.00 m in map",
        "Height": "0.00 to 0.90 m",
        "Tags": "seat (80 %)",
        "Color": "red",
    }
    assert shown() == expected
    pictures = page.locator("#panel .pictures img")
    expect(pictures).to_have_count(2)
    assert [one.get_attribute("alt") for one in pictures.all()] == [
        "chair, picture 1",
        "chair, picture 2",
    ]
    for one in pictures.all():
        expect(one).to_have_js_property("naturalWidth", 48)
    assert window.said("occupancy") == "Free"
    window.find("desk")
    expect(facts).to_contain_text("2 m²")
    expect(pictures).to_have_count(0)
    window.ask_at(*PLACES[CUP])  # on the desk and in the kitchen: no single one
    expect(facts).to_have_count(0)
    assert page.locator("#panel .objects button").count() == 3


def test_the_keyboard_alone_asks_walks_through_hits_and_opens_them(window: Window) -> None:
    page = window.page
    page.keyboard.press("/")
    page.keyboard.type("cu")
    page.keyboard.press("Enter")
    expect_title(page, "cup")
    hits = page.locator("#panel ol.found button")
    expect(hits.nth(0)).to_be_focused()
    page.keyboard.press("ArrowDown")
    expect(hits.nth(1)).to_be_focused()
    page.keyboard.press("End")
    expect(hits.nth(2)).to_be_focused()
    page.keyboard.press("ArrowDown")  # there is no fourth
    expect(hits.nth(2)).to_be_focused()
    page.keyboard.press("ArrowUp")
    number, layer = (hits.nth(1).get_attribute(f"data-{key}") for key in ("id", "layer"))
    page.keyboard.press("Enter")
    expect(page.locator("#panel .head p")).to_have_text(f"Object {number} of {layer}")
    expect(page.locator("#panel [data-back]")).to_be_focused()
    page.keyboard.press("Enter")
    expect(hits.nth(1)).to_be_focused()
    page.keyboard.press("Escape")
    expect(page.locator("#panel")).to_be_hidden()
    expect(page.locator("#search")).to_be_focused()
    page.keyboard.press("Escape")
    expect(page.locator("#search")).not_to_be_focused()


def test_the_hit_that_the_keyboard_is_on_stands_out_on_the_map(window: Window) -> None:
    window.find("cup")

    def disc(x: float, y: float) -> np.ndarray:
        column, row = (round(value) for value in window.pixel_of(x, y))
        return window.picture()[row - 28 : row - 6, column - 11 : column + 11].astype(int)

    window.wait_until_drawn()
    first, second = (np.array(disc(x, 6.5)) for x in (1.0, 8.0))
    window.page.keyboard.press("ArrowDown")
    window.page.keyboard.press("ArrowDown")
    window.wait_until_drawn()
    changed = [np.abs(disc(x, 6.5) - one).max() for x, one in ((1.0, first), (8.0, second))]
    assert max(changed) > 60


def test_the_map_makes_room_for_the_panel(browser: Browser, url: str) -> None:
    with a_window(browser, url) as window:
        corners = [(0.05, 0.05), (9.95, 7.95)]

        def covered() -> bool:
            panel = window.page.locator("#panel").bounding_box()
            (left, _), (right, _) = (window.pixel_of(*corner) for corner in corners)
            assert left > 300
            return panel is not None and right > panel["x"]

        before = window.pixels_of(corners)
        window.ask_at(9.0, 6.0)  # where the panel comes to lie
        window.wait_for("() => !window.hypermapPage.map.getView().getAnimating()")
        assert not covered()
        window.page.keyboard.press("Escape")
        window.wait_for("() => !window.hypermapPage.map.getView().getAnimating()")
        assert window.pixels_of(corners) == pytest.approx(before, abs=1)

        window.look_at(5, 4, METRES_PER_PIXEL)  # a view that someone has chosen stays
        before = window.pixels_of(corners)
        window.ask_at(*PLACES[DESK])
        assert window.pixels_of(corners) == pytest.approx(before, abs=1)


def test_a_question_in_english_is_answered_in_the_same_field(window: Window, path: Path) -> None:
    page = window.page
    field = page.locator("#search")
    expect(field).to_have_attribute("placeholder", "Find, or ask a question")
    window.ask_at(7.5, 6.3)
    page.keyboard.press("Escape")
    field.fill("where are the cups?")
    field.press("Enter")
    expect_title(page, "where are the cups?")
    cups = open_map(path).objects("cup")
    assert sorted(window.found_ids()) == sorted(item.object.id for item in cups)
    page.locator("#panel summary").click()
    expect(page.locator("#panel details dd").first).to_have_text("which objects")

    field.fill("how many cups are there?")
    field.press("Enter")
    expect(page.locator("#panel p.answer")).to_have_text(str(len(cups)))

    field.fill("sing me a song?")
    field.press("Enter")
    panel = page.locator("#panel")
    expect(panel.locator("header p")).to_have_text("This question could not be answered")
    expect(panel.locator(".panel-scroll")).to_contain_text("sing")
    (complaint,) = window.complaints
    assert "400 (Bad Request)" in complaint
    window.complaints.clear()

    field.fill("cup")  # a name is still a name
    field.press("Enter")
    expect_title(page, "cup")


def test_a_page_of_one_file_finds_names_alone(browser: Browser, path: Path) -> None:
    html = path.with_suffix(".html")
    if not html.exists():
        export(path)
    with a_window(browser, html.as_uri()) as window:
        expect(window.page.locator("#search")).to_have_attribute("placeholder", "Find by name")
        assert window.complaints == []
