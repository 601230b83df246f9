"""The page of a run in a real browser: live, going back, playing, and after the end."""

from __future__ import annotations

import contextlib
import io
import re
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from playwright.sync_api import Browser, Page

from hypermap.colors import class_colors

from .commands import PATIENCE
from .page_tools import SIZE as WINDOW
from .page_tools import chromium, forget
from .run_tools import BLUE, CHAIR, CUP, EVIL, GRAY, RED, SIZE, watching, write_run

pytestmark = pytest.mark.xdist_group("page")

FRAMES, CUP_FROM = 40, 5
SECONDS = f"{0.1 * (FRAMES - 1):.1f} s"  # of the recording
COLORS = {
    name: 255 * np.array(color) for name, color in class_colors(["chair", "cup", EVIL]).items()
}
TINT = 0.5  # of a segment


class RunWindow:
    """A window with the page of a run in it."""

    def __init__(self, page: Page) -> None:
        self.page = page
        page.context.set_default_timeout(1000 * PATIENCE)
        self.hosts: set[str] = set()
        self.complaints: list[str] = []
        page.on("request", lambda request: self.hosts.add(str(urlsplit(request.url).hostname)))
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on(
            "console",
            lambda message: (
                self.complaints.append(message.text)
                if message.type in ("warning", "error")
                else None
            ),
        )

    def load(self, url: str) -> None:
        """Load the page as if this window were new."""
        forget(self.page)
        self.hosts.clear()
        self.complaints.clear()
        assert self.page.goto(url) is not None, "it was not loaded, but stayed as it was"
        self.wait_for("() => window.hypermapRun?.shown")

    def wait_for(self, condition: str, argument: Any = None) -> Any:
        """Wait until a function of JavaScript returns something true, and return it."""
        end = time.monotonic() + PATIENCE
        while not (found := self.page.evaluate(condition, argument)):
            assert time.monotonic() < end, f"this has not become true: {condition}"
            self.page.wait_for_timeout(30)
        return found

    def wait_for_state(self, state: str) -> None:
        self.wait_for("(state) => document.body.dataset.state === state", state)

    @property
    def steps(self) -> int:
        return int(self.page.evaluate("() => window.hypermapRun.steps.length"))

    @property
    def number(self) -> int:
        """Number of the frame that is shown."""
        return int(self.page.evaluate("() => window.hypermapRun.shown.number"))

    def go(self, number: int) -> None:
        """Move the slider to a frame, and wait until it is drawn."""
        position = self.page.evaluate("(n) => window.hypermapRun.steps.positionOf(n)", number)
        self.page.locator("#slider").fill(str(position))
        self.wait_until_shown(number)

    def wait_until_shown(self, number: int) -> None:
        self.wait_for("(n) => window.hypermapRun.shown.number === n", number)
        self.page.evaluate(
            """() => new Promise((done) => {
                const {map} = window.hypermapRun.map;
                map.once("rendercomplete", done);
                map.render();
            })"""
        )

    def objects(self) -> dict[str, int]:
        """Return the classes on the map and how many objects there are of each."""
        chips = self.page.locator("#objects li").all()
        return {
            chip.locator(".name").inner_text(): int(chip.locator(".number").inner_text())
            for chip in chips
        }

    def picture(self) -> NDArray[np.float64]:
        """Return what the window shows, shape (height, width, 3)."""
        with Image.open(io.BytesIO(self.page.screenshot())) as image:
            return np.asarray(image.convert("RGB")).astype(float)

    def camera_colors(self, points: list[tuple[float, float]]) -> NDArray[np.float64]:
        """Return what is shown at pixels of the camera's image, shape (N, 3)."""
        box = self.page.locator("#camera").bounding_box()
        assert box is not None
        scale = box["width"] / SIZE[0]
        picture = self.picture()
        return np.array(
            [picture[int(box["y"] + v * scale), int(box["x"] + u * scale)] for u, v in points]
        )

    def map_color(self, x: float, y: float) -> NDArray[np.float64]:
        """Return what is shown at a point of the map."""
        column, row = self.page.evaluate(
            "(at) => window.hypermapRun.map.map.getPixelFromCoordinate(at)", [x, y]
        )
        color: NDArray[np.float64] = self.picture()[int(row), int(column)]
        return color

    def outline_of(self, name: str) -> NDArray[np.float64]:
        """Return the outline of an object of a class that is shown [m], shape (N, 2)."""
        outline = self.page.evaluate(
            """(name) => {
                const things = [...window.hypermapRun.shown.things.values()];
                return things.find((thing) => thing.name === name).polygons[0][0];
            }""",
            name,
        )
        return np.array(outline)

    def look_at(self, x: float, y: float, metres_per_pixel: float) -> None:
        """Put a point into the middle of the map, as a person would by moving it."""
        self.page.evaluate(
            """([x, y, resolution]) => {
                const {map} = window.hypermapRun;
                map.follows = false;
                map.map.getView().setCenter([x, y]);
                map.map.getView().setResolution(resolution);
            }""",
            [x, y, metres_per_pixel],
        )
        self.wait_until_shown(self.number)


@contextlib.contextmanager
def a_run_window(browser: Browser, url: str | None) -> Iterator[RunWindow]:
    with contextlib.closing(browser.new_context(viewport=WINDOW)) as context:
        window = RunWindow(context.new_page())
        if url is not None:
            window.load(url)
        yield window


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a run that is over."""
    chromium()
    folder = tmp_path_factory.mktemp("finished")
    with watching(write_run(folder / "drive", FRAMES, CUP_FROM), folder / "room.hmap") as watched:
        watched.wait_for("the run stays at")
        yield watched.url


@pytest.fixture
def empty_window(shared: Any) -> Iterator[RunWindow]:
    with shared.window("run", partial(a_run_window, url=None)) as window:
        yield window


@pytest.fixture
def window(empty_window: RunWindow, finished: str) -> Iterator[RunWindow]:
    empty_window.load(finished)
    empty_window.wait_until_shown(FRAMES)
    yield empty_window
    assert empty_window.hosts == {"127.0.0.1"}
    assert empty_window.complaints == []


def test_a_finished_run_shows_its_last_step_and_how_it_went(window: RunWindow) -> None:
    page = window.page
    assert window.number == FRAMES
    assert page.locator("#state").inner_text() == "saved room.hmap"
    assert page.locator("#title").inner_text() == "drive → room.hmap"
    counts = re.sub(r"\s+", " ", page.locator("#counts").inner_text())
    assert counts == f"used {FRAMES} skipped 0 unusable 0 objects 2"
    assert window.objects() == {"chair": 1, "cup": 1}
    assert page.locator("#time").inner_text() == f"{SECONDS} / {SECONDS}"
    assert page.locator("#live").inner_text() == "End"
    assert not page.locator("#progress").is_visible()


def test_the_slider_goes_back_to_what_was_then(window: RunWindow) -> None:
    page = window.page
    outline = window.outline_of("cup")
    window.look_at(*outline.mean(axis=0).tolist(), 0.002)
    x, y = 0.5 * outline[0] + 0.5 * outline.mean(axis=0)  # between the label and the edge
    with_cup = window.map_color(x, y)
    window.go(2)
    assert window.objects() == {"chair": 1}
    assert page.locator("#objects-title").inner_text() == "In the map at this step: 1 object"
    assert page.locator("#frame").inner_text() == "frame 2"
    assert page.locator("#time").inner_text() == f"0.1 s / {SECONDS}"
    seen = page.locator("#seen .name").all_inner_texts()
    assert seen == ["chair", EVIL]
    without = window.map_color(x, y)
    wanted = COLORS["cup"]
    assert np.linalg.norm(with_cup - wanted) < 0.6 * np.linalg.norm(without - wanted)
    window.go(FRAMES)
    assert window.objects() == {"chair": 1, "cup": 1}
    assert np.abs(window.map_color(x, y) - with_cup).max() <= 3
    window.go(1)  # far back, from a step whose objects are known as differences
    assert window.number == 1


def test_boxes_and_segments_lie_where_the_detections_are(window: RunWindow) -> None:
    page = window.page
    for name, (x0, y0, x1, y1), paint in [("chair", CHAIR, RED), ("cup", CUP, BLUE)]:
        middle = ((x0 + x1) / 2, (y0 + y1) / 2)
        right = (x1, middle[1])
        edge, inside = window.camera_colors([right, middle])
        assert np.abs(edge - COLORS[name]).max() < 30, name
        mixed = TINT * COLORS[name] + (1 - TINT) * np.array(paint)
        assert np.abs(inside - mixed).max() < 15, name
    (outside,) = window.camera_colors([(150.0, 20.0)])
    assert np.abs(outside - GRAY).max() < 8

    page.locator("#show-segments").uncheck()
    x0, y0, x1, y1 = CHAIR
    edge, inside = window.camera_colors([(x1, (y0 + y1) / 2), ((x0 + x1) / 2, (y0 + y1) / 2)])
    assert np.abs(inside - RED).max() < 12
    assert np.abs(edge - COLORS["chair"]).max() < 30
    page.locator("#show-boxes").uncheck()
    (edge,) = window.camera_colors([(x1 + 0.5, (y0 + y1) / 2)])
    assert np.abs(edge - GRAY).max() < 12
    page.locator("#show-segments").check()
    (inside,) = window.camera_colors([((x0 + x1) / 2, (y0 + y1) / 2)])
    assert np.abs(inside - RED).max() > 12 or np.abs(COLORS["chair"] - RED).max() < 25


def test_keys_step_through_the_run(window: RunWindow) -> None:
    page = window.page
    page.locator("#map").click(position={"x": 900, "y": 100})
    for key, number in [
        ("ArrowLeft", FRAMES - 1),
        ("ArrowLeft", FRAMES - 2),
        ("ArrowRight", FRAMES - 1),
        ("Home", 1),
        ("ArrowLeft", 1),
        ("End", FRAMES),
    ]:
        page.keyboard.press(key)
        window.wait_until_shown(number)
    page.locator("#back").click()
    window.wait_until_shown(FRAMES - 1)
    page.locator("#forth").click()
    window.wait_until_shown(FRAMES)


def test_playing_shows_the_run_from_its_start_to_its_end(window: RunWindow) -> None:
    page = window.page
    page.locator("#speed").select_option("0.25")
    page.locator("#play").click()
    window.wait_for("(n) => window.hypermapRun.shown.number < n", FRAMES // 2)
    assert page.locator("#play").get_attribute("aria-label") == "Pause (space)"
    page.locator("#play").click()
    # What was asked for before is still drawn.
    window.wait_for("() => !window.hypermapRun.isAsking")
    stopped = window.number
    assert stopped < FRAMES
    page.wait_for_timeout(1000)
    assert window.number == stopped
    page.locator("#map").focus()
    page.locator("#speed").select_option("20")
    page.locator("#map").focus()
    page.keyboard.press(" ")
    window.wait_until_shown(FRAMES)
    window.wait_for("() => document.querySelector('#play').title === 'Play (space)'")
    assert page.locator("#live").get_attribute("aria-pressed") == "true"


def test_an_object_under_the_pointer_is_reported(window: RunWindow) -> None:
    page = window.page
    x, y = window.outline_of("chair").mean(axis=0).tolist()
    column, row = page.evaluate(
        "(at) => window.hypermapRun.map.map.getPixelFromCoordinate(at)", [x, y]
    )
    page.mouse.move(column - 2, row)
    page.mouse.move(column, row)
    assert page.locator("#tip b").inner_text() == "chair"
    assert f"seen {FRAMES}×" in page.locator("#tip").inner_text()
    page.mouse.move(column, 5)
    page.locator("#tip").wait_for(state="hidden")


def test_a_name_is_text_and_never_runs(window: RunWindow) -> None:
    assert EVIL in window.page.locator("#seen .name").all_inner_texts()
    assert window.page.locator("img").count() == 0
    assert window.page.evaluate("window.hacked") is None


def test_the_page_is_dark_or_light_as_asked(window: RunWindow) -> None:
    def lightness() -> float:
        return float(np.median(window.picture()[400:780, 20:300]))

    light = lightness()
    window.page.locator("#theme").click()
    window.wait_until_shown(FRAMES)
    assert light > 200 > 80 > lightness()
    window.page.locator("#theme").click()
    window.wait_until_shown(FRAMES)
    assert lightness() == pytest.approx(light, abs=5)


def test_a_run_is_followed_stopped_and_looked_at_and_its_end_is_said(
    browser: Browser, tmp_path: Path
) -> None:
    drive, output = write_run(tmp_path / "drive", frames=4000, cup_from=3), tmp_path / "room.hmap"
    with watching(drive, output) as watched, a_run_window(browser, watched.url) as window:
        page = window.page
        window.wait_for_state("mapping")
        assert "of 4,000 frames" in page.locator("#state").inner_text()
        assert page.locator("#live").inner_text() == "Live"

        assert page.locator("#open-map").is_hidden()

        first = window.number  # live: what is shown goes on by itself
        window.wait_for("(n) => window.hypermapRun.shown.number >= n + 4", first)
        window.go(1)
        known = window.steps
        window.wait_for("(n) => window.hypermapRun.steps.length >= n + 4", known)
        assert window.number == 1  # who looks back is left there
        assert page.locator("#live").get_attribute("aria-pressed") == "false"
        page.locator("#live").click()
        window.wait_for("(n) => window.hypermapRun.shown.number >= n + 4", known)

        watched.interrupt()
        window.wait_for_state("saved")
        assert output.exists()
        said = page.locator("#state").inner_text()
        assert said == (
            "saved room.hmap, the map of a part of the recording: stopped early by Ctrl-C"
        )
        last = window.page.evaluate("() => window.hypermapRun.steps.numbers.at(-1)")
        window.wait_until_shown(last)
        window.go(1)
        assert window.objects() in ({}, {"chair": 1})
        with page.expect_popup() as opened:
            page.get_by_role("link", name="Open the map").click()
        opened.value.locator('[data-class="chair"]').wait_for(state="attached")
        assert opened.value.locator("#title").inner_text() == "room.hmap"
        assert window.complaints == []

        watched.interrupt()
        assert watched.end() == 130
        banner = page.locator("#banner")
        banner.wait_for(state="visible")
        assert "Hypermap has stopped" in banner.inner_text()
        assert window.number == 1  # what was drawn stays


def test_a_run_that_fails_says_why(browser: Browser, tmp_path: Path) -> None:
    drive = write_run(tmp_path / "drive", frames=4000, cup_from=3)
    with watching(drive, tmp_path / "room.hmap") as watched:
        with a_run_window(browser, watched.url) as window:
            (drive / "depth1.png").write_bytes(b"no picture")  # once somebody looks on
            window.wait_for_state("failed")
            assert "depth1.png" in window.page.locator("#banner").inner_text()
        assert watched.end() == 2
