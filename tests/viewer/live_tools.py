"""The page's server, asked as the page asks it, without a network between."""

from __future__ import annotations

import contextlib
import io
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from PIL import Image
from starlette.testclient import TestClient

from hypermap.core.frames import FrameTree, Pose2D, Transform
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.formats import save_map
from hypermap.testing import occupancy_from_text, square
from hypermap.viewer.live.app import MapApp
from hypermap.viewer.live.document import MapDocument

HOST = "http://127.0.0.1"
BED = [[8.0, 5.0], [9.0, 5.0], [9.0, 7.0], [8.0, 7.0]]


class Window:
    """What one window of the page sends; it knows the version that it has seen last."""

    def __init__(self, client: TestClient) -> None:
        self.client = client
        self.info = self.get("/api/map")
        self.version: int = self.info["version"]
        self.headers = {"X-Hypermap-Token": self.info["token"]}

    def get(self, path: str, /, expected: int = 200, **values: Any) -> Any:
        answer = self.client.get(path, params=values)
        assert answer.status_code == expected, answer.text
        return answer.json()

    def post(self, path: str, expected: int = 200, /, **body: Any) -> Any:
        answer = self.client.post(path, json=body, headers=self.headers)
        assert answer.status_code == expected, answer.text
        return answer.json()

    def edit(self, *operations: dict[str, Any], expected: int = 200) -> Any:
        answer = self.post("/api/edit", expected, version=self.version, operations=operations)
        if expected == 200:
            self.version = answer["version"]
        return answer

    def go(self, path: str, expected: int = 200) -> Any:
        """Undo or redo."""
        answer = self.post(path, expected, version=self.version)
        if expected == 200:
            self.version = answer["version"]
        return answer

    def names(self, layer: str = "things") -> dict[int, str]:
        values = {"bbox": "-1e6,-1e6,1e6,1e6", "resolution": 0.01}
        shapes = self.get(f"/api/shapes/{layer}", **values)["features"]
        return {shape["id"]: shape["name"] for shape in shapes}


@contextlib.contextmanager
def serving(path: Path, *, is_editable: bool = True) -> Iterator[TestClient]:
    """Yield a client of the server of a map's page."""
    app = MapApp(MapDocument(path, is_editable))
    with TestClient(app.app, base_url=HOST, raise_server_exceptions=True) as client:
        client.get("/", params={"token": app.token})  # it is a cookie from then on
        yield client


def a_map() -> Hypermap:
    """A grid of six cells, and objects in a frame that lies turned by 90 degrees at (10, 0)."""
    grid = occupancy_from_text("##?\n..#", resolution=2.0)
    ring = shapely.box(4, 0, 8, 4).difference(shapely.box(5, 1, 7, 3))
    things = [
        square("cup", 1, 1, 0.2, tags=("mug", "glass"), confidence=(0.7, 0.2)),
        square("table", 1, 1, 2.0, existence=4.5, first_seen=1.0, last_seen=9.0),
        SemanticObject("rug", ring, attributes={"color": "red"}),
    ]
    frames = FrameTree([Transform("map", "lab", Pose2D(x=10.0, yaw=math.pi / 2))])
    return Hypermap([grid, SemanticLayer("things", "lab", things)], frames)


def saved(folder: Path, hypermap: Hypermap | None = None, name: str = "room.hmap") -> Path:
    path = folder / name
    save_map(a_map() if hypermap is None else hypermap, path)
    return path


# Operations


def add(name: str = "bed", polygon: object = BED, **others: object) -> dict:
    return {"op": "add", "layer": "things", "name": name, "polygon": polygon, **others}


def rename(number: int, name: str) -> dict:
    return {"op": "update", "layer": "things", "id": number, "name": name}


def remove(number: int) -> dict:
    return {"op": "remove", "layer": "things", "id": number}


# What is there


def files_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def pixels_of(png: bytes) -> NDArray[np.uint8]:
    """Return a picture's colors, row 0 at the top, shape (H, W, 4)."""
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGBA"))
