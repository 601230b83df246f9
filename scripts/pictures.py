"""Take the pictures of the page, of a run and of rviz in the documents, as `make pictures` does.

A demo is run with `--view`, and a headless Chromium looks at it as a user would; rviz draws on a
screen without a monitor.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageGrab
from playwright.sync_api import Page, sync_playwright

from hypermap.colors import class_colors
from hypermap.simulation import demo_world, ground_truth

NAMES = ("growing", "watching", "page", "evidence", "rviz")
IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"
SIZE: Any = {"width": 1360, "height": 800}
PATIENCE = 300.0  # s; the first run compiles
SEEN_AT = 0.55  # of the run
GROWTH_FRAMES, GROWTH_WIDTH, GROWTH_STEP, GROWTH_END = 36, 960, 150, 2500  # pixels; ms a frame
RVIZ_SIZE = 1400, 1000  # of the screen, on which the window has room
CUP, SOFA = (3.75, 2.15), (3.6, 0.5)  # places in the demo's room; the cup stands on a table
ADDRESS = re.compile(r"http://127\.0\.0\.1:\d+/\S*")


class Demo:
    """A running `hypermap demo --view`, and what it has said so far."""

    def __init__(self, folder: Path) -> None:
        command = [sys.executable, "-m", "hypermap", "demo", "--view", "--no-browser"]
        self.process = subprocess.Popen(
            [*command, "--port", "0", "-o", "demo"],
            cwd=folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self.said = ""
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.said += line

    def addresses(self, count: int) -> list[str]:
        """Wait until so many addresses were said, and return them."""
        end = time.monotonic() + PATIENCE
        while len(found := ADDRESS.findall(self.said)) < count:
            if self.process.poll() is not None or time.monotonic() > end:
                raise SystemExit(f"the demo has not shown its page:\n{self.said}")
            time.sleep(0.1)
        return found


@contextlib.contextmanager
def running_demo() -> Iterator[Demo]:
    """Run the demo in a folder that is gone afterwards."""
    with tempfile.TemporaryDirectory() as folder:
        demo = Demo(Path(folder))
        try:
            yield demo
        finally:
            demo.process.terminate()  # a job in the background ignores SIGINT
            demo.process.wait()


def wait_for(page: Page, condition: str, argument: Any = None) -> None:
    """Wait until a function of JavaScript returns true."""
    end = time.monotonic() + PATIENCE
    while not page.evaluate(condition, argument):
        if time.monotonic() > end:
            raise SystemExit(f"this has not become true in the page: {condition}")
        page.wait_for_timeout(50)


def save(page: Page, path: Path) -> None:
    """Save what the window shows, once it shows no more of what has just been done."""
    page.mouse.move(2, 2)
    page.wait_for_timeout(1500)
    with Image.open(io.BytesIO(page.screenshot())) as image:
        image.convert("RGB").save(path, optimize=True)
    sys.stdout.write(f"{path.name}: {path.stat().st_size / 1000:.0f} kB\n")


def take_run(page: Page, url: str, path: Path) -> None:
    """Look back on a run."""
    page.goto(url)
    wait_for(page, "() => window.hypermapRun?.shown && window.hypermapRun.steps.length > 0")
    last = page.evaluate("() => window.hypermapRun.steps.length - 1")
    page.locator("#slider").fill(str(round(SEEN_AT * last)))
    save(page, path)


def take_growth(page: Page, url: str, path: Path) -> None:
    """Go through a run from the first frame to the last, as an animated picture."""
    page.goto(url)
    wait_for(page, "() => window.hypermapRun?.shown && window.hypermapRun.steps.length > 0")
    last = page.evaluate("() => window.hypermapRun.steps.length - 1")
    page.mouse.move(2, 2)
    frames = []
    for i in range(GROWTH_FRAMES):
        page.locator("#slider").fill(str(round(i * last / (GROWTH_FRAMES - 1))))
        page.wait_for_timeout(700)  # the camera's image is loaded, and the map drawn
        with Image.open(io.BytesIO(page.screenshot())) as image:
            height = round(GROWTH_WIDTH * image.height / image.width)
            frames.append(image.convert("RGB").resize((GROWTH_WIDTH, height), Image.LANCZOS))
    steps = [GROWTH_STEP] * (len(frames) - 1) + [GROWTH_END]
    frames[0].save(
        path,
        save_all=True,
        append_images=frames[1:],
        duration=steps,
        loop=0,
        quality=60,
        method=6,
    )
    sys.stdout.write(f"{path.name}: {path.stat().st_size / 1000:.0f} kB\n")


def click_at(page: Page, place: tuple[float, float]) -> None:
    """Click on a point of the map [m], and wait for the answer."""
    page.wait_for_timeout(1000)  # the map may fly to what was asked before
    column, row = page.evaluate(
        """(point) => {
            const {map} = window.hypermapPage;
            const {left, top} = map.getTargetElement().getBoundingClientRect();
            const [column, row] = map.getPixelFromCoordinate(point);
            return [left + column, top + row];
        }""",
        list(place),
    )
    page.mouse.click(column, row)
    page.locator("#panel section.at").first.wait_for()


def open_page(page: Page, url: str) -> None:
    """Open the page of the map."""
    page.goto(url)
    wait_for(page, "() => window.hypermapPage !== undefined")
    page.evaluate("() => window.hypermapPage.ready")


def take_page(page: Page, path: Path) -> None:
    """Click on a thing that stands on another."""
    click_at(page, CUP)
    save(page, path)


def take_evidence(page: Page, path: Path) -> None:
    """Click an object, and show its evidence."""
    click_at(page, SOFA)
    page.locator("#panel .evidence .opener").click()
    page.locator("#panel .outlines").first.wait_for()
    for outline in ("seen", "cameras"):
        box = page.locator(f'#panel [data-outline="{outline}"] input')
        box.check()
    save(page, path)


def take_rviz(path: Path) -> None:
    """Serve the demo's room on ROS 1, and look at it in rviz, on a screen without a monitor."""
    if missing := [name for name in ("Xvfb", "roscore", "rviz") if shutil.which(name) is None]:
        raise SystemExit(f"{', '.join(missing)}: not installed, see scripts/ros1.sh")
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:

        def start(*command: str, **options: Any) -> subprocess.Popen[bytes]:
            log = stack.enter_context((Path(folder) / f"{command[0]}.log").open("wb"))
            process = subprocess.Popen(
                command, cwd=folder, env=environment, stdout=log, stderr=log, **options
            )
            stack.callback(process.wait)
            stack.callback(process.terminate)
            return process

        environment = {**os.environ, "ROS_HOME": folder, "LIBGL_ALWAYS_SOFTWARE": "1"}
        environment["PATH"] = os.pathsep.join(
            [str(Path(sys.executable).parent), os.environ["PATH"]]
        )
        with socket.create_server(("127.0.0.1", 0)) as free:
            master = free.getsockname()[1]
        environment |= {"ROS_MASTER_URI": f"http://127.0.0.1:{master}", "ROS_IP": "127.0.0.1"}
        reader, writer = os.pipe()
        screen = f"{RVIZ_SIZE[0]}x{RVIZ_SIZE[1]}x24"
        start("Xvfb", "-displayfd", str(writer), "-screen", "0", screen, pass_fds=[writer])
        os.close(writer)
        with os.fdopen(reader) as number:
            environment["DISPLAY"] = f":{number.readline().strip()}"
        start("roscore", "-p", str(master))
        wait_for_port(master)
        ground_truth(demo_world()).save(Path(folder) / "room.hmap")
        start("hypermap", "serve", "room.hmap", "--ros1")
        start("hypermap", "rviz", "room.hmap")
        image = drawn(environment["DISPLAY"])
    image.save(path, optimize=True)
    sys.stdout.write(f"{path.name}: {path.stat().st_size / 1000:.0f} kB\n")


def wait_for_port(port: int) -> None:
    """Wait until a program listens there."""
    end = time.monotonic() + PATIENCE
    while True:
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port)):
            return
        if time.monotonic() > end:
            raise SystemExit(f"nothing listens on port {port}")
        time.sleep(0.5)


def drawn(display: str) -> Image.Image:
    """Return the window on a black screen, once the sofa is in it and nothing moves any more."""
    outline = 255 * np.array(class_colors(["sofa"])["sofa"])
    end = time.monotonic() + PATIENCE
    before = np.empty(0)
    while time.monotonic() < end:
        screen = ImageGrab.grab(xdisplay=display).convert("RGB")
        image = screen.crop(screen.getbbox() or (0, 0, 100, 100))
        pixels = np.asarray(image)[:-40]  # without the frames per second
        there = (np.abs(pixels - outline).max(axis=2) < 6).sum() > 100
        if there and np.array_equal(pixels, before):
            return image
        before = pixels
        time.sleep(5)
    raise SystemExit("rviz has not shown the map")


def take_in_browser(wanted: Sequence[str], folder: Path) -> None:
    """Take the pictures of a run and of the page, of one demo."""
    chromium = (
        os.environ.get("HYPERMAP_CHROMIUM")
        or shutil.which("chromium-headless-shell")
        or shutil.which("chromium")
    )
    if chromium is None:
        raise SystemExit("Chromium is not installed: scripts/chromium.sh")
    with running_demo() as demo, sync_playwright() as playwright:
        run, of_map = demo.addresses(3)[1:]  # it says that of the run again in the end
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        page = browser.new_page(viewport=SIZE)
        page.set_default_timeout(60_000)
        if "growing" in wanted:
            take_growth(page, run, folder / "growing.webp")
        if "watching" in wanted:
            take_run(page, run, folder / "watching.png")
        if {"page", "evidence"} & set(wanted):
            open_page(page, of_map)
        if "page" in wanted:
            take_page(page, folder / "page.png")
        if "evidence" in wanted:
            take_evidence(page, folder / "evidence.png")
        browser.close()


def main() -> None:
    """Take all pictures, or those that are named."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(NAMES)}")
    parser.add_argument("--output", type=Path, default=IMAGES, metavar="FOLDER")
    given = parser.parse_args()
    wanted = given.names or NAMES
    if unknown := set(wanted) - set(NAMES):
        parser.error(f"there is no picture {unknown.pop()!r}, only {', '.join(NAMES)}")
    folder: Path = given.output
    folder.mkdir(parents=True, exist_ok=True)
    if set(wanted) - {"rviz"}:
        take_in_browser(wanted, folder)
    if "rviz" in wanted:
        take_rviz(folder / "rviz.png")


if __name__ == "__main__":
    main()
