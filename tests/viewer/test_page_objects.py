"""Changing objects in the browser: what is drawn, undone, and seen by another window."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from playwright.sync_api import expect

from hypermap.formats import open_map

from .editing_tools import (
    Edited,
    add_rectangle,
    apply,
    classes,
    rename,
    save,
    start_editing,
    take,
)
from .page_tools import Window
from .screen_colors import Expected
from .small_map import (
    CHAIR,
    CUP,
    DESK,
    EVIL,
    METRES_PER_PIXEL,
)

pytestmark = pytest.mark.xdist_group("page")


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


def test_the_bar_fits_beside_the_panel_in_windows_of_any_width(edited: Edited) -> None:
    window = edited.window
    start_editing(window)
    for width in (1400, 1241, 1240, 1081, 1080, 800, 761, 400):
        window.page.set_viewport_size({"width": width, "height": 800})
        bar = window.page.locator("#editbar").bounding_box()
        side = window.page.locator("#sidebar").bounding_box()
        assert bar is not None
        left = side["x"] + side["width"] if side else 0.0  # on phones it is put away
        assert (side is None) == (width <= 760)
        assert left <= bar["x"], width
        assert bar["x"] + bar["width"] <= width, width
        assert bar["height"] < 50, width  # one line
