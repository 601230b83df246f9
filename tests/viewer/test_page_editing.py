"""Changing a map in the browser: what is drawn, what is saved, and what another window sees."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import shapely
from playwright.sync_api import Browser, expect

from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.formats import open_map, save_map

from .page_tools import SIZE, Window, a_server, a_window
from .screen_colors import Expected
from .small_map import (
    CHAIR,
    CUP,
    DESK,
    EVIL,
    METRES_PER_PIXEL,
    PLACES,
    saved_small_map,
)

pytestmark = pytest.mark.xdist_group("page")


@dataclass
class Edited:
    """A saved map, the page's address, and a window that shows it."""

    path: Path
    url: str
    window: Window

    def objects(self) -> dict[int, SemanticObject]:
        """Return what the file holds, by id."""
        return objects_of(open_map(self.path))


def objects_of(hypermap: Hypermap) -> dict[int, SemanticObject]:
    layer = hypermap["semantic"]
    assert isinstance(layer, SemanticLayer)
    return {int(item.id or 0): item for item in layer.objects()}


@pytest.fixture
def edited(browser: Browser, tmp_path: Path) -> Iterator[Edited]:
    path = saved_small_map(tmp_path)
    with a_server(path) as url, a_window(browser, url) as window:
        window.look_at(5, 4, METRES_PER_PIXEL)
        yield Edited(path, url, window)
        assert window.hosts() == {"127.0.0.1"}


@pytest.fixture
def other(browser: Browser, edited: Edited) -> Iterator[Window]:
    with a_window(browser, edited.url) as window:
        window.look_at(5, 4, METRES_PER_PIXEL)
        yield window


def start_editing(window: Window) -> None:
    window.page.locator("#tool-edit").click()
    expect(window.page.locator("#editbar")).to_be_visible()


def take(window: Window, thing: int, name: str) -> None:
    """Click on an object in edit mode."""
    window.wait_until_nothing_is_drawn()
    window.click_at(*PLACES[thing])
    expect(window.page.locator("#object-name")).to_have_value(name)


def rename(window: Window, name: str) -> None:
    window.page.locator("#object-name").fill(name)
    apply(window)
    expect(window.page.locator("#panel h2")).to_have_text(name)


def apply(window: Window) -> None:
    """Change what an object is called or tagged, and wait until it is shown as it is then."""
    button = window.page.locator("#object-apply").element_handle()
    button.click()
    window.wait_for("(button) => !button.isConnected", button)


def save(window: Window) -> None:
    window.page.locator("#edit-save").click()
    expect(window.page.locator("#edit-save")).to_be_disabled()


def add_rectangle(window: Window, x0: float, y0: float, x1: float, y1: float, name: str) -> None:
    window.page.locator("#edit-rectangle").click()
    window.drag((x0, y0), (x1, y1))
    window.page.locator("#object-name").fill(name)
    window.page.locator("#object-layer").select_option("semantic")
    window.page.locator("#object-add").click()
    expect(window.page.locator(f'[data-class="{name}"]')).to_be_attached()


def draw(window: Window, tool: str, corners: list[tuple[float, float]]) -> None:
    """Draw a shape corner by corner, and end it."""
    window.page.locator(tool).click()
    for corner in corners:
        window.click_at(*corner)
        window.page.wait_for_timeout(300)  # two clicks at once would end the shape
    window.page.keyboard.press("Enter")


def classes(window: Window) -> list[str]:
    return sorted(
        str(row.get_attribute("data-class"))
        for row in window.page.locator('[data-layer="semantic"] [data-class]').all()
    )


def test_what_is_added_is_drawn_saved_and_there_again(edited: Edited) -> None:
    window, before = edited.window, edited.path.read_bytes()
    start_editing(window)
    corners = window.points_at([[600, 300], [680, 240]])
    (x0, y0), (x1, y1) = corners.tolist()
    add_rectangle(window, x0, y0, x1, y1, "crate")
    assert edited.path.read_bytes() == before  # nothing is written before it is saved
    save(window)
    assert edited.path.with_name("room.hmap.bak").read_bytes() == before
    new = [item for item in edited.objects().values() if item.name == "crate"]
    assert len(new) == 1
    assert shapely.box(x0, y0, x1, y1).symmetric_difference(new[0].footprint).area < 1e-6

    window.page.locator("#edit-done").click()
    window.page.locator("#show-labels").uncheck()
    window.page.reload()
    window.look_at(5, 4, METRES_PER_PIXEL)
    x, y = new[0].footprint.centroid.coords[0]
    wanted = Expected(open_map(edited.path)).color(x, y)
    assert np.abs(window.colors_at([[x, y]])[0] - wanted).max() <= 3
    assert window.complaints == []


def test_renaming_reshaping_and_deleting_can_be_undone_and_redone(edited: Edited) -> None:
    window = edited.window
    names = classes(window)
    start_editing(window)
    take(window, CHAIR, "chair")
    rename(window, "armchair")
    window.page.locator("#object-tags").fill("soft, red")
    apply(window)
    window.wait_until_drawn()
    window.drag((7.5, 5.5), (8.1, 6.1))  # its upper right corner
    take(window, CUP, "cup")
    window.page.get_by_role("button", name="Delete").click()
    expect(window.page.locator('[data-class="cup"]')).to_have_count(0)
    changed = classes(window)
    assert changed == sorted({*names, "armchair"} - {"chair", "cup"})

    for _ in range(4):
        window.page.locator("#edit-undo").click()
    expect(window.page.locator("#edit-undo")).to_be_disabled()
    expect(window.page.locator('[data-class="chair"]')).to_have_count(1)
    assert classes(window) == names
    for _ in range(4):
        window.page.locator("#edit-redo").click()
    expect(window.page.locator("#edit-redo")).to_be_disabled()
    expect(window.page.locator('[data-class="armchair"]')).to_have_count(1)
    assert classes(window) == changed

    save(window)
    things = edited.objects()
    assert CUP not in things
    chair = things[CHAIR]
    assert (chair.name, chair.tags) == ("armchair", ("soft", "red"))
    assert chair.footprint.area > 1.3
    assert chair.footprint.bounds[2:] == pytest.approx((8.1, 6.1), abs=2 * METRES_PER_PIXEL)
    desk = things[DESK]
    assert (desk.name, desk.tags, desk.existence) == ("desk", ("furniture",), 4.5)
    assert window.complaints == []


def test_an_object_in_the_hand_that_is_undone_or_deleted_elsewhere_is_let_go(
    edited: Edited, other: Window
) -> None:
    window = edited.window
    start_editing(window)
    add_rectangle(window, *window.points_at([[600, 300], [680, 240]]).ravel(), "crate")
    expect(window.page.locator("#object-apply")).to_be_visible()
    window.page.locator("#edit-undo").click()
    expect(window.page.locator("#panel")).to_be_hidden()
    expect(window.page.locator('[data-class="crate"]')).to_have_count(0)
    take(window, CUP, "cup")
    start_editing(other)
    take(other, CUP, "cup")
    other.page.get_by_role("button", name="Delete").click()
    expect(window.page.locator("#panel")).to_be_hidden()
    assert window.complaints == other.complaints == []


def test_two_windows_see_each_other_and_lose_nothing(edited: Edited, other: Window) -> None:
    one = edited.window
    start_editing(one)
    start_editing(other)
    add_rectangle(one, *one.points_at([[600, 300], [680, 240]]).ravel(), "crate")
    expect(other.page.locator('[data-class="crate"]')).to_be_attached()
    take(other, CHAIR, "chair")
    rename(other, "armchair")
    expect(one.page.locator('[data-class="armchair"]')).to_be_attached()
    save(other)
    expect(one.page.locator("#edit-save")).to_be_disabled()
    names = [item.name for item in edited.objects().values()]
    assert sorted(names) == sorted(["desk", "armchair", "cup", EVIL, "crate"])


def test_a_change_of_what_another_window_changed_is_refused(edited: Edited, other: Window) -> None:
    late = other
    late.page.route("**/api/events*", lambda route: route.abort())
    late.page.reload()
    late.wait_until_drawn()
    late.look_at(5, 4, METRES_PER_PIXEL)
    start_editing(late)
    take(late, CHAIR, "chair")
    start_editing(edited.window)
    take(edited.window, CHAIR, "chair")
    rename(edited.window, "armchair")

    late.page.locator("#object-name").fill("throne")
    late.page.locator("#object-apply").click()
    expect(
        late.page.get_by_role("alert").filter(has_text="changed in another window")
    ).to_be_visible()
    expect(late.page.locator("#object-name")).to_have_value("armchair")
    late.page.locator("#object-name").fill("throne")  # now that it has seen the other's
    late.wait_until_drawn()
    late.page.locator("#object-apply").click()
    expect(edited.window.page.locator('[data-class="throne"]')).to_be_attached()


def test_what_is_typed_stays_while_another_window_changes_something_else(
    edited: Edited, other: Window
) -> None:
    one = edited.window
    start_editing(one)
    take(one, CHAIR, "chair")
    one.page.locator("#object-name").fill("throne")
    start_editing(other)
    take(other, DESK, "desk")
    rename(other, "table")
    expect(one.page.locator('[data-class="table"]')).to_be_attached()
    one.wait_until_drawn()
    one.page.locator("#object-apply").click()
    expect(other.page.locator('[data-class="throne"]')).to_be_attached()


def test_what_is_typed_stays_while_the_shape_is_changed(edited: Edited) -> None:
    window = edited.window
    start_editing(window)
    take(window, CHAIR, "chair")
    window.page.locator("#object-name").fill("throne")
    window.drag((7.5, 5.5), (8.1, 6.1))  # its upper right corner
    expect(window.page.locator("#edit-undo")).to_be_enabled()
    window.wait_until_drawn()
    expect(window.page.locator("#object-name")).to_have_value("throne")
    window.page.locator("#object-apply").click()
    expect(window.page.locator('[data-class="throne"]')).to_be_attached()
    save(window)
    chair = edited.objects()[CHAIR]
    assert chair.name == "throne"
    assert chair.footprint.bounds[2:] == pytest.approx((8.1, 6.1), abs=2 * METRES_PER_PIXEL)


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


def test_a_file_that_changed_on_disk_is_overwritten_if_told(edited: Edited) -> None:
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


def test_a_file_that_vanished_is_told_and_can_be_saved_again(edited: Edited) -> None:
    window = edited.window
    start_editing(window)
    take(window, CHAIR, "chair")
    rename(window, "armchair")
    edited.path.unlink()
    expect(window.page.locator("#banner")).to_contain_text("was deleted from disk")
    window.page.locator("#edit-save").click()
    expect(window.page.locator("#edit-save")).to_be_disabled()
    assert edited.objects()[CHAIR].name == "armchair"


def test_markup_typed_as_a_name_stays_text(edited: Edited) -> None:
    window = edited.window
    start_editing(window)
    take(window, CHAIR, "chair")
    rename(window, EVIL + "2")
    expect(window.page.locator("[data-class] .name").filter(has_text=EVIL + "2")).to_be_attached()
    assert window.page.locator("img").count() == 0
    assert window.page.evaluate("window.hacked") is None
    save(window)
    assert edited.objects()[CHAIR].name == EVIL + "2"


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


def test_an_object_is_moved_turned_duplicated_and_merged_by_hand(edited: Edited) -> None:
    window = edited.window
    page, slack = window.page, 2 * METRES_PER_PIXEL
    before = edited.objects()[CHAIR].footprint
    start_editing(window)
    take(window, CHAIR, "chair")
    window.drag((7.0, 5.1), (6.6, 5.9))
    expect(page.get_by_role("status").filter(has_text="Moved")).to_be_visible()
    window.wait_until_drawn()
    save(window)
    moved = edited.objects()[CHAIR].footprint
    x, y = moved.centroid.coords[0]
    assert (x, y) == pytest.approx((6.6, 5.8), abs=slack)
    assert moved.area == pytest.approx(before.area)

    handle = (x, moved.bounds[3] + 30 * METRES_PER_PIXEL)
    window.drag(handle, (x + 1.2, y + 1.2))  # from above to the upper right
    expect(page.get_by_role("status").filter(has_text="Turned")).to_be_visible()
    window.wait_until_drawn()
    save(window)
    turned = edited.objects()[CHAIR].footprint
    assert turned.area == pytest.approx(before.area)
    assert turned.centroid.coords[0] == pytest.approx((x, y), abs=1e-6)
    assert turned.bounds[2] - turned.bounds[0] == pytest.approx(2**0.5, abs=0.03)

    page.get_by_role("button", name="Duplicate").click()
    expect(page.get_by_role("status").filter(has_text="Duplicated chair")).to_be_visible()
    window.wait_until_drawn()
    save(window)
    (copy,) = (i for i in edited.objects() if i not in (DESK, CHAIR, CUP, 3))
    there = edited.objects()[copy].footprint.centroid
    expect(page.locator("#panel .head p")).to_have_text(f"Object {copy} of semantic")

    page.get_by_role("button", name="Merge with…").click()
    page.keyboard.press("Escape")  # not so
    expect(page.locator("#panel")).to_be_visible()
    page.get_by_role("button", name="Merge with…").click()
    window.click_at(x, y)
    expect(page.get_by_role("status").filter(has_text="Merged into chair")).to_be_visible()
    expect(page.locator('[data-class="chair"] .quiet')).to_have_text("1")
    window.wait_until_drawn()
    save(window)
    merged = edited.objects()
    assert CHAIR not in merged
    assert merged[copy].footprint.area == pytest.approx(2 * before.area)
    assert merged[copy].footprint.covers(there)

    for _ in range(4):
        page.locator("#edit-undo").click()
    expect(page.locator("#edit-undo")).to_be_disabled()
    save(window)
    assert sorted(edited.objects()) == [DESK, CHAIR, CUP, 3]
    assert edited.objects()[CHAIR].footprint.equals_exact(before, 1e-9)
    assert window.complaints == []


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


def test_a_file_that_can_no_longer_be_read_is_told_and_the_map_stays(edited: Edited) -> None:
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


def test_an_outline_of_too_many_corners_is_refused_where_it_is_drawn(edited: Edited) -> None:
    window = edited.window
    angles = np.linspace(0, 2 * np.pi, 2500, endpoint=False)
    ring = np.column_stack([5 + np.cos(angles), 4 + np.sin(angles)]).tolist()
    # As if so many corners had been clicked; the server's answer is real.
    body = json.dumps({"polygon": ring})
    window.page.route("**/api/area", lambda route: route.continue_(post_data=body))
    window.page.locator("#tool-rectangle").click()
    window.drag((4.0, 3.0), (6.0, 5.0))
    alert = window.page.get_by_role("alert").filter(has_text="2500 corners, more than 2000")
    expect(alert).to_be_visible()
    window.ask_at(*PLACES[CHAIR])  # and the page goes on
    assert window.said("semantic") == "chair"


def test_the_bar_fits_beside_the_panel_in_windows_of_any_width(edited: Edited) -> None:
    window = edited.window
    start_editing(window)
    for width in (1400, 1131, 1130, 1081, 1080, 800, 761, 400):
        window.page.set_viewport_size({"width": width, "height": 800})
        bar = window.page.locator("#editbar").bounding_box()
        side = window.page.locator("#sidebar").bounding_box()
        assert bar is not None
        left = side["x"] + side["width"] if side else 0.0  # on phones it is put away
        assert (side is None) == (width <= 760)
        assert left <= bar["x"], width
        assert bar["x"] + bar["width"] <= width, width
        assert bar["height"] < 50, width  # one line
