"""A flat whose paths can be measured by hand."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from hypermap import Hypermap, SemanticLayer, SemanticObject
from hypermap.core.grid import GridGeometry
from hypermap.core.occupancy import OccupancyLayer
from hypermap.rooms import rooms_of_map, with_rooms

SIDE = 0.05


def square(name: str, x: float, y: float, number: int, half: float = 0.1) -> SemanticObject:
    return SemanticObject(name, shapely.box(x - half, y - half, x + half, y + half), number)


def a_flat() -> Hypermap:
    """Return two rooms of 4 x 4 m, whose door of 0.9 m lies at the upper end of the wall.

    A table with a cup stands in the left room at the wall, so the cup is nearest through it. The
    right room has another cup, and a third stands in a closet that nobody enters.
    """
    cells = np.full((100, 220), 100, dtype=np.int8)
    cells[10:90, 8:88] = cells[10:90, 92:172] = 0
    cells[70:88, 88:92] = 0
    cells[10:90, 180:212] = 0
    cells[20:40, 68:88] = 100  # the table
    cup, table = square("cup", 4.1, 1.5, 1), square("table", 3.9, 1.5, 2, 0.5)
    others = [square("cup", 7.5, 4.0, 3), square("cup", 10.0, 2.0, 4)]
    fridge = square("refrigerator", 1.0, 4.0, 5)
    layers = [
        OccupancyLayer("occupancy", "map", GridGeometry(220, 100, SIDE), cells),
        SemanticLayer("semantic", "map", [cup, table, *others, fridge]),
    ]
    return Hypermap(layers)


@pytest.fixture(scope="session")
def flat() -> Hypermap:
    hypermap = a_flat()
    return with_rooms(hypermap, rooms_of_map(hypermap))
