"""What layers without objects say."""

from __future__ import annotations

import numpy as np
import pytest

from hypermap import GridGeometry, Hypermap, OccupancyLayer, Pose2D
from hypermap.questions.cells import cells_in


@pytest.mark.parametrize("names", [["Free"], ["Free", "Occupied"], []])
def test_of_many_cells_only_the_nearest_are_listed(names: list[str]) -> None:
    rng = np.random.default_rng(5)
    cells = rng.choice([0, 100], (40, 30)).astype(np.int8)
    grid = GridGeometry(30, 40, 0.1, Pose2D(1.0, 2.0, 0.3))
    room = Hypermap([OccupancyLayer("occupancy", "map", grid, cells)])
    start, area = np.array([2.1, 3.4]), None if names else grid.outline()
    all_cells = list(cells_in(room, room["occupancy"], names, area, start, cells.size))
    assert len(all_cells) == ((cells == 0).sum() if names == ["Free"] else cells.size)
    nearest = sorted(all_cells, key=lambda cell: cell.distance or 0.0)[:7]
    found = list(cells_in(room, room["occupancy"], names, area, start, 7))
    found.sort(key=lambda cell: cell.distance or 0.0)
    assert [(one.label, one.value, one.distance) for one in found[:7]] == [
        (one.label, one.value, one.distance) for one in nearest
    ]
    assert [one.point_xy.tolist() for one in found[:7]] == [
        one.point_xy.tolist() for one in nearest
    ]
    assert len(found) < 12
