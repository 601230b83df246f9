"""An office of two rooms, worked out by hand."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import shapely

from hypermap import GridGeometry, Hypermap, OccupancyLayer, SemanticLayer, SemanticObject
from hypermap.formats import save_map
from hypermap.rooms import rooms_of_map, with_rooms
from hypermap.testing import jpeg_picture

MONDAY = 1_795_392_000.0  # 2026-11-23T00:00:00+00:00
HOUR = 3600.0

THINGS = [  # name, x, y of the lower corner, size, existence (log-odds), seen first and last
    ("refrigerator", 0.3, 3.0, 0.6, 4.0, MONDAY - 48 * HOUR, MONDAY + 2 * HOUR),  # 0
    ("oven", 1.2, 3.2, 0.5, 4.0, MONDAY - 48 * HOUR, MONDAY + 2 * HOUR),  # 1
    ("dining table", 1.0, 1.0, 1.0, 4.0, MONDAY - 48 * HOUR, MONDAY + 2 * HOUR),  # 2
    ("cup", 1.4, 1.4, 0.1, 1.0, MONDAY + HOUR, MONDAY + 2 * HOUR),  # 3, on the table
    ("chair", 2.3, 1.2, 0.4, 3.0, MONDAY - 48 * HOUR, MONDAY + 2 * HOUR),  # 4
    ("printer", 7.0, 3.2, 0.5, 4.0, MONDAY - 48 * HOUR, MONDAY + 2 * HOUR),  # 5
    ("couch", 5.0, 0.3, 1.5, 3.0, MONDAY - 48 * HOUR, MONDAY - 24 * HOUR),  # 6
    ("chair", 6.5, 2.4, 0.4, 3.0, MONDAY - 48 * HOUR, MONDAY + 2 * HOUR),  # 7
    ("cup", 4.3, 2.6, 0.1, 2.0, MONDAY - 48 * HOUR, MONDAY + 2 * HOUR),  # 8, behind the wall
]


@pytest.fixture(scope="session")
def made_office() -> Hypermap:
    cells = np.zeros((40, 80), dtype=np.int8)
    cells[[0, -1], :] = cells[:, [0, -1]] = 100
    cells[:, 39:41] = 100  # the wall at x = 4
    cells[10:19, 39:41] = 0  # and its door, from y = 1.0 to 1.9
    grid = OccupancyLayer("occupancy", "map", GridGeometry(80, 40, 0.1), cells)
    things = [
        SemanticObject(
            name,
            shapely.box(x, y, x + size, y + size),
            existence=existence,
            first_seen=first,
            last_seen=last,
        )
        for name, x, y, size, existence, first, last in THINGS
    ]
    semantic = SemanticLayer("semantic", "map", things)
    semantic.kept_pictures = {5: (jpeg_picture("red", quality=0.9), jpeg_picture("lime", 2.0))}
    office = Hypermap([grid, semantic])
    rooms = rooms_of_map(office)
    left, right = sorted(rooms, key=lambda room: room.outline.centroid.x)
    named = [
        dataclasses.replace(left, name="kitchen", kind="kitchen", is_named=True),
        dataclasses.replace(right, name="print room", kind="office", is_named=True),
    ]
    return with_rooms(office, rooms.replaced(sorted(named, key=lambda room: room.id)))


@pytest.fixture
def office(made_office: Hypermap, tmp_path: Path) -> Path:
    file = tmp_path / "office.hmap"
    save_map(made_office, file)
    return file
