"""Notes on the page, in a real browser: written, shown with their files, changed and deleted."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
import shapely
from PIL import Image
from playwright.sync_api import Browser, expect

from hypermap import Hypermap, Note, open_map, save_map
from hypermap.notes import add_note, attachment_of, notes_layer
from hypermap.testing import occupancy_from_text
from hypermap.viewer.live.export import export_page

from .editing_tools import save, start_editing
from .page_tools import Window, a_server, a_server_in_a_folder, a_window

pytestmark = pytest.mark.xdist_group("page")

HOSTILE = "<img src=x onerror='window.hit=1'> [link](javascript:window.hit=1) **bold**"


@pytest.fixture
def picture(tmp_path) -> Path:
    path = tmp_path / "tile.png"
    Image.new("RGB", (60, 40), "orange").save(path)
    return path


@pytest.fixture
def path(tmp_path, picture) -> Path:
    """A map with one note, which a stranger has written."""
    hypermap = Hypermap([occupancy_from_text("......\n......\n......", resolution=1.0)])
    files = (attachment_of(picture),)
    add_note(hypermap, Note(shapely.Point(1.5, 1.5), HOSTILE, "Eve", attachments=files))
    path = tmp_path / "office.hmap"
    save_map(hypermap, path)
    return path


@pytest.fixture
def window(empty_window: Window, path: Path) -> Iterator[Window]:
    with a_server(path) as url:
        empty_window.load(url)
        yield empty_window


def click_map(window: Window, x: float, y: float) -> None:
    window.page.mouse.click(*window.pixel_of(x, y))


def test_the_page_may_be_in_a_folder_of_a_web_server(empty_window: Window, path: Path):
    with a_server_in_a_folder(path, "maps") as url:
        empty_window.load(url)
        click_map(empty_window, 1.5, 1.5)
        picture = empty_window.page.locator("#panel img")
        expect(picture).to_be_visible()
        assert picture.evaluate("async (image) => (await image.decode(), image.naturalWidth)") == 60
        assert all("/maps/" in asked for asked in empty_window.asked)
        assert empty_window.complaints == []


def test_a_mark_shows_the_note_and_runs_nothing_of_it(window: Window):
    page = window.page
    click_map(window, 1.5, 1.5)
    text = page.locator("#panel .note-text")
    expect(text).to_contain_text("<img src=x")
    expect(text.locator("strong")).to_have_text("bold")
    assert text.locator("img, script, a").count() == 0
    shown = page.locator("#panel figure img")
    expect(shown).to_be_visible()
    window.wait_for("() => document.querySelector('#panel figure img').naturalWidth === 60")
    assert page.evaluate("() => window.hit") is None
    assert window.complaints == []
    page.get_by_role("button", name="1 <img src=x", exact=False).first.focus()


def test_a_note_is_written_at_a_click_changed_and_deleted(window: Window, path: Path, picture):
    page = window.page
    page.locator("#tool-note").click()
    click_map(window, 4, 1)
    page.get_by_label("Text", exact=True).fill("# Pump\nIt leaks.")
    page.get_by_label("Author").fill("Ada")
    page.get_by_label("Links").fill("https://example.org/pump")
    page.locator("#note-files").set_input_files(picture)
    page.get_by_role("button", name="Done").click()
    expect(page.locator("#panel h2").first).to_have_text("Pump")
    expect(page.locator("#panel h1")).to_have_text("Pump")
    expect(page.locator("#panel figure img")).to_be_visible()
    expect(page.locator("#layers .note-row")).to_have_count(2)

    page.locator("#panel").get_by_role("button", name="Edit").click()
    page.get_by_label("Text", exact=True).fill("fixed")
    page.get_by_role("button", name="Remove").click()
    page.get_by_role("button", name="Done").click()
    expect(page.locator("#panel h2").first).to_have_text("fixed")
    expect(page.locator("#panel figure")).to_have_count(0)

    start_editing(window)
    save(window)
    note = notes_layer(open_map(path))[2]
    assert (note.text, note.author, note.links) == ("fixed", "Ada", ("https://example.org/pump",))
    assert abs(note.place.x - 4) < 0.05
    page.locator("#tool-edit").click()

    click_map(window, 4, 1)
    page.locator("#panel").get_by_role("button", name="Delete").click()
    page.locator("dialog").get_by_role("button", name="Delete").click()
    expect(page.locator("#layers .note-row")).to_have_count(1)
    assert window.complaints == []


def test_a_file_dropped_on_the_map_begins_a_note_there(window: Window):
    page = window.page
    x, y = window.pixel_of(4.5, 2)
    page.evaluate(
        """([x, y]) => {
            const dropped = new DataTransfer();
            dropped.items.add(new File(["<svg onload='window.hit=1'/>"], "plan.svg"));
            const target = document.querySelector("#map canvas");
            for (const kind of ["dragover", "drop"]) {
                target.dispatchEvent(new DragEvent(kind, {
                    dataTransfer: dropped, clientX: x, clientY: y, bubbles: true, cancelable: true,
                }));
            }
        }""",
        [x, y],
    )
    expect(page.locator("#panel .note-files li")).to_have_text(["plan.svg"])
    page.get_by_role("button", name="Done").click()
    expect(page.locator("#panel h2").first).to_have_text("plan.svg")
    assert page.locator("#panel figure :is(img, video, audio)").count() == 0
    with page.expect_download() as download:
        page.locator("#panel .note-file").click()
    assert download.value.suggested_filename == "plan.svg"


def test_a_page_in_a_file_shows_the_notes_and_their_pictures(browser: Browser, path, tmp_path):
    export_page(open_map(path), path, tmp_path / "office.html")
    with a_window(browser, (tmp_path / "office.html").as_uri()) as window:
        expect(window.page.locator("#tool-note")).to_be_hidden()
        click_map(window, 1.5, 1.5)
        expect(window.page.locator("#panel .note-text strong")).to_have_text("bold")
        window.wait_for("() => document.querySelector('#panel figure img').naturalWidth === 60")
        assert window.complaints == []
