"""Maps from files and back: YAML compared with yaml-cpp and libpng, GeoParquet, and large pictures.

Each load and save is that of a fresh process, whose memory is measured with it.
"""

from __future__ import annotations

import json
import math
import statistics
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from hypermap import GridGeometry, Hypermap, OccupancyLayer, SemanticLayer, save_map
from hypermap.core.arrays import as_objects
from hypermap.core.objects import ObjectTable
from suite import programs
from suite.race import Disagreement, Figure, Growth, Kind, Race, Row, Settings, each_of

_CHILD = Path(__file__).with_name("map_process.py")
_CLASSES = ("chair", "table", "cup", "potted plant", "tvmonitor", "sofa", "person")
_LARGE = 4000  # cells
_TELLING = 500  # cells; of smaller pictures, only the growth is given
_MOST_RUNS = 3  # of what takes the peer half a minute
_LEAST_MB = 0.1  # a process grows by pages and arenas, so that less cannot be measured
_SUMS = ("objects", "tags", "area", "confidence", "seen", "free", "occupied", "unknown")


def rows(settings: Settings) -> Iterator[Row]:
    """Yield loads and saves of large maps, and how they grow."""
    yield from each_of(
        settings,
        {
            "a map compared with yaml-cpp and libpng": _beside_cpp,
            "many objects as GeoParquet": _binary,
            "growth of objects": _growth_of_objects,
            "pictures": _pictures,
        },
    )


def _beside_cpp(settings: Settings) -> Iterator[Row]:
    count, side = (2_000, 500) if settings.quick else (100_000, 4000)
    work = f"{count} objects + {side} x {side} cells"
    folder = _folder(settings)
    as_yaml, as_parquet = folder / f"{count}.hmap", folder / f"{count}.parquet.hmap"
    loose = folder / f"{count}"
    if not (loose / "map.yaml").exists():
        hypermap = Hypermap([_grid(side), _objects(count)])
        save_map(hypermap, as_yaml, semantic="yaml")
        save_map(hypermap, as_parquet, semantic="parquet")
        loose.mkdir(exist_ok=True)
        save_map(hypermap, loose / "map.yaml", semantic="yaml")
    program = programs.build("yaml_cpp/load_map.cpp", ["yaml-cpp", "libpng"], settings)
    ours, binary, theirs = [], [], []
    for _ in range(min(settings.repeat, _MOST_RUNS)):
        files = (loose / "semantic", loose / "occupancy.png", folder / "cpp")
        theirs.append(programs.run(program, *files, 1))
        ours.append(_measured(as_yaml, "yaml", settings))
        binary.append(_measured(as_parquet, "parquet", settings))
    agreement = _agree(ours[0], theirs[0])
    _agree(binary[0], theirs[0])
    peer = "C++: yaml-cpp 0.7, libpng 1.6, without the zip archive"
    for verb, asked in (("load", None if settings.quick else 10), ("save", None)):
        other = tuple(run[verb][0] for run in theirs)
        for form, runs in (("YAML", ours), ("GeoParquet", binary)):
            mine = tuple(run[verb] for run in runs)
            yield Race(f"{verb} {work}, {form}", peer, mine, other, agreement, asked)
    for form, runs in (("YAML", ours), ("GeoParquet", binary)):
        for key, what, most in (
            ("resident_mb", "held", 328),
            ("load_peak_mb", "at the peak of loading", 872),
        ):
            yield Figure(
                f"memory {what}: {work}, {form}",
                tuple(run[key] for run in runs),
                "MB",
                None if settings.quick else most,
                less_is_better=True,
                note=f"Python and libraries {runs[0]['before_mb']:.0f} MB of it; "
                f"C++ {theirs[0][key.removeprefix('load_')]:.0f} MB",
            )


def _binary(settings: Settings) -> Iterator[Row]:
    count = 20_000 if settings.quick else 1_000_000
    runs = [_measured(_binary_map(count, settings), "parquet", settings) for _ in range(2)]
    work = f"{count} objects as GeoParquet"
    asked = None if settings.quick else 3.0
    yield Figure(f"load {work}", _all(runs, "load"), "s", asked, less_is_better=True)
    yield Figure(f"save {work}", _all(runs, "save"), "s", less_is_better=True)
    yield Figure(f"memory held: {work}", _all(runs, "resident_mb"), "MB", less_is_better=True)


def _growth_of_objects(settings: Settings) -> Iterator[Row]:
    sizes = [10**power for power in range(2, 5 if settings.quick else 7)]
    for form, counts in (("GeoParquet", sizes), ("YAML", sizes[:4])):
        measured = []
        for count in counts:
            if form == "YAML":
                path = _folder(settings) / f"{count}.yaml.hmap"
                if not path.exists():
                    save_map(Hypermap([_objects(count)]), path, semantic="yaml")
            else:
                path = _binary_map(count, settings)
            times = min(settings.repeat, _MOST_RUNS)
            kind = form.lower().removeprefix("geo")
            measured.append([_measured(path, kind, settings) for _ in range(times)])
        yield from _grown(f"objects as {form}", "objects", counts, measured)


def _pictures(settings: Settings) -> Iterator[Row]:
    sides = (100, 500, 1000) if settings.quick else (100, 320, 1000, 4000, 10_000)
    measured = []
    for side in sides:
        path = _folder(settings) / f"{side}.hmap"
        if not path.exists():
            save_map(Hypermap([_grid(side)]), path)
        runs = [_measured(path, "yaml", settings) for _ in range(min(settings.repeat, 2))]
        measured.append(runs)
        if side < _TELLING:
            continue
        for verb in ("load", "save"):
            yield Figure(f"{verb} {side} x {side} cells", _all(runs, verb), "s", None, True)
        for key, what in (("resident_mb", "held"), ("peak_mb", "at the peak of both")):
            values = tuple((run[key] - run["before_mb"]) * 1e6 / side**2 for run in runs)
            asked = 1.5 if side >= _LARGE else None  # of smaller ones, constant costs count
            yield Figure(f"memory {what}: {side} x {side} cells", values, "bytes/cell", asked, True)
    yield from _grown("pictures", "cells", [side**2 for side in sides], measured)


def _grown(
    what: str, of: Kind, sizes: Sequence[int], measured: Sequence[Sequence[dict[str, Any]]]
) -> Iterator[Growth]:
    """Yield how loading and saving grow, with the memory held and that at the peak of both."""
    for verb, key, note in (
        ("load", "resident_mb", "memory: what is held then"),
        ("save", "peak_mb", "memory: the peak of loading and saving"),
    ):
        seconds = tuple(statistics.median(_all(runs, verb)) for runs in measured)
        held = (statistics.median(run[key] - run["before_mb"] for run in runs) for runs in measured)
        amounts = tuple(1e6 * max(megabytes, _LEAST_MB) for megabytes in held)
        yield Growth(f"{verb} {what}", of, tuple(sizes), seconds, amounts, note=note)


def _measured(path: Path, form: str, settings: Settings) -> dict[str, Any]:
    """Return what loading and saving a map takes in a process of its own."""
    folder = _folder(settings)
    small = folder / "small.hmap"
    if not small.exists():
        save_map(Hypermap([_grid(50), _objects(20)]), small, semantic="yaml")
    command = [sys.executable, str(_CHILD), str(path), str(small), str(folder / "out.hmap"), form]
    answer = subprocess.run(command, capture_output=True, text=True, check=True)
    measured: dict[str, Any] = json.loads(answer.stdout)
    return measured


def _agree(ours: dict[str, Any], theirs: dict[str, Any]) -> str:
    for key in _SUMS:
        if not math.isclose(ours[key], theirs[key], rel_tol=1e-9):
            raise Disagreement(f"{key}: ours {ours[key]}, theirs {theirs[key]}")
    return f"same {', '.join(_SUMS)}"


def _all(runs: Sequence[dict[str, Any]], key: str) -> tuple[float, ...]:
    return tuple(run[key] for run in runs)


def _folder(settings: Settings) -> Path:
    folder = settings.build / "files"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _binary_map(count: int, settings: Settings) -> Path:
    path = _folder(settings) / f"{count}.objects.hmap"
    if not path.exists():
        save_map(Hypermap([_objects(count)]), path, semantic="parquet")
    return path


def _objects(count: int) -> SemanticLayer:
    """Return objects of four to eight corners, all whose keys have values."""
    rng = np.random.default_rng(0)
    corners = rng.integers(4, 9, count)
    ends = np.cumsum(corners + 1)
    owner = np.repeat(np.arange(count), corners + 1)
    number = np.arange(ends[-1]) - np.repeat(ends - corners - 1, corners + 1)
    angle = 2 * np.pi * (number % corners[owner]) / corners[owner]
    width = np.sqrt(count) * 1.5
    points = rng.uniform(0, width, (count, 2))[owner]
    points += rng.uniform(0.1, 0.7, count)[owner, None] * np.stack(
        [np.cos(angle), np.sin(angle)], 1
    )
    offsets = np.append(0, ends)
    shapes = shapely.from_ragged_array(
        shapely.GeometryType.POLYGON, points, (offsets, np.arange(count + 1))
    )
    lists = [tuple(np.roll(_CLASSES, shift)[:3].tolist()) for shift in range(len(_CLASSES))]
    codes = rng.integers(0, len(_CLASSES), count)
    first_seen = 1305031229 + np.arange(count) / 10
    table = ObjectTable(
        ids=np.arange(count),
        codes=codes.astype(np.int32),
        footprints=as_objects(shapes),
        tags=as_objects(lists[code] for code in codes),
        confidence=as_objects(map(tuple, rng.uniform(0, 1, (count, 3)).round(3).tolist())),
        existence=rng.integers(1, 200, count) / 10,
        first_seen=first_seen,
        last_seen=first_seen + 1,
        attributes=as_objects({} for _ in range(count)),
        vocabulary={name: code for code, name in enumerate(_CLASSES)},
    )
    return SemanticLayer.of_table("semantic", "map", table)


def _grid(side: int) -> OccupancyLayer:
    """Return rooms of many sizes in unknown land."""
    rng = np.random.default_rng(0)
    cells = np.full((side, side), -1, np.int8)
    for _ in range(400):
        y, x, h, w = rng.integers(1, [side, side, side // 10, side // 10], 4)
        cells[y : y + h, x : x + w] = 0
        cells[y, x : x + w] = cells[y : y + h, x] = 100
    return OccupancyLayer("occupancy", "map", GridGeometry(side, side, 0.05), cells)
