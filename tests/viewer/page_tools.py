"""A browser for the tests of the page, the server behind it, and what the screen shows."""

from __future__ import annotations

import contextlib
import functools
import io
import os
import re
import shutil
import signal
import socket
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast
from urllib.parse import urlsplit

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from PIL import Image
from playwright.sync_api import Browser, BrowserContext, Page, expect, sync_playwright
from starlette.applications import Starlette

import hypermap.viewer
from hypermap.viewer.live.app import MapApp
from hypermap.viewer.live.document import MapDocument
from hypermap.viewer.live.serving import listen, serving, url_of

from ..prepared import Command
from ..roscore import free_port

SHADE = 30  # pixels around a panel that its shadow darkens
PATIENCE = 120.0  # s; the machine may be busy
expect.set_options(timeout=1000 * PATIENCE)
SIZE: Any = {"width": 1200, "height": 800}
PAGE_FOLDER = Path(hypermap.viewer.__file__).parent / "page"
ARGUMENTS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--force-color-profile=srgb",
]


def chromium() -> str:
    """Return the browser's path, or skip the test with a reason."""
    found = (
        os.environ.get("HYPERMAP_CHROMIUM")
        or shutil.which("chromium-headless-shell")
        or shutil.which("chromium")
    )
    if found is None:
        pytest.skip("Chromium is not here (on Debian, as root: make chromium)")
    if not (PAGE_FOLDER / "app.js").is_file():
        pytest.skip("the page is not built (make page)")
    return found


@contextlib.contextmanager
def a_browser() -> Iterator[Browser]:
    """Yield a headless Chromium."""
    path = chromium()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=path, args=ARGUMENTS, timeout=1000 * PATIENCE
        )
        try:
            yield browser
        finally:
            browser.close()


@contextlib.contextmanager
def a_window(browser: Browser, url: str | None, **options: Any) -> Iterator[Window]:
    """Open a window that shares nothing with others, with the page in it if there is an address."""
    with contextlib.closing(browser.new_context(viewport=SIZE, **options)) as context:
        yield Window(context, url)


def forget(page: Page) -> None:
    """Forget what a page has kept and what a test has set, and take the pointer away.

    Loaded again, it is as in a new window, but in half the time: the browser has its program ready.
    Only a clock cannot be set back: a test that sets it opens a window of its own.
    """
    page.unroute_all()
    page.set_viewport_size(SIZE)
    page.mouse.up()  # where a test has failed while it dragged
    page.mouse.move(-1, -1)
    leave(page)
    page.context.clear_cookies()


def leave(page: Page) -> None:
    """Leave a page and forget what it has kept, so that it asks its server no more.

    It goes by itself, as the browser would take another process for that, which has to prepare the
    program anew.
    """
    if page.url != "about:blank":
        page.evaluate("() => { localStorage.clear(); sessionStorage.clear(); }")
        page.evaluate("() => location.replace('about:blank')")
        page.wait_for_url("about:blank")


@contextlib.contextmanager
def a_server(path: Path, *options: str) -> Iterator[str]:
    """Serve a map with `hypermap view` and yield the page's address.

    It is the same again when it is free, as it is for users: what the browser has prepared of the
    page's program, it keeps by address.
    """
    words = ["view", path, "--no-browser", "--port", _port(), *options]
    server = Command(*words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    try:
        yield _address(server)
        server.send_signal(signal.SIGINT)
        server.communicate(PATIENCE)
    finally:
        server.kill()
        server.communicate()


@contextlib.contextmanager
def a_server_in_a_folder(path: Path, folder: str) -> Iterator[str]:
    """Serve a map as behind a web server that passes on what is below a folder of its addresses."""
    with listen("127.0.0.1", 0) as listening:
        url = f"http://localhost:{listening.getsockname()[1]}/{folder}"
        app = MapApp(MapDocument(path), public_url=url)
        inner: Any = app.app

        async def passed_on(scope: Any, receive: Any, send: Any) -> None:
            if scope["type"] == "http":
                in_folder = scope["path"].startswith(f"/{folder}/")
                inside = scope["path"].removeprefix(f"/{folder}") if in_folder else "/nothing"
                scope = {**scope, "path": inside, "raw_path": inside.encode()}
            await inner(scope, receive, send)

        address = url_of(app, listening, url)
        app.app = cast("Starlette", passed_on)
        with serving(app, listening):
            yield address


def _port() -> int:
    """Return the port of all servers of these tests; 0, for any, while another one has it."""
    with socket.socket() as probe, contextlib.suppress(OSError):
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        probe.bind(("127.0.0.1", _usual_port()))
        return _usual_port()
    return 0


_usual_port = functools.cache(free_port)


def _address(server: Command) -> str:
    assert server.stdout is not None
    said = ""
    too_late = threading.Timer(2 * PATIENCE, server.kill)
    too_late.start()
    try:
        for line in server.stdout:
            said += line
            if found := re.search(r"http://127\.0\.0\.1:\d+/\S*", line):
                return found.group()
    finally:
        too_late.cancel()
    raise AssertionError(f"no address was printed:\n{said}")


class Window:
    """One window of the browser with the page in it.

    Attributes:
        page: Playwright's.
        asked: the address of every request.
        complaints: what the console said as warning or error, and errors that nobody caught.
    """

    def __init__(self, context: BrowserContext, url: str | None) -> None:
        context.set_default_timeout(1000 * PATIENCE)
        self.page: Page = context.new_page()
        self.asked: list[str] = []
        self.complaints: list[str] = []
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on(
            "console",
            lambda message: (
                self.complaints.append(message.text)
                if message.type in ("warning", "error")
                else None
            ),
        )
        if url is not None:
            self._open(url)

    def load(self, url: str, view: tuple[float, float, float] | None = None) -> None:
        """Load the page as if this window were new, and look at a place as `look_at` does."""
        forget(self.page)
        self.asked.clear()
        self.complaints.clear()
        self._open(url, view)

    def _open(self, url: str, view: tuple[float, float, float] | None = None) -> None:
        assert self.page.goto(url) is not None, "it was not loaded, but stayed as it was"
        if view is None:
            self.wait_until_drawn()
        else:
            self.wait_for("() => window.hypermapPage !== undefined")
            self.page.evaluate("() => window.hypermapPage.ready")
            self.look_at(*view)

    def wait_until_drawn(self) -> None:
        """Wait for the map to show all that it asked for."""
        self.wait_for("() => window.hypermapPage !== undefined")
        self.page.evaluate(
            """async () => {
                await window.hypermapPage.ready;
                const {map, view} = window.hypermapPage;
                const known = () => [...view.layers.values()].flatMap(
                    ({shapes}) => (shapes ? [shapes.asking, shapes.loaded] : []));
                // Questions that the page has put off for a moment come first.
                await new Promise((later) => setTimeout(later, 200));
                let before;
                do {  // until nothing is left to be asked; a question may call off another
                    before = known();
                    await view.showShapes();
                } while (known().some((one, i) => !one || one !== before[i]));
                await new Promise((done) => {
                    map.once("rendercomplete", done);
                    map.render();
                });
            }"""
        )

    def wait_for(self, condition: str, argument: Any = None) -> None:
        """Wait until a function of JavaScript returns true.

        Playwright's own way evaluates text in the page, which the page's policy forbids.
        """
        end = time.monotonic() + PATIENCE
        while not self.page.evaluate(condition, argument):
            if time.monotonic() > end:
                raise AssertionError(f"this has not become true in {PATIENCE:g} s: {condition}")
            self.page.wait_for_timeout(30)

    def hosts(self) -> set[str]:
        """Return whom the page asked; data that the page holds itself is nobody's."""
        schemes = ("data", "blob", "file")
        return {
            str(urlsplit(url).hostname) for url in self.asked if urlsplit(url).scheme not in schemes
        }

    # Places

    def pixel_of(self, x: float, y: float) -> tuple[float, float]:
        """Return where a point of the base frame lies in the window."""
        ((column, row),) = self.pixels_of([[x, y]]).tolist()
        return column, row

    def pixels_of(self, points_xy: ArrayLike) -> NDArray[np.float64]:
        """Return where points of the base frame lie in the window, shape (N, 2)."""
        self.wait_until_at_rest()
        places = self.page.evaluate(
            """(points) => {
                const {map} = window.hypermapPage;
                const box = map.getTargetElement().getBoundingClientRect();
                return points.map((point) => {
                    const [column, row] = map.getPixelFromCoordinate(point);
                    return [box.left + column, box.top + row];
                });
            }""",
            np.asarray(points_xy, dtype=float).reshape(-1, 2).tolist(),
        )
        return np.array(places, dtype=float)

    def look_at(self, x: float, y: float, metres_per_pixel: float) -> None:
        """Put a point into the middle of the map, and wait until all is drawn."""
        self.page.wait_for_function("() => window.hypermapPage?.map !== undefined")
        self.page.evaluate(
            """([x, y, resolution]) => {
                const view = window.hypermapPage.map.getView();
                view.cancelAnimations();
                view.setCenter([x, y]);
                view.setResolution(resolution);
            }""",
            [x, y, metres_per_pixel],
        )
        self.wait_until_drawn()

    def click_at(self, x: float, y: float, **options: Any) -> None:
        """Click on a point of the base frame."""
        self.page.mouse.click(*self.pixel_of(x, y), **options)

    def wait_until_at_rest(self) -> None:
        """Wait until the view moves no more, as it does to bring an answer's place into sight.

        Places on the screen are those of the picture that was drawn last, so it is drawn then.
        """
        self.wait_for(
            """() => {
                const {map} = window.hypermapPage;
                if (map.getView().getAnimating()) return false;
                map.renderSync();
                return true;
            }"""
        )

    def wait_until_nothing_is_drawn(self) -> None:
        """Wait for the end of a drawing: what follows within 0.3 s counts as its double click."""
        expect(self.page.locator(".drawing")).to_have_count(0)

    def wait_until_no_double_click(self) -> None:
        """Wait until the next click is one of its own, by the timers of the page itself."""
        self.page.evaluate("() => new Promise((later) => window.setTimeout(later, 400))")

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Press at one point of the base frame, and let go at another."""
        self.page.mouse.move(*self.pixel_of(*start))
        self.page.mouse.down()
        self.page.mouse.move(*self.pixel_of(*end), steps=8)
        self.page.mouse.up()

    def points_at(self, pixels: ArrayLike) -> NDArray[np.float64]:
        """Return the points of the base frame under pixels of the window, shape (N, 2)."""
        self.wait_until_at_rest()
        (x, y), metres_per_pixel = self.page.evaluate(
            """() => {
                const {map} = window.hypermapPage;
                const {left, top} = map.getTargetElement().getBoundingClientRect();
                return [map.getCoordinateFromPixel([-left, -top]), map.getView().getResolution()];
            }"""
        )
        scale = np.array([metres_per_pixel, -metres_per_pixel])  # the map is never turned
        return np.array([x, y]) + scale * np.asarray(pixels, dtype=float).reshape(-1, 2)

    def bare_pixels(self, spacing: int = 8) -> NDArray[np.float64]:
        """Return pixels (column, row) of the map that no panel covers or shades, shape (N, 2)."""
        panels = self.page.evaluate(
            """() => [...document.querySelectorAll(".card, .notice, #banner")]
                .map((panel) => panel.getBoundingClientRect())
                .filter(({width}) => width > 0)
                .map(({left, top, right, bottom}) => [left, top, right, bottom])"""
        )
        grid = np.mgrid[5 : SIZE["width"] : spacing, 5 : SIZE["height"] : spacing]
        pixels = grid.reshape(2, -1).T.astype(float)
        for left, top, right, bottom in panels:
            low, high = np.array([left, top]) - SHADE, np.array([right, bottom]) + SHADE
            pixels = pixels[~((low < pixels) & (pixels < high)).all(axis=1)]
        return pixels

    # Questions

    def ask_at(self, x: float, y: float) -> NDArray[np.float64]:
        """Click on a point of the base frame, and return the one that was clicked, shape (2,)."""
        self.wait_until_nothing_is_drawn()
        pixel = np.round(self.pixel_of(x, y))
        clicked: NDArray[np.float64] = self.points_at([pixel])[0]
        self.page.mouse.click(*pixel.tolist())
        self.wait_for(
            """([x, y]) => {
                const said = document.querySelector("#panel .head p")?.textContent ?? "";
                const [, atX, atY] = said.match(/^At (\\S+), (\\S+) m in/) ?? [];
                const near = (text, value) => text !== undefined &&
                    Math.abs(Number(text.replace("\u2212", "-")) - value) < 0.006;
                return near(atX, x) && near(atY, y);
            }""",
            clicked.tolist(),
        )
        return clicked

    def said(self, layer: str) -> str:
        """Return what the answer to a click says of a layer: a label, or that nothing is there."""
        section = self.page.locator(f'#panel section.at[data-layer="{layer}"]')
        return section.locator(".labelled .name, p.quiet").first.inner_text()

    def rows(self) -> list[tuple[str, int]]:
        """Return name and id of each row of the table."""
        heads = self.page.locator("table.rows thead th").all_inner_texts()
        places = [[head.strip() for head in heads].index(title) for title in ("Name", "Id")]
        lines = self.page.locator("table.rows tbody tr").all()
        cells = [line.locator("td").all_inner_texts() for line in lines]
        return [(line[places[0]].strip(), int(line[places[1]])) for line in cells]

    def cell_counts(self) -> dict[str, int]:
        """Return how many cells have each label, as the answer to an area says."""
        counts = {}
        for line in self.page.locator("#panel ul.cells li").all():
            label = line.locator(".name").inner_text()
            number = line.locator(".quiet").inner_text().split("·")[0]
            counts[label] = int(re.sub(r"\D", "", number))
        return counts

    def find(self, name: str) -> None:
        """Type a name into the field for names, and wait for the answer."""
        self.page.locator("#search").fill(name)
        self.page.locator("#search").press("Enter")
        self.page.locator("#panel h2").get_by_text(name, exact=True).wait_for()
        self.page.locator("#panel ol.found").wait_for(state="attached")

    def found_ids(self) -> list[int]:
        """Return the ids of the matches as they are listed."""
        buttons = self.page.locator("#panel ol.found button").all()
        return [int(button.get_attribute("data-id") or -1) for button in buttons]

    # Colors

    def picture(self) -> NDArray[np.uint8]:
        """Return what the window shows, shape (height, width, 3)."""
        with Image.open(io.BytesIO(self.page.screenshot())) as image:
            return np.asarray(image.convert("RGB"))

    def colors_at(self, points_xy: ArrayLike) -> NDArray[np.uint8]:
        """Return the colors on the screen at points of the base frame, shape (N, 3)."""
        columns, rows = self.pixels_of(points_xy).astype(int).T
        return self.picture()[rows, columns]
