"""A small room with a few things in it, each at a known place."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import shapely

from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.formats import save_map
from hypermap.testing import square

# Runs, if it is ever taken for markup.
EVIL = '<img src="x" onerror="window.hacked=1"><script>window.hacked=1</script>'

DESK, CHAIR, CUP, EVIL_ID = range(4)
PLACES = {DESK: (3.0, 3.0), CHAIR: (7.0, 5.0), CUP: (3.6, 3.2), EVIL_ID: (7.0, 2.5)}
FLOOR = (5.2, 6.3)  # a free place without objects
METRES_PER_PIXEL = 0.015  # at which the whole room is seen next to the panels


def small_map() -> Hypermap:
    cells = np.zeros((80, 100), dtype=np.int8)
    cells[:2], cells[-2:], cells[:, :2], cells[:, -2:] = 100, 100, 100, 100
    grid = GridGeometry(100, 80, 0.1)
    things = [
        SemanticObject("desk", shapely.box(2, 2.5, 4, 3.5), tags=("furniture",), existence=4.5),
        square("chair", *PLACES[CHAIR]),
        square("cup", *PLACES[CUP], side=0.3),
        square(EVIL, *PLACES[EVIL_ID]),
    ]
    return Hypermap(
        [OccupancyLayer("occupancy", "map", grid, cells), SemanticLayer("semantic", "map", things)]
    )


def saved_small_map(folder: Path) -> Path:
    path = folder / "room.hmap"
    save_map(small_map(), path)
    return path
