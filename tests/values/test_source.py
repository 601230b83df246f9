from __future__ import annotations

import numpy as np
import pytest

from hypermap import GridGeometry, OccupancyLayer
from hypermap.core.samples import Samples
from hypermap.testing import occupancy_from_text
from hypermap.values import value_layer_of
from hypermap.values.walls import Walls, wall_cells

SENDER = np.array([2.5, 3.5])
TWO_ROOMS = "\n".join(
    ["#" * 28, *["#" + "." * 12 + "##" + "." * 12 + "#"] * 5, "#" + "." * 26 + "#"]
    + ["#" + "." * 12 + "##" + "." * 12 + "#"] * 5
    + ["#" * 28]
)


def level_at(points_xy):
    """The signal in dBm: free space, and 6 dB for the wall unless the way is through the door."""
    walls = Walls(occupancy_from_text(TWO_ROOMS, resolution=0.5))
    crossed = walls.between(points_xy, SENDER[np.newaxis])[:, 0]
    distance = np.hypot(*(points_xy - SENDER).T)
    return -35 - 20 * np.log10(np.maximum(distance, 0.5)) - 6 * crossed


def test_walls_are_counted_and_furniture_is_not():
    plan = """
    ###########
    #...#.....#
    #...#..#..#
    #...#.....#
    ###########
    """
    walls = Walls(occupancy_from_text("\n".join(plan.split()), resolution=1.0))
    others = np.array([[2.0, 2.5]])
    places = np.array([[3.5, 3.5], [6.0, 2.5], [9.5, 2.5], [50.0, 2.5]])
    assert walls.between(places, others)[:, 0].tolist() == [0, 1, 1, 2]


def test_a_cupboard_before_a_wall_is_none_and_the_wall_behind_it_is_one():
    """Two cupboards of 0.5 x 1 m stand at the wall between two rooms, 1 m apart."""
    cells = np.zeros((80, 60), np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = 100
    cells[:, 30] = 100
    cells[20:30, 25:30] = cells[40:50, 25:30] = 100
    grid = GridGeometry(60, 80, 0.1)
    walls = Walls(OccupancyLayer("occupancy", "map", grid, cells))
    along = np.array([[2.75, 7.0]])  # past both cupboards
    through = np.array([[4.0, 4.5], [4.0, 6.0]])  # behind a cupboard, and beside it
    start = np.array([[2.75, 0.5], [2.0, 4.5]])
    assert walls.between(along, start[:1]).tolist() == [[0]]
    assert walls.between(through, start[1:]).tolist() == [[1], [1]]
    assert wall_cells(OccupancyLayer("occupancy", "map", grid, cells))[:, 30].all()


def test_two_leaves_of_a_wall_count_once():
    plan = "\n".join(["#..#.#....#"] * 8)
    walls = Walls(occupancy_from_text(plan, resolution=0.5))
    assert walls.between(np.array([[4.5, 2.0]]), np.array([[1.0, 2.0]])).tolist() == [[1]]


@pytest.mark.parametrize(("unit", "is_found"), [("dBm", True), ("°C", False)])
def test_the_sender_of_a_signal_is_found_and_tells_what_is_behind_a_wall(unit, is_found):
    random = np.random.default_rng(0)
    points = np.concatenate(
        [
            random.uniform([0.6, 0.6], [6.4, 6.0], (60, 2)),
            random.uniform([7.6, 2.6], [9, 4], (20, 2)),
        ]
    )
    samples = Samples.of(points, level_at(points) + random.normal(0, 1, len(points)))
    layer = value_layer_of(
        "wifi", samples, occupancy_from_text(TWO_ROOMS, resolution=0.5), unit=unit
    )
    assert ("source_x" in layer.made_by) == is_found
    far = random.uniform([10.0, 1.0], [11.0, 5.5], (40, 2))
    error = np.sqrt(np.nanmean((layer.value_at(far) - level_at(far)) ** 2))
    assert (error < 1.5) == is_found
    if is_found:
        found = [layer.made_by["source_x"], layer.made_by["source_y"]]
        np.testing.assert_allclose(found, SENDER, atol=0.6)
