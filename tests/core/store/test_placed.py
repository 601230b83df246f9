from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
import shapely

from hypermap.core.arrays import as_objects
from hypermap.core.store.placed import Placed

LINE = shapely.LineString([(3, 3), (4, 4)])  # of a footprint without area
SHAPES = as_objects(
    [
        shapely.box(0, 0, 1, 1),
        shapely.box(0, 0, 1, 1),  # the same once more
        shapely.box(1, 0, 2, 1),  # touches them
        shapely.Point(7, 7).buffer(1),
        shapely.MultiPolygon([shapely.box(9, 0, 10, 1), shapely.box(20, 0, 21, 1)]),
        LINE,
        shapely.GeometryCollection([LINE, shapely.Point(5, 5)]),
    ]
)


def placed(shapes: np.ndarray, rows: np.ndarray) -> Placed:
    centroids = shapely.get_coordinates(shapely.centroid(shapes))
    return Placed(shapes, centroids, np.arange(len(shapes))).take(rows)


@pytest.mark.parametrize("limit", [np.inf, 0.0, 2.5])
def test_the_nearest_other_is_that_of_measuring_all(limit: float) -> None:
    rng = np.random.default_rng(4)
    for _ in range(40):
        here, there = (np.flatnonzero(rng.random(len(SHAPES)) < 0.6) for _ in range(2))
        all_distances = shapely.distance(SHAPES[here][:, np.newaxis], SHAPES[there])
        is_other = (here[:, np.newaxis] != there) & (all_distances <= limit)
        expected = np.where(is_other, all_distances, np.inf).min(axis=1, initial=np.inf)
        found = placed(SHAPES, here).distances_to(placed(SHAPES, there), limit)
        np.testing.assert_array_equal(found, expected)


def test_of_one_other_alone_the_distances_of_centroids_decide() -> None:
    rows = np.arange(4)
    one = placed(SHAPES, rows).centroid_distances_to(placed(SHAPES, np.array([2])))
    np.testing.assert_allclose(one, [0.5, 0.5, 0, np.hypot(5, 6)])
    for others in ([], [0, 2]):
        none = placed(SHAPES, rows).centroid_distances_to(placed(SHAPES, np.array(others, int)))
        assert none.tolist() == [0, 0, 0, 0]


def test_no_table_of_all_pairs_is_made() -> None:
    corners = np.random.default_rng(1).uniform(0, 300, (3000, 2))
    things = placed(np.asarray(shapely.box(*corners.T, *(corners.T + 0.5))), np.arange(3000))
    tracemalloc.start()
    distances = things.distances_to(things, np.inf)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert np.isfinite(distances).all()
    assert peak < 2_000_000
