from __future__ import annotations

import math
from collections import defaultdict

import numpy as np
import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from hypermap.perception.footprints import footprint, voxel_centroids

VOXEL = 0.25  # a power of two, so that whole cells are exact

# Coordinates on a fine lattice: sums of them are exact in any order.
coordinates = st.integers(-(2**12), 2**12).map(lambda i: i / 64)
clouds = st.integers(1, 40).flatmap(lambda n: arrays(np.float64, (n, 3), elements=coordinates))


@given(clouds, st.integers(0, 1000))
def test_the_order_of_the_points_does_not_matter(points: NDArray[np.float64], seed: int) -> None:
    shuffled = np.random.default_rng(seed).permutation(points)
    assert footprint(shuffled, VOXEL).equals(footprint(points, VOXEL))


@given(clouds, st.integers(-100, 100), st.integers(-100, 100), coordinates)
def test_a_motion_by_whole_cells_moves_the_footprint(
    points: NDArray[np.float64], columns: int, rows: int, up: float
) -> None:
    offset = np.array([columns * VOXEL, rows * VOXEL, up])
    moved = shapely.transform(footprint(points, VOXEL), lambda xy: xy + offset[:2])
    there = footprint(points + offset, VOXEL)
    assert there.area == pytest.approx(moved.area, abs=1e-9)
    assert there.is_empty or shapely.hausdorff_distance(there, moved) < 1e-9


@given(clouds)
def test_a_quarter_turn_turns_the_footprint(points: NDArray[np.float64]) -> None:
    points = points + VOXEL / 128  # no point on the border of a cell
    turned = shapely.transform(footprint(points, VOXEL), lambda xy: xy @ [[0, 1], [-1, 0]])
    there = footprint(points @ [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], VOXEL)
    assert there.area == pytest.approx(turned.area, abs=1e-9)


@given(clouds)
def test_the_footprint_lies_within_the_hull_and_reaches_near_each_point(
    points: NDArray[np.float64],
) -> None:
    shape = footprint(points, VOXEL)
    assume(not shape.is_empty)
    assert shapely.MultiPoint(points[:, :2]).convex_hull.buffer(1e-9).covers(shape)
    farthest = shapely.distance(shape, shapely.points(points[:, :2])).max()
    assert farthest <= VOXEL * math.sqrt(2)


@pytest.mark.parametrize("spread", [1.0, 1e5])  # a grid held whole, and one far too large for it
def test_the_centroids_are_those_of_a_dictionary_of_cells(spread: float) -> None:
    points = np.random.default_rng(3).normal(0, spread, (500, 2))
    cells = defaultdict(list)
    for point in points:
        cells[tuple(np.floor(point / VOXEL))].append(point)
    expected = [np.mean(cells[cell], axis=0) for cell in sorted(cells)]
    np.testing.assert_allclose(voxel_centroids(points, VOXEL), expected)


@pytest.mark.parametrize(
    "points",
    [
        np.empty((0, 3)),
        np.array([[1.0, 2.0, 3.0]]),
        np.array([[1.0, 2.0, 3.0], [5.0, 2.0, 3.0]]),
        np.array([[1.0, 2.0, 3.0], [2.0, 3.0, 0.0], [3.0, 4.0, 1.0]]),  # one line
        np.array([[1.01, 1.01, 0], [1.02, 1.01, 0], [1.01, 1.02, 0]]),  # one cell
        np.array([[1.0, 2.0, z] for z in range(9)]),  # one above the other
    ],
)
def test_points_without_an_area_have_an_empty_footprint(points: NDArray[np.float64]) -> None:
    assert footprint(points, VOXEL).is_empty


@pytest.mark.parametrize("count", [30, 3000, 30_000])
@pytest.mark.parametrize("seed", range(4))
def test_a_footprint_is_the_hull_of_all_centroids(count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = (rng.normal(0, 1, (count, 3)) * rng.uniform(0.1, 2, 3)).astype(np.float32)
    centroids = voxel_centroids(points[:, :2], 0.05)
    expected = shapely.convex_hull(shapely.multipoints(centroids))
    assert footprint(points, 0.05).normalize().wkb == expected.normalize().wkb
