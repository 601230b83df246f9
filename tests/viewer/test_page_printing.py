"""The page on paper: the map in light colors, with title, date, scale bar and legend."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from playwright.sync_api import expect

from hypermap.colors import class_colors

from .page_tools import SIZE, Window, a_server
from .small_map import CHAIR, FLOOR, METRES_PER_PIXEL, PLACES, saved_small_map

pytestmark = pytest.mark.xdist_group("page")

SHARP = 3  # pixels of the printed picture for each one of the screen
BAR = 22  # rows of the screen below the map, where the scale bar lies
A4: Any = {"width": 703, "height": 1032}  # without margins


@pytest.fixture(scope="module")
def url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with a_server(saved_small_map(tmp_path_factory.mktemp("room"))) as url:
        yield url


def on_paper(window: Window) -> None:
    """Print, and look at the paper instead of the screen."""
    window.page.evaluate("() => window.dispatchEvent(new Event('beforeprint'))")
    window.page.emulate_media(media="print")
    window.page.set_viewport_size(A4)


def back(window: Window) -> None:
    """Return to the screen."""
    window.page.set_viewport_size(SIZE)
    window.page.emulate_media(media="screen")
    window.page.evaluate("() => window.dispatchEvent(new Event('afterprint'))")
    window.wait_until_drawn()


def picture(window: Window) -> NDArray[np.uint8]:
    """Return the printed picture of the map, shape (height, width, 3)."""
    data = window.page.locator("#paper canvas").evaluate("(canvas) => canvas.toDataURL()")
    with Image.open(io.BytesIO(base64.b64decode(data.split(",")[1]))) as image:
        return np.asarray(image.convert("RGB"))


def test_a_printed_map_is_light_and_has_its_title_date_scale_and_legend(window: Window) -> None:
    page = window.page
    page.locator("#theme").click()
    window.wait_until_drawn()
    before = window.picture()
    sidebar = page.locator("#sidebar").bounding_box()
    assert sidebar is not None
    left = sidebar["x"] + sidebar["width"]
    beside_the_name = np.add(PLACES[CHAIR], (-0.4, 0.4))
    pixels = SHARP * (window.pixels_of([beside_the_name, FLOOR]) - (left, 0))
    on_paper(window)
    for panel in ("#sidebar", "#toolbar", "#status"):
        expect(page.locator(panel)).to_be_hidden()
    expect(page.locator("#paper h1")).to_have_text("room.hmap")
    expect(page.locator("#paper header p")).to_contain_text("printed 20")
    for entry in ("desk", "chair", "cup", "Occupied"):
        expect(page.locator("#paper").get_by_text(entry, exact=True)).to_be_visible()
    box = page.locator("#paper canvas").bounding_box()
    assert box is not None
    assert box["x"] >= 0
    assert box["x"] + box["width"] <= A4["width"]
    drawn = picture(window)
    chair, floor = (drawn[row, column] for column, row in pixels.astype(int))
    np.testing.assert_allclose(chair, 255 * np.array(class_colors(["chair"])["chair"]), atol=3)
    assert floor.min() > 240
    is_bar = (drawn[SHARP * (SIZE["height"] + BAR)] < 100).all(axis=1)
    assert np.argmin(is_bar[SHARP:]) / SHARP * METRES_PER_PIXEL == pytest.approx(2, abs=0.05)
    back(window)
    np.testing.assert_array_equal(window.picture(), before)
    assert page.locator("#paper > *").count() == 0


def test_an_answer_is_printed_with_the_map_and_what_is_hidden_is_not(window: Window) -> None:
    page = window.page
    page.locator('[data-class="cup"] input').uncheck()
    window.find("chair")
    on_paper(window)
    expect(page.locator("#panel h2")).to_be_visible()
    expect(page.locator("#panel .snippets")).to_be_hidden()
    assert "cup" not in page.locator("#paper").inner_text().split()
    back(window)
