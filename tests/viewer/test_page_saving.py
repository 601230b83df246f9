"""Saving from the browser: files that others change, other names, and other maps that come."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from playwright.sync_api import Route, expect

from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.formats import open_map, save_map

from .editing_tools import (
    Edited,
    objects_of,
    rename,
    save,
    start_editing,
    take,
)
from .page_tools import SIZE, Window
from .small_map import CHAIR, DESK

pytestmark = pytest.mark.xdist_group("page")


def test_a_file_that_changed_on_disk_is_not_overwritten_unasked(edited: Edited) -> None:
    window = edited.window
    start_editing(window)
    take(window, CHAIR, "chair")
    rename(window, "armchair")
    changed = open_map(edited.path)
    layer = changed["semantic"]
    assert isinstance(layer, SemanticLayer)
    layer.remove([DESK])
    save_map(changed, edited.path)
    theirs = edited.path.read_bytes()
    expect(window.page.locator("#banner")).to_contain_text("has changed on disk")

    window.page.locator("#edit-save").click()
    dialog = window.page.get_by_role("dialog")
    expect(dialog).to_contain_text("changed")
    dialog.get_by_role("button", name="Cancel").click()
    assert edited.path.read_bytes() == theirs
    window.page.locator("#edit-save").click()
    dialog.get_by_role("button", name="Save as…").click()
    name_dialog = window.page.get_by_role("dialog").filter(has_text="In the same folder")
    name_dialog.get_by_label("Save as").fill("mine.hmap")
    name_dialog.get_by_role("button", name="Save").click()
    expect(window.page.locator("#title")).to_have_text("mine.hmap")
    assert edited.path.read_bytes() == theirs
    mine = objects_of(open_map(edited.path.with_name("mine.hmap")))
    assert mine[CHAIR].name == "armchair"
    assert DESK in mine


def test_a_restarted_server_that_refuses_the_page_is_said_to_be_one(edited: Edited) -> None:
    page = edited.window.page

    def refuse(route: Route) -> None:
        page.context.clear_cookies()  # the token of the server before
        route.fulfill(status=403)

    page.route("**/api/events", refuse)
    page.reload()
    expect(page.locator("#banner")).to_have_text(
        "The server was restarted. Open the address that it printed then."
    )


@pytest.mark.parametrize("width", [1200, 800])
def test_what_is_said_of_the_file_covers_no_answer(edited: Edited, width: int) -> None:
    page = edited.window.page
    page.set_viewport_size({"width": width, "height": 800})
    edited.window.find("chair")
    edited.path.unlink()
    expect(page.locator("#banner")).to_be_visible()
    said, *others = [
        shapely.box(box["x"], box["y"], box["x"] + box["width"], box["y"] + box["height"])
        for panel in ("#banner", "#panel", "#sidebar", "#toolbar", "#status .place")
        if (box := page.locator(panel).bounding_box()) is not None
    ]
    assert len(others) == 4
    for panel in others:
        assert not said.intersects(panel)
    assert not others[0].intersects(others[3])


def test_a_file_that_changed_on_disk_is_overwritten_if_asked(edited: Edited) -> None:
    window = edited.window
    start_editing(window)
    take(window, CHAIR, "chair")
    rename(window, "armchair")
    changed = open_map(edited.path)
    changed.semantic().remove([DESK])
    save_map(changed, edited.path)
    theirs = edited.path.read_bytes()
    expect(window.page.locator("#banner")).to_contain_text("has changed on disk")
    window.page.locator("#edit-save").click()
    window.page.get_by_role("dialog").get_by_role("button", name="Overwrite").click()
    expect(window.page.locator("#edit-save")).to_be_disabled()
    assert edited.objects()[CHAIR].name == "armchair"
    assert DESK in edited.objects()
    assert edited.path.with_name("room.hmap.bak").read_bytes() == theirs


def test_a_file_that_vanished_is_reported_and_can_be_saved_again(edited: Edited) -> None:
    window = edited.window
    start_editing(window)
    take(window, CHAIR, "chair")
    rename(window, "armchair")
    edited.path.unlink()
    expect(window.page.locator("#banner")).to_contain_text("was deleted from disk")
    window.page.locator("#edit-save").click()
    expect(window.page.locator("#edit-save")).to_be_disabled()
    assert edited.objects()[CHAIR].name == "armchair"


def save_as(window: Window, name: str) -> None:
    window.page.locator("#edit-save-as").click()
    window.page.get_by_role("dialog").get_by_label("Save as").fill(name)
    window.page.get_by_role("dialog").get_by_role("button", name="Save").click()


def test_a_map_is_saved_under_another_name(edited: Edited, other: Window) -> None:
    window, before = edited.window, edited.path.read_bytes()
    start_editing(window)
    take(window, CHAIR, "chair")
    rename(window, "armchair")
    save_as(window, "corrected")  # the ending is given by the page
    for page in (window.page, other.page):
        expect(page.locator("#title")).to_have_text("corrected.hmap")
    expect(window.page.locator("#edit-save")).to_be_disabled()
    assert edited.path.read_bytes() == before
    corrected = edited.path.with_name("corrected.hmap")
    assert objects_of(open_map(corrected))[CHAIR].name == "armchair"

    rename(window, "throne")
    save(window)  # goes on with the new file
    assert edited.path.read_bytes() == before
    assert objects_of(open_map(corrected))[CHAIR].name == "throne"


def test_another_name_that_is_in_use_or_leads_out_is_not_taken_unasked(edited: Edited) -> None:
    window, taken = edited.window, edited.path.with_name("taken.hmap")
    taken.write_bytes(b"mine")
    start_editing(window)
    save_as(window, "taken.hmap")
    dialog = window.page.get_by_role("dialog").filter(has_text="exists already")
    dialog.get_by_role("button", name="Cancel").click()
    assert taken.read_bytes() == b"mine"
    save_as(window, "../outside.hmap")
    expect(window.page.get_by_role("alert").filter(has_text="outside.hmap")).to_be_visible()
    assert not (edited.path.parent.parent / "outside.hmap").exists()
    save_as(window, "taken.hmap")
    dialog.get_by_role("button", name="Overwrite").click()
    expect(window.page.locator("#title")).to_have_text("taken.hmap")
    assert sorted(objects_of(open_map(taken))) == sorted(edited.objects())


def test_a_file_that_can_no_longer_be_read_is_reported_and_the_map_stays(edited: Edited) -> None:
    window = edited.window
    start_editing(window)
    take(window, CHAIR, "chair")
    rename(window, "armchair")
    edited.path.write_bytes(b"no map at all")
    banner = window.page.locator("#banner")
    expect(banner).to_contain_text("has changed on disk")
    banner.get_by_role("button", name="Reload").click()
    window.page.get_by_role("dialog").get_by_role("button", name="Reload").click()
    alert = window.page.get_by_role("alert").filter(has_text="room.hmap")
    expect(alert.last).to_contain_text("is not a zip archive")
    above, below = banner.bounding_box(), alert.last.bounding_box()
    assert above is not None
    assert below is not None
    assert above["y"] + above["height"] <= below["y"]  # neither covers the other
    expect(window.page.locator('[data-class="armchair"]')).to_be_attached()
    save_as(window, "rescued.hmap")
    expect(window.page.locator("#title")).to_have_text("rescued.hmap")
    assert objects_of(open_map(edited.path.with_name("rescued.hmap")))[CHAIR].name == "armchair"


def is_seen(window: Window, points: list[tuple[float, float]]) -> bool:
    """Whether all points lie in the window, and together fill a good part of it."""
    pixels = window.pixels_of(points)
    width, height = SIZE["width"], SIZE["height"]
    inside = (pixels >= 0).all() and (pixels < (width, height)).all()
    return bool(inside and np.ptp(pixels, axis=0).max() > height / 3)


def test_the_view_goes_to_another_map_that_comes_in_every_window(
    edited: Edited, other: Window
) -> None:
    far = SemanticObject("shelf", shapely.box(-300, 200, -280, 230))
    elsewhere = Hypermap([SemanticLayer("semantic", "map", [far])])
    windows = (edited.window, other)
    corners = [(-300.0, 200.0), (-280.0, 230.0)]
    assert not any(is_seen(window, corners) for window in windows)
    save_map(elsewhere, edited.path)
    edited.window.page.get_by_role("button", name="Reload").click()
    for window in windows:
        expect(window.page.locator('[data-class="shelf"]')).to_be_attached()
        window.wait_until_at_rest()
        assert is_seen(window, corners)


def test_the_view_stays_when_the_same_map_is_opened_anew_or_changed(edited: Edited) -> None:
    window = edited.window
    place = window.pixel_of(5, 4)
    hypermap = open_map(edited.path)
    hypermap["semantic"].rename(CHAIR, "armchair")
    save_map(hypermap, edited.path)
    window.page.get_by_role("button", name="Reload").click()
    expect(window.page.locator('[data-class="armchair"]')).to_be_attached()
    start_editing(window)
    take(window, CHAIR, "armchair")
    rename(window, "stool")
    expect(window.page.locator('[data-class="stool"]')).to_be_attached()
    window.wait_until_at_rest()
    assert window.pixel_of(5, 4) == pytest.approx(place)
