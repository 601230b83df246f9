"""Drawing zones and shapes in the browser, and what is refused there."""

from __future__ import annotations

import json

import numpy as np
import pytest
import shapely
from playwright.sync_api import expect

from hypermap.core.semantic import SemanticLayer
from hypermap.formats import open_map

from .editing_tools import (
    Edited,
    draw,
    save,
    start_editing,
)
from .page_tools import Window
from .small_map import CHAIR, PLACES

pytestmark = pytest.mark.xdist_group("page")


def test_a_zone_is_drawn_on_a_new_layer_of_its_own(edited: Edited, other: Window) -> None:
    window = edited.window
    start_editing(window)
    draw(window, "#edit-room", [(4.5, 4.2), (6.2, 4.2), (6.2, 6.8)])
    expect(window.page.locator("#object-new-layer")).to_be_hidden()
    window.page.locator("#object-layer").select_option(label="New layer…")
    window.page.locator("#object-name").fill("kitchen")
    window.page.locator("#object-new-layer").fill("occupancy")  # the grid has that name
    window.page.locator("#object-add").click()
    expect(window.page.locator("#object-new-layer:invalid")).to_be_visible()
    window.page.locator("#object-new-layer").fill("zones")
    window.page.locator("#object-add").click()
    shown = '[data-layer="zones"] [data-class="kitchen"]'
    expect(window.page.locator(shown)).to_be_attached()
    expect(other.page.locator(shown)).to_be_attached()
    save(window)
    zones = open_map(edited.path)["zones"]
    assert isinstance(zones, SemanticLayer)
    (zone,) = zones.objects()
    assert (zone.name, zone.tags) == ("kitchen", ("room",))
    assert zone.footprint.area == pytest.approx(1.7 * 2.6 / 2, rel=0.05)
    assert window.complaints == []
    window.page.locator("#edit-undo").click()
    expect(window.page.locator('[data-layer="zones"]')).to_have_count(0)
    expect(other.page.locator('[data-layer="zones"]')).to_have_count(0)


def test_a_drawing_that_is_refused_stays_to_be_corrected(edited: Edited) -> None:
    window = edited.window
    start_editing(window)
    draw(window, "#edit-polygon", [(4.5, 4.2), (6.2, 6.2), (6.2, 4.2), (4.5, 6.2)])
    window.page.locator("#object-name").fill("carpet")
    window.page.locator("#object-add").click()
    expect(window.page.get_by_role("alert").filter(has_text="crosses itself")).to_be_visible()
    window.wait_until_nothing_is_drawn()
    window.click_at(2.5, 2.5)  # a click next to it is not the end of it
    window.drag((6.2, 6.2), (5.3, 3.4))
    expect(window.page.locator("#object-name")).to_have_value("carpet")
    window.page.locator("#object-add").click()
    expect(window.page.locator('[data-class="carpet"]')).to_be_attached()
    expect(window.page.locator("#object-apply")).to_be_visible()  # it is in the hand
    save(window)
    (carpet,) = (item for item in edited.objects().values() if item.name == "carpet")
    wanted = shapely.Polygon([(4.5, 4.2), (5.3, 3.4), (6.2, 4.2), (4.5, 6.2)])
    assert carpet.footprint.symmetric_difference(wanted).area < 0.1 * wanted.area


def test_an_outline_of_too_many_corners_is_refused_where_it_is_drawn(edited: Edited) -> None:
    window = edited.window
    angles = np.linspace(0, 2 * np.pi, 2500, endpoint=False)
    ring = np.column_stack([5 + np.cos(angles), 4 + np.sin(angles)]).tolist()
    # As if so many corners had been clicked; the server's answer is real. (The page's own fetch is
    # what is changed: a request made just after a route was added can still pass it by.)
    window.page.evaluate(
        """body => {
            const fetched = window.fetch;
            window.fetch = (url, options) =>
                fetched(url, String(url).includes("api/area") ? { ...options, body } : options);
        }""",
        json.dumps({"polygon": ring}),
    )
    window.page.locator("#tool-rectangle").click()
    window.drag((4.0, 3.0), (6.0, 5.0))
    alert = window.page.get_by_role("alert").filter(has_text="2500 corners, more than 2000")
    expect(alert).to_be_visible()
    window.ask_at(*PLACES[CHAIR])  # and the page goes on
    assert window.said("semantic") == "chair"
