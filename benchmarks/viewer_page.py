"""How soon the page in the browser shows a large map, and how fluently it moves.

Makes a map of 4000 x 4000 cells of 5 cm and 100,000 objects, serves it with `hypermap view`, and
opens the page in headless Chromium, which draws in software. Prints the time from the start of the
command to its address, from opening the page to the first complete picture, and the frames per
second while the mouse drags the map about, at several zooms.

    make page && python benchmarks/viewer_page.py [--objects 100000] [--cells 4000] [--runs 3]
"""

from __future__ import annotations

import argparse
import math
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import shapely
from playwright.sync_api import Page, sync_playwright

from hypermap import Hypermap, OccupancyLayer, SemanticLayer, SemanticObject, save_map
from hypermap.core.grid import GridGeometry

RESOLUTION = 0.05  # m
ROOM = 80  # cells along the side of a room
NAMES = ("chair", "table", "tv", "cup", "potted plant", "bench", "bin", "shelf", "lamp", "person")

SIZE = {"width": 1200, "height": 800}
ARGUMENTS = ["--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking"]
DRAWN = """async () => {
    await window.hypermapPage.ready;
    const {map, view} = window.hypermapPage;
    do {  // questions that the page has put off for a moment come first
        await new Promise((later) => setTimeout(later, 200));
        await view.showShapes();
    } while ([...view.layers.values()].some(({shapes}) => shapes && !shapes.loaded));
    await new Promise((done) => { map.once("rendercomplete", done); map.render(); });
}"""
ZOOM = """(resolution) => {
    const view = window.hypermapPage.map.getView();
    view.setCenter([100, 100]);
    view.setResolution(resolution);
}"""
COUNT = """() => {
    if (window.frameTimes === undefined) {
        window.hypermapPage.map.on("postrender", () => window.frameTimes.push(performance.now()));
    }
    window.frameTimes = [];
}"""
DRAWN_OBJECTS = """() => [...window.hypermapPage.view.layers.values()]
    .reduce((sum, {shapes}) => sum + (shapes?.shown ?? 0), 0)"""


def large_map(cells: int, objects: int) -> Hypermap:
    """Return rooms with doors, unknown here and there, and objects all over them."""
    rng = np.random.default_rng(0)
    grid = GridGeometry(cells, cells, RESOLUTION)
    values = np.zeros(grid.shape, dtype=np.int8)
    values[::ROOM], values[:, ::ROOM] = 100, 100
    doors = np.arange(ROOM // 2, cells, ROOM)
    for shift in range(-8, 8):
        values[:, np.minimum(doors + shift, cells - 1)] = 0
        values[np.minimum(doors + shift, cells - 1)] = 0
    rooms = -(-cells // ROOM)
    unknown = np.kron(rng.random((rooms, rooms)) < 0.1, np.ones((ROOM, ROOM), dtype=bool))
    values[unknown[:cells, :cells]] = -1
    centers = rng.uniform(0, cells * RESOLUTION, (objects, 2))
    sides = rng.uniform(0.15, 0.9, (objects, 2)) / 2
    angles = rng.uniform(0, np.pi, objects)
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * sides[:, np.newaxis]
    c, s = np.cos(angles)[:, np.newaxis], np.sin(angles)[:, np.newaxis]
    turned = np.stack(
        [c * corners[..., 0] - s * corners[..., 1], s * corners[..., 0] + c * corners[..., 1]],
        axis=2,
    )
    shapes = shapely.polygons(turned + centers[:, np.newaxis])
    names = rng.choice(NAMES, objects)
    things = [
        SemanticObject(str(name), shape, existence=4.0)
        for name, shape in zip(names, shapes, strict=True)
    ]
    return Hypermap(
        [OccupancyLayer("occupancy", "map", grid, values), SemanticLayer("semantic", "map", things)]
    )


def main() -> None:
    """Run the benchmark."""
    installed = shutil.which("chromium-headless-shell") or shutil.which("chromium")
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--objects", type=int, default=100_000)
    parser.add_argument("--cells", type=int, default=4000)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--chromium", default=installed)
    parser.add_argument("--map", type=Path, help="this map in place of a new one")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = arguments.map or Path(folder) / "large.hmap"
        if not path.exists():
            save_map(large_map(arguments.cells, arguments.objects), path)
        for run in range(arguments.runs):
            print(f"run {run + 1}")
            show(path, arguments)


def show(path: Path, arguments: argparse.Namespace) -> None:
    """Serve the map, open the page, drag it about, and print the times."""
    began = time.monotonic()
    command = [sys.executable, "-m", "hypermap", "view", str(path), "--no-browser", "--port", "0"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as server:
        try:
            url = address(server)
            print(f"  from the command to the address  {time.monotonic() - began:6.2f} s")
            with sync_playwright() as playwright:
                browser = playwright.chromium.launch(
                    executable_path=arguments.chromium, args=ARGUMENTS
                )
                look(browser.new_page(viewport=SIZE), url, arguments.seconds)
                browser.close()
        finally:
            server.send_signal(signal.SIGINT)
            server.communicate()


def address(server: subprocess.Popen[str]) -> str:
    """Return what the command prints, once it does."""
    for line in server.stdout or ():
        if found := re.search(r"http://127\.0\.0\.1:\d+/\S*", line):
            return found.group()
    raise SystemExit("the command printed no address")


def look(page: Page, url: str, seconds: float) -> None:
    """Open the page and drag it about at several zooms."""
    page.set_default_timeout(120_000)
    began = time.monotonic()
    page.goto(url)
    while page.evaluate("window.hypermapPage?.map === undefined"):
        page.wait_for_timeout(10)
    page.evaluate(DRAWN)
    print(f"  from the address to the picture  {time.monotonic() - began:6.2f} s")
    print("  m/pixel  objects drawn  frames/s  95 % of frames within [ms]")
    for metres_per_pixel in (0.25, 0.05, 0.02):
        page.evaluate(ZOOM, metres_per_pixel)
        page.evaluate(DRAWN)
        drawn = page.evaluate(DRAWN_OBJECTS)
        page.evaluate(COUNT)
        drag(page, seconds)
        times = np.array(page.evaluate("window.frameTimes"))
        gaps = np.diff(times)
        rate = 1000 * len(gaps) / (times[-1] - times[0])
        slow = np.quantile(gaps, 0.95)
        print(f"  {metres_per_pixel:7g}  {drawn:13}  {rate:8.1f}  {slow:8.0f}")


def drag(page: Page, seconds: float) -> None:
    """Move the pressed mouse in circles."""
    page.mouse.move(750, 230)
    page.mouse.down()
    end = time.monotonic() + seconds
    angle = 0.0
    while time.monotonic() < end:
        angle += 0.08
        page.mouse.move(750 + 200 * math.sin(angle), 430 - 200 * math.cos(angle))
    page.mouse.up()


if __name__ == "__main__":
    main()
