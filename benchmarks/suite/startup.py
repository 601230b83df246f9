"""How soon a command answers: processes started in turns, all files in the disk's cache.

All modules are compiled beforehand, ours and others', as they are in an installed package.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import shapely

from hypermap import (
    GridGeometry,
    Hypermap,
    OccupancyLayer,
    SemanticLayer,
    SemanticObject,
    save_map,
)
from suite.race import Disagreement, Figure, Row, Settings, race

# What a program that does anything with maps cannot do without.
_LIBRARIES = ("-c", "import numpy, shapely")
_PEER = f"python -c 'import numpy, shapely' (of {np.__version__} and {shapely.__version__})"
_NOT_COMPILED = "PYTHONDONTWRITEBYTECODE"  # some environments have it, for a clean disk
_OBJECTS, _CHAIRS = 24, 6


def rows(settings: Settings) -> Iterator[Row]:
    """Yield the time of `--help` and of a question to a small map, compared with bare imports."""
    small = _small_map(settings.build)
    compiled = settings.build / "compiled"
    module = ("-m", "hypermap")
    query = (*module, "query", str(small), "--name", "chair", "--json")
    for work, command, check, asked in (
        ("hypermap --help", (*module, "--help"), _check_help, 0.3),
        ("hypermap query, 24 objects and 200 x 200 cells", query, _check_answer, 0.6),
    ):
        theirs = partial(_output_of, _LIBRARIES, compiled)
        result = race(work, _PEER, partial(_output_of, command, compiled), theirs, check, settings)
        yield result
        yield Figure(work, result.ours, "s", asked, less_is_better=True, note="the same runs")


def _output_of(arguments: tuple[str, ...], compiled: Path) -> str:
    """Return what Python prints when it is started with some arguments.

    Args:
        arguments: of Python.
        compiled: folder for compiled modules, which the first start fills.
    """
    command = [sys.executable, *arguments]
    environment = {key: value for key, value in os.environ.items() if key != _NOT_COMPILED}
    environment["PYTHONPYCACHEPREFIX"] = str(compiled)
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    return done.stdout


def _check_help(ours: str, _: str) -> str:
    missing = [name for name in ("demo", "map", "query") if f" {name} " not in ours]
    if missing:
        raise Disagreement(f"the help does not tell of {', '.join(missing)}")
    return "the help lists the commands"


def _check_answer(ours: str, _: str) -> str:
    labels = [row["label"] for row in json.loads(ours)["answers"]]
    if labels != ["chair"] * _CHAIRS:
        raise Disagreement(f"expected {_CHAIRS} chairs, found {labels}")
    return f"{_CHAIRS} chairs found, as many as there are"


def _small_map(folder: Path) -> Path:
    """Return a map of a room of 10 m x 10 m."""
    cells = np.zeros((200, 200), dtype=np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = 100
    places = np.random.default_rng(0).uniform(0.5, 9.5, (_OBJECTS, 2))
    objects = [
        SemanticObject("chair" if i < _CHAIRS else f"thing {i}", shapely.Point(x, y).buffer(0.3))
        for i, (x, y) in enumerate(places)
    ]
    occupancy = OccupancyLayer("occupancy", "map", GridGeometry(200, 200, 0.05), cells)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "room.hmap"
    save_map(Hypermap([occupancy, SemanticLayer("semantic", "map", objects)]), path)
    return path
