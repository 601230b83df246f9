"""The answers of the first release to its own files, kept so that later ones can be compared.

    python -m campaign.golden

writes maps and answers again: only where a map's format or a question's meaning has changed on
purpose, which CHANGELOG.md must say.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from hypermap import (
    FrameTree,
    Hypermap,
    OccupancyLayer,
    Pose2D,
    SemanticLayer,
    SemanticObject,
    Transform,
    open_map,
    save_map,
)
from hypermap.core.grid import GridGeometry

FOLDER = Path(__file__).resolve().parent / "golden"
ANSWERS = FOLDER / "answers.json"
MAPS = {"archive": "map.hmap", "folder": "folder/hmap_config.yaml", "parquet": "parquet.hmap"}
TOLERANCE = 1e-6  # meters


def differences() -> list[str]:
    """Return in which answers today's program differs from the first release, in words."""
    kept = json.loads(ANSWERS.read_text(encoding="utf-8"))
    found = []
    for name, file in MAPS.items():
        given = json.loads(json.dumps(dict(answers(open_map(FOLDER / file)))))
        for question, expected in kept.items():
            if not _alike(given.get(question), expected):
                found.append(f"{name}: {question}: {given.get(question)}, not {expected}")
    return found


def count() -> int:
    """Return how many answers are kept."""
    return len(MAPS) * len(json.loads(ANSWERS.read_text(encoding="utf-8")))


def answers(hypermap: Hypermap) -> Iterator[tuple[str, Any]]:
    """Yield questions of every kind, as text, and what the map answers."""
    yield "layers", [(layer.name, layer.class_name, layer.frame_id) for layer in hypermap]
    yield "base frame", hypermap.base_frame
    points = [(x / 2, y / 2) for x in range(-2, 11, 3) for y in range(-2, 11, 3)]
    areas = {
        "box": shapely.box(0.3, 0.4, 2.6, 2.7),
        "circle": shapely.Point(2.0, 2.0).buffer(1.3),
        "triangle": shapely.Polygon([(-1, 0), (4, 1), (1, 4.5)]),
    }
    for layer in hypermap:
        name = layer.name
        for frame in (None, "lab"):
            place = f"{name} in {frame}"
            yield f"label_at {place}", hypermap.label_at(name, points, frame).tolist()
            yield f"value_at {place}", hypermap.value_at(name, points, frame).tolist()
            for kind, area in areas.items():
                hits = hypermap.labels_in(name, area, frame)
                yield f"labels_in {kind} {place}", _hits(hits.values, hits.points_xy)
                hits = hypermap.values_in(name, area, frame)
                yield f"values_in {kind} {place}", _hits(hits.values, hits.points_xy)
            for what in ("Occupied", "cup", 2, 57):
                for kind in ("", *areas):
                    found = hypermap.find(name, what, areas.get(kind), frame)
                    yield f"find {what} {kind} {place}", _hits([what] * len(found), found)
                nearest = hypermap.nearest(what, (1.0, 1.5), 3, name, frame)
                yield f"nearest {what} {place}", [_distance(hit) for hit in nearest]
    for given in (
        {"name": "cup"},
        {"near": "table"},
        {"name": "cup", "near": "table", "within": 1.0},
        {"inside": "table"},
        {"inside": areas["circle"]},
        {"tags": ["red"]},
        {"area": areas["triangle"], "frame_id": "lab"},
        {"near": (1.0, 1.0), "limit": 2},
    ):
        text = ", ".join(f"{key} {_shown(value)}" for key, value in given.items())
        found_objects = hypermap.objects(**given)
        yield f"objects {text}", [(hit.object.name, *_distance(hit)) for hit in found_objects]
    for point in points[::5]:
        at = hypermap.objects_at(point)
        yield f"objects_at {point}", [(hit.layer, hit.object.id, hit.object.name) for hit in at]


def write() -> None:
    """Write the maps, and what is answered today."""
    made = _map()
    for name, file in MAPS.items():
        path = FOLDER / file
        path.parent.mkdir(parents=True, exist_ok=True)
        save_map(made, path, "parquet" if name == "parquet" else "yaml")
    kept = answers(open_map(FOLDER / MAPS["archive"]))  # in all of them, the same is kept
    lines = (f"{json.dumps(question)}: {json.dumps(_rounded(answer))}" for question, answer in kept)
    ANSWERS.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


def _map() -> Hypermap:
    """Return a turned grid and two layers of objects, one of them in a frame of its own."""
    rows, cols = np.indices((11, 13))
    cells = np.array([-1, 0, 57, 100], np.int8)[(3 * rows + cols * cols) % 4]
    grid = OccupancyLayer("grid", "map", GridGeometry(13, 11, 0.35, Pose2D(-0.7, -0.4, 0.3)), cells)
    ring = shapely.box(0, 0, 2, 2).difference(shapely.box(0.5, 0.5, 1.5, 1.5))
    objects = [
        SemanticObject("table", shapely.box(0, 0, 2.5, 1.5), tags=("wooden",)),
        SemanticObject("cup", shapely.Point(0.6, 0.7).buffer(0.1), tags=("red",)),
        SemanticObject("cup", shapely.Point(3.1, 2.2).buffer(0.12)),
        SemanticObject("rug", ring, existence=2.5),
        SemanticObject(
            "Tür", shapely.MultiPolygon([shapely.box(4, 0, 5, 1), shapely.box(4, 2, 5, 3)])
        ),
    ]
    lab = [SemanticObject("cup", shapely.box(1, 1, 1.2, 1.2), tags=("red", "big"))]
    layers = [grid, SemanticLayer("things", "map", objects), SemanticLayer("more", "lab", lab)]
    frames = FrameTree([Transform("map", "lab", Pose2D(1.5, -0.5, math.pi / 3))])
    return Hypermap(layers, frames)


def _hits(values: Any, points: Any) -> list[Any]:
    return [
        [_plain(value), *map(float, point)] for value, point in zip(values, points, strict=True)
    ]


def _distance(hit: Any) -> list[Any]:
    far = None if hit.distance is None else float(hit.distance)
    return [hit.layer, *map(float, hit.point_xy), far]


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def _rounded(answer: Any) -> Any:
    """Return an answer with numbers as far as they are compared."""
    if isinstance(answer, list | tuple):
        return [_rounded(item) for item in answer]
    return round(answer, 7) if isinstance(answer, float) else answer


def _shown(value: Any) -> str:
    return value.wkt[:20] if hasattr(value, "wkt") else str(value)


def _alike(given: Any, expected: Any) -> bool:
    """Return whether two answers are the same, with numbers within the tolerance."""
    if isinstance(expected, list):
        return (
            isinstance(given, list)
            and len(given) == len(expected)
            and all(map(_alike, given, expected))
        )
    if isinstance(expected, float) and isinstance(given, float):
        return math.isclose(given, expected, rel_tol=0, abs_tol=TOLERANCE)
    return bool(given == expected)


if __name__ == "__main__":
    write()
