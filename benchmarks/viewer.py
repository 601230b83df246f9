"""How fast the server of the page answers, without the browser and the network.

A grid of 10,000 x 10,000 cells at 5 cm, a tenth of them occupied, and 100,000 objects of about 20
corners, on 500 m x 500 m. Prints ms for the first answer and the median of further ones
of the same kind, and the size of an answer.

    python benchmarks/viewer.py [--side 10000] [--objects 100000]
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

import numpy as np
import shapely
from starlette.testclient import TestClient

from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.formats import save_map
from hypermap.viewer.live.app import MapApp
from hypermap.viewer.live.document import MapDocument

RESOLUTION, CLASSES = 0.05, 40


def large_map(side: int, count: int, rng: np.random.Generator) -> Hypermap:
    """Return a grid and objects that cover the same floor."""
    cells = np.where(rng.random((side, side), dtype=np.float32) < 0.1, np.int8(100), np.int8(0))
    grid = OccupancyLayer("grid", "map", GridGeometry(side, side, RESOLUTION), cells)
    angles = np.linspace(0, 2 * np.pi, 20, endpoint=False)
    rays = np.column_stack([np.cos(angles), np.sin(angles)])
    places = rng.uniform(1, side * RESOLUTION - 1, (count, 2))
    radii = rng.uniform(0.15, 0.6, count)[:, np.newaxis] * rng.uniform(0.9, 1.1, (count, 20))
    corners = places[:, np.newaxis] + radii[:, :, np.newaxis] * rays
    outlines = shapely.polygons(corners.round(3))
    things = [
        SemanticObject(f"class {number}", outline)
        for number, outline in zip(rng.integers(0, CLASSES, count), outlines, strict=True)
    ]
    return Hypermap([grid, SemanticLayer("things", "map", things)])


def report(what: str, ask: Callable[[int], bytes], times: int = 15) -> None:
    """Print how long the first answer and further ones take, and how large the last one is."""
    taken = []
    for number in range(times):
        started = time.perf_counter()
        content = ask(number)
        taken.append(1000 * (time.perf_counter() - started))
    first, rest = taken[0], median(taken[1:])
    print(f"| {what} | {first:.0f} | {rest:.1f} | {len(content) / 1000:.0f} |", flush=True)


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--side", type=int, default=10_000)
    parser.add_argument("--objects", type=int, default=100_000)
    options = parser.parse_args()
    hypermap = large_map(options.side, options.objects, np.random.default_rng(1))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "large.hmap"
        save_map(hypermap, path)
        started = time.perf_counter()
        document = MapDocument(path)
        print(f"opening the file: {time.perf_counter() - started:.1f} s")
    with TestClient(MapApp(document).app, base_url="http://127.0.0.1") as client:
        token = client.get("/api/map").json()["token"]

        def get(url: str) -> bytes:
            answer = client.get(url)
            assert answer.status_code == 200, answer.text
            return answer.content

        def shapes(number: int, view: float, resolution: float) -> bytes:
            x = (number * 17.3) % max(options.side * RESOLUTION - view, 1)
            box = f"{x},{x},{x + view},{x + view}"
            return get(f"/api/shapes/things?bbox={box}&resolution={resolution}")

        def rename(number: int) -> bytes:
            version = client.get("/api/map").json()["version"]
            operation = {"op": "update", "layer": "things", "id": number, "name": "renamed"}
            body = {"version": version, "operations": [operation]}
            headers = {"X-Hypermap-Token": token}
            answer = client.post("/api/edit", json=body, headers=headers)
            assert answer.status_code == 200, answer.text
            return answer.content

        print("| question | first, ms | then, ms | kB |")
        print("| --- | ---: | ---: | ---: |")
        # Servers of their own, which have not made the coarse copies of the grid yet.
        for what, url in (
            ("what the map is", "map"),
            ("tile of the whole grid", "tiles/grid/8/0/0.png"),
        ):
            with TestClient(MapApp(document).app, base_url="http://127.0.0.1") as fresh:
                report(what, lambda _, url=url, fresh=fresh: fresh.get(f"/api/{url}").content)
        for zoom in (0, 3, 5):
            report(
                f"tile, {2**zoom} cm per pixel",
                lambda number, zoom=zoom: get(
                    f"/api/tiles/grid/{zoom}/{number % 6}/{number % 5}.png"
                ),
            )
        for view, resolution in ((10.0, 0.01), (100.0, 0.1), (500.0, 0.5)):
            report(
                f"shapes, view of {view:g} m, {100 * resolution:g} cm per pixel",
                lambda number, view=view, resolution=resolution: shapes(number, view, resolution),
            )
        report("what is at a point", lambda n: get(f"/api/at?x={10 + n}&y={20 + n}"))
        report(
            "where is the nearest", lambda n: get(f"/api/find?name=class 7&near={n},{n}&limit=20")
        )
        report("renaming an object, with /api/map before it", rename)


if __name__ == "__main__":
    main()
