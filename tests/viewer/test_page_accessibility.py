"""What axe-core finds wrong for those who use the page by keyboard or screen reader: nothing.

Source: https://github.com/dequelabs/axe-core; `make page` fetches it.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, expect

from hypermap import Hypermap, SemanticLayer, save_map
from hypermap.testing import square

from .page_tools import PATIENCE, SIZE, Window, a_server, a_window
from .past_map import past_map
from .run_tools import watching, write_run
from .seen_map import saved_seen_map
from .small_map import CHAIR, METRES_PER_PIXEL, PLACES

pytestmark = pytest.mark.xdist_group("page")

AXE = Path(__file__).resolve().parents[2] / "page" / "node_modules" / "axe-core" / "axe.min.js"
SIDES = """(all) => all.map((one) => one.getBoundingClientRect())
    .map(({left, right}) => [left, right])"""
NARROW = {"width": 420, "height": 800}
FIND = """async (isOfColorsAlone) => {
    // Whoever speaks to the page says the words on a button; axe asks for them only if configured.
    const rules = {"label-content-name-mismatch": {enabled: true}};
    const all = {rules, resultTypes: ["violations", "incomplete"]};
    const ofColors = ["color-contrast", "link-in-text-block"];
    const colors = {...all, runOnly: {type: "rule", values: ofColors}};
    const {violations, incomplete} = await axe.run(document, isOfColorsAlone ? colors : all);
    const unsure = incomplete.filter(({id}) => id.startsWith("aria-"));
    return [...violations, ...unsure].flatMap(
        ({id, nodes}) => nodes.map(({html}) => `${id}: ${html}`));
}"""


@contextlib.contextmanager
def a_context(browser: Browser, scheme: str, size: object = SIZE) -> Iterator[BrowserContext]:
    """Yield a context whose pages know axe-core."""
    if not AXE.is_file():
        pytest.skip("axe-core is not installed: scripts/page.sh")
    context = browser.new_context(viewport=size, color_scheme=scheme, reduced_motion="reduce")
    with contextlib.closing(context):
        context.set_default_timeout(1000 * PATIENCE)
        context.add_init_script(AXE.read_text(encoding="utf-8"))
        yield context


def found(page: Page, *, is_of_colors_alone: bool = False) -> list[str]:
    complaints: list[str] = page.evaluate(FIND, is_of_colors_alone)
    return complaints


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_of_a_map_has_no_findings(browser: Browser, tmp_path: Path, scheme: str) -> None:
    path = saved_seen_map(tmp_path)
    with a_server(path) as url, a_context(browser, scheme) as context:
        window = Window(context, url)
        page = window.page
        # The dark page differs in its colors alone.
        look = partial(found, page, is_of_colors_alone=scheme == "dark")
        assert look() == [], "the map alone"
        page.locator("#ask-more").click()
        page.locator("#search").fill("e")
        expect(page.locator("#suggestions")).to_be_visible()
        assert look() == [], "conditions and suggestions"
        page.locator("#search").press("Enter")
        expect(page.locator("#panel .unknown, #panel ol.found")).to_be_visible()
        assert look() == [], "a name that is not known"
        window.look_at(5, 4, METRES_PER_PIXEL)
        window.ask_at(*PLACES[CHAIR])
        assert look() == [], "an answer"
        page.locator("#panel .evidence .opener").click()
        expect(page.locator("#panel .outlines").first).to_be_visible()
        assert look() == [], "evidence"
        window.find("chair")
        assert look() == [], "matches"
        window.look_at(5, 4, METRES_PER_PIXEL)
        page.locator("#tool-rectangle").click()
        window.drag((2, 2), (7.6, 5.6))
        expect(page.locator("table.rows")).to_be_visible()
        assert look() == [], "a table"
        page.locator("#tool-edit").click()
        window.wait_until_nothing_is_drawn()
        window.click_at(*PLACES[CHAIR])
        page.locator("#object-name").fill("armchair")
        assert look() == [], "a form"
        page.locator("#object-apply").click()
        expect(page.locator("#edit-save")).to_be_enabled()
        os.utime(path, (1, 1))
        path.write_bytes(path.read_bytes() + b"\n")
        expect(page.locator("#banner")).to_be_visible()
        assert look() == [], "a banner"
        page.locator("#edit-save").click()
        expect(page.get_by_role("dialog")).to_be_visible()
        assert look() == [], "a dialog"


def test_the_page_of_a_run_has_no_findings(browser: Browser, tmp_path: Path) -> None:
    with watching(write_run(tmp_path / "drive", 8, 3), tmp_path / "room.hmap") as watched:
        watched.wait_for("the run stays at")
        for size in (SIZE, NARROW):
            with a_context(browser, "light", size) as context:
                page = context.new_page()
                page.goto(watched.url)
                expect(page.locator("#state")).to_have_text("saved room.hmap")
                expect(page.locator("#seen li").first).to_be_attached()
                assert found(page) == []


def test_a_narrow_page_has_no_findings(browser: Browser, tmp_path: Path) -> None:
    with a_server(saved_seen_map(tmp_path)) as url, a_context(browser, "light", NARROW) as context:
        window = Window(context, url)
        assert found(window.page) == []
        window.page.locator("#menu").click()
        assert found(window.page) == []


def test_all_tools_fit_on_a_phone(browser: Browser, tmp_path: Path) -> None:
    path = tmp_path / "room.hmap"
    save_map(past_map(), path)  # with a history, which has a tool of its own
    with a_server(path) as url, a_window(browser, url) as window:
        window.page.set_viewport_size({"width": 360, "height": 640})
        window.page.locator("#tool-edit").click()
        expect(window.page.locator("#tool-history")).to_be_visible()
        for bar in ("#toolbar", "#editbar"):
            sides = window.page.locator(f"{bar}, {bar} > button").evaluate_all(SIDES)
            (left, right), *buttons = [side for side in sides if side[1] > 0]
            assert left >= 0
            assert right <= 360
            assert all(left <= side[0] and side[1] <= right for side in buttons)


def test_tab_comes_to_the_tools_before_the_many_classes(browser: Browser, tmp_path: Path) -> None:
    path = tmp_path / "zones.hmap"
    zones = [square(f"zone {i}", 2 * i, 0) for i in range(100)]
    save_map(Hypermap([SemanticLayer("zones", "map", zones)]), path)
    with a_server(path) as url, a_window(browser, url) as window:
        page = window.page
        page.locator("#map").focus()
        page.keyboard.press("Tab")
        expect(page.locator("#toolbar button:visible").first).to_be_focused()
        page.locator("#tool-edit").focus()
        page.keyboard.press("Enter")
        page.locator("#theme").focus()
        page.keyboard.press("Tab")  # to the bar of the editor, which lies below
        expect(page.locator("#editbar button:enabled").first).to_be_focused()
