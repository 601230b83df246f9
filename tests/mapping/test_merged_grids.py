"""The occupancy grids of two maps are added: golden cases, worked out by hand."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hypermap import GridGeometry, OccupancyLayer, Pose2D
from hypermap.mapping.merging.grids import added_layers

A_ROW = GridGeometry(4, 1, 1.0)


def layer_of(values: Sequence[int], grid: GridGeometry = A_ROW) -> OccupancyLayer:
    return OccupancyLayer("grid", "map", grid, np.array([values]))


@pytest.mark.parametrize(
    ("one", "other", "expected"),
    [
        ((0, 100, -1, -1), (-1, -1, 0, -1), (0, 100, 0, -1)),  # what one map knows
        ((0, 100, 50, 50), (0, 100, 0, 100), (0, 100, 0, 100)),  # 50 says nothing
        # log(0.97 / 0.03) + log(0.12 / 0.88) = 1.48, which is a likelihood of 0.82
        ((0, 100, 0, 100), (100, 0, 100, 0), (82, 82, 82, 82)),
    ],
)
def test_cells_of_two_layers_are_added(
    one: Sequence[int], other: Sequence[int], expected: Sequence[int]
) -> None:
    found = added_layers(layer_of(one), layer_of(other), Pose2D())
    assert found.grid == A_ROW
    assert found.cells is not None
    assert found.cells.tolist() == [list(expected)]


def test_a_layer_that_is_turned_lands_where_it_belongs() -> None:
    quarter = Pose2D(2.0, -1.0, math.pi / 2)  # cell (0, i) goes to x 1..2, y i - 1..i
    found = added_layers(layer_of([-1] * 4), layer_of([0, 100, -1, 100]), quarter)
    points = [(1.5, -0.5), (1.5, 0.5), (1.5, 1.5), (1.5, 2.5), (0.5, 0.5)]
    assert found.value_at(points).tolist() == [0, 100, -1, 100, -1]
    assert found.extent().bounds == pytest.approx((0, -1, 4, 3))


@settings(max_examples=40, deadline=None)
@given(
    x=st.floats(-3, 3),
    y=st.floats(-3, 3),
    yaw=st.floats(-4, 4),
    seed=st.integers(0, 1000),
)
def test_no_cell_of_either_layer_is_lost(x: float, y: float, yaw: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    cells = rng.choice([-1, 0, 100], (6, 8))
    one = OccupancyLayer("one", "map", GridGeometry(8, 6, 0.5), cells)
    blank = OccupancyLayer(
        "blank", "map", GridGeometry(2, 3, 0.5, Pose2D(0.3, 0.2, 0.4)), -np.ones((3, 2), int)
    )
    pose = Pose2D(x, y, yaw)
    rows, cols = np.indices(cells.shape).reshape(2, -1)
    centers = one.grid.centers(rows, cols)
    kept = added_layers(one, blank, pose)
    assert kept.value_at(centers).tolist() == cells.ravel().tolist()
    moved = added_layers(blank, one, pose)
    # The center of the cell over a center is at most half a diagonal away.
    near = moved.grid.cells_at(pose.apply(centers))
    found = moved.grid.centers(*near.T)
    assert moved.value_at(found).tolist() == one.value_at(pose.inverse().apply(found)).tolist()
