"""The map server's `automap`: what a camera covers of an area, through a real roscore."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.request import Request, urlopen

import numpy as np
import pytest
import shapely

from hypermap import GridGeometry, Hypermap, OccupancyLayer, SemanticLayer
from hypermap.core.frames import FrameTree
from hypermap.exploration import Explorer
from hypermap.formats import open_map
from hypermap.viewer.live.page import is_page_built

from .conftest import Process, wait_for
from .map_server_tools import LAB, Client, saved

pytestmark = pytest.mark.xdist_group("ros")

NODE = "automap_server"
GRID = "nav_msgs/OccupancyGrid"


@pytest.fixture(scope="module")
def directory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("maps")


@pytest.fixture(scope="module")
def server(rospy: Any, directory: Path) -> Iterator[Process]:
    """A server of a floor of 10 x 8 m with a wall across it at x = 6."""
    cells = np.zeros((80, 100), dtype=np.int8)
    cells[:, 60] = 100
    grid = OccupancyLayer("occupancy", "map", GridGeometry(100, 80, 0.1), cells)
    things = SemanticLayer("semantic", "lab")
    file = saved(Hypermap([grid, things], FrameTree([LAB])), directory / "floor.hmap")
    words = [str(file), "--ros1", "--map-directory", str(directory), "--param", "automap=true"]
    words += ["--view"] if is_page_built() else []
    command = [sys.executable, "-m", "hypermap", "serve", *words, f"__name:={NODE}"]
    process = Process(command, directory / "log")
    process.expect("loaded")
    yield process
    process.stop()


@pytest.fixture
def client(rospy: Any, server: Process) -> Client:
    """Return a client of the server, which has reloaded the floor and has no area."""
    client = Client(rospy, NODE)
    assert client.call("load_map", "LoadMap", filename="floor.hmap").success
    return client


def cells_of(message: Any) -> np.ndarray:
    return np.array(message.data, dtype=np.int8).reshape(message.info.height, message.info.width)


def area(client: Client, x0: float, y0: float, x1: float, y1: float, frame: str = "map") -> Any:
    message = client.box(x0, y0, x1, y1)
    message.header.frame_id = frame
    return message


def test_what_is_covered_of_an_area_becomes_known(
    client: Client, server: Process, directory: Path
) -> None:
    server.expect("automap: waiting on /polygon for the area to map")
    polygon = client.publisher("/polygon", "geometry_msgs/PolygonStamped", latch=False)
    covered = client.publisher("/mapping/complete_area_pg", "geometry_msgs/PolygonStamped")
    polygon.publish(area(client, 2, 2, 8, 6))
    server.expect("automap: 24.0 m2 are to be mapped")
    begun = client.heard("mapped_grid_map", GRID)
    cells = cells_of(begun)
    assert cells.shape == (80, 100)
    assert set(cells.ravel().tolist()) == {-1, 100}  # nothing but the border is known
    assert cells[40, 50] == cells[10, 10] == -1
    assert cells[20, 20:80].tolist() == [100] * 60
    assert cells[40, 19] == 100

    # In the lab's frame (x, y) is (10 - y, x) of the map: x from 1 to 7, y from 1 to 5.
    covered.publish(area(client, 1, 3, 5, 9, frame="lab"))
    client.heard("mapped_grid_map", GRID, lambda m: 0 in m.data)
    cells = cells_of(client.heard("mapped_grid_map", GRID))
    assert (cells[22:49, 22:59] == 0).all()
    assert (cells[22:49, 60] == 100).all()  # the wall
    assert cells[52:58, 40].tolist() == [-1] * 6  # not covered yet
    assert (cells[12:18, 12:40] == -1).all()  # covered, but not of the area
    assert cells[20, 30] == 100  # the border stays
    before = client.heard("occupancy_map", GRID)
    assert cells_of(before)[20, 30] == 0  # and the occupancy layer is as it was

    assert client.call("store_map", "StoreMap", filename="automap.hmap").success
    stored = open_map(directory / "automap.hmap")
    explorer = Explorer(stored, [4.0, 4.0], occupancy="mapped_grid")
    for border in explorer.frontiers():  # lead to the rest of the area, and not out of it
        assert shapely.box(2, 2, 8, 6).contains(shapely.Point(border.place_xy))
    assert explorer.frontiers()
    for publisher in (polygon, covered):
        publisher.unregister()


def test_an_area_is_chosen_on_the_page(client: Client, server: Process) -> None:
    if not is_page_built():
        pytest.skip("the page is not built (make page)")
    found = re.search(r"showing the map at (http://127\.0\.0\.1:\d+)/\?token=(\S+)", server.output)
    assert found is not None
    address, token = found.groups()

    def ask(path: str, **body: Any) -> Any:
        data = json.dumps(body).encode() if body else None
        request = Request(f"{address}/api/{path}", data, {"X-Hypermap-Token": token})
        with urlopen(request) as answer:
            return json.load(answer)

    wait_for(lambda: ask("map")["layers"], "the map that was loaded last")
    begun = ask("coverage", polygon=[[2, 2], [8, 2], [8, 6], [2, 6]])
    assert (begun["size"], begun["share"]) == (24.0, 0.0)
    server.expect("automap: 24.0 m2 are to be mapped")
    assert set(client.heard("mapped_grid_map", GRID).data) == {-1, 100}

    covered = client.publisher("/mapping/complete_area_pg", "geometry_msgs/PolygonStamped")
    covered.publish(area(client, 0, 0, 5, 8))
    wait_for(lambda: 0.45 < ask("coverage")["share"] < 0.55, "the covered half")
    assert ask("coverage")["rest_size"] == pytest.approx(12.0, abs=1.0)
    names = wait_for(lambda: [layer["name"] for layer in ask("map")["layers"]][2:], "the layer")
    assert names == ["mapped_grid"]
    covered.unregister()


def test_areas_that_are_none_are_ignored(client: Client, server: Process) -> None:
    polygon = client.publisher("/polygon", "geometry_msgs/PolygonStamped", latch=False)
    polygon.publish(client.message("geometry_msgs/PolygonStamped"))
    server.expect("/polygon: ")
    server.expect("; the area is ignored")
    polygon.publish(area(client, 50, 50, 60, 60))
    server.expect("the area covers no cell of layer 'occupancy'; the area is ignored")
    assert "mapped_grid_map" not in client.published()
    polygon.unregister()
