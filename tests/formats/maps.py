"""A small map, and archives written by hand."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import shapely

from hypermap.core.frames import FrameTree, Pose2D, Transform
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer, SemanticObject

LAB_FRAME = Transform("map", "lab", Pose2D(1.0, 2.0, 0.5))


def small_map() -> Hypermap:
    grid = GridGeometry(3, 2, 0.05, Pose2D(-1.0, -2.0))
    cells = np.array([[0, 100, -1], [50, 0, 0]], np.int8)
    chair = SemanticObject("chair", shapely.box(0, 0, 1, 1), id=4)
    return Hypermap(
        [
            OccupancyLayer("occupancy", "map", grid, cells),
            SemanticLayer("objects", "lab", [chair], {"subscribe_mode": True, "vendor": 3}),
        ],
        FrameTree([LAB_FRAME]),
        {"profile": "default"},
    )


def occupancy(hypermap: Hypermap, name: str = "occupancy") -> OccupancyLayer:
    layer = hypermap[name]
    assert isinstance(layer, OccupancyLayer)
    return layer


def semantic(hypermap: Hypermap, name: str = "semantic") -> SemanticLayer:
    layer = hypermap[name]
    assert isinstance(layer, SemanticLayer)
    return layer


CONFIG = """\
layers:
- {class: SemanticLayer, name: semantic, frame_id: map, load_file: true, file: objects}
"""
OBJECTS = "- {name: chair, shape: 'POLYGON((0 0, 1 0, 1 1))'}\n"


def archive(path: Path, files: dict[str, str | bytes]) -> Path:
    with zipfile.ZipFile(path, "w") as target:
        for name, content in files.items():
            target.writestr(name, content)
    return path


def files_of(path: Path) -> dict[str, bytes]:
    if path.suffix == ".hmap":
        with zipfile.ZipFile(path) as archive:
            return {name: archive.read(name) for name in archive.namelist()}
    return {p.name: p.read_bytes() for p in path.parent.iterdir()}
