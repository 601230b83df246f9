from __future__ import annotations

import platform
import subprocess
import sys
from typing import Any

import numpy as np
import pytest
import shapely

from hypermap.core.arrays import as_objects, as_point_xy, as_points_xy, single_xy, true_in


@pytest.mark.parametrize(
    ("points", "shape"),
    [
        ([], (0, 2)),
        (np.empty((0, 2)), (0, 2)),
        ((1, 2), (1, 2)),
        ([(1, 2)], (1, 2)),
        (np.zeros((3, 2), dtype=np.float32), (3, 2)),
        (np.zeros((3, 2), dtype=int), (3, 2)),
    ],
)
def test_points_become_float64_of_shape_n_2(points: Any, shape: tuple[int, int]) -> None:
    array = as_points_xy(points)
    assert array.shape == shape
    assert array.dtype == np.float64


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (1.0, "points must have shape (N, 2), got ()"),
        ([1, 2, 3], "points must have shape (N, 2), got (3,)"),
        ([1, 2, 3, 4], "points must have shape (N, 2), got (4,)"),
        ([[1, 2, 3]], "points must have shape (N, 2), got (1, 3)"),
        (np.empty((0, 3)), "points must have shape (N, 2), got (0, 3)"),
        (np.zeros((1, 1, 2)), "points must have shape (N, 2), got (1, 1, 2)"),
        ([[0, np.nan]], "points must be finite; there is a NaN or infinite coordinate"),
        ([[0, -np.inf]], "points must be finite; there is a NaN or infinite coordinate"),
    ],
)
def test_what_is_no_list_of_points_is_refused(points: Any, message: str) -> None:
    with pytest.raises(ValueError) as caught:
        as_points_xy(points)
    assert str(caught.value) == message


HERE, THERE = shapely.Point(1, 2), shapely.Point(3, 4)


@pytest.mark.parametrize(
    ("points", "expected"),
    [
        (HERE, [[1, 2]]),
        (shapely.Point(1, 2, 3), [[1, 2]]),
        ([HERE], [[1, 2]]),
        ((HERE, THERE), [[1, 2], [3, 4]]),
        (shapely.points([[1, 2], [3, 4]]), [[1, 2], [3, 4]]),
        (shapely.MultiPoint(), []),
        (shapely.MultiPoint([(1, 2), (3, 4)]), [[1, 2], [3, 4]]),
    ],
)
def test_shapely_points_are_points(points: Any, expected: list[list[float]]) -> None:
    assert as_points_xy(points).tolist() == expected


@pytest.mark.parametrize(
    ("points", "error", "message"),
    [
        (shapely.Point(), ValueError, "one of them is empty"),
        ([HERE, shapely.Point()], ValueError, "one of them is empty"),
        (shapely.box(0, 0, 1, 1), TypeError, "shapely Points, got Polygon"),
        ([HERE, None], TypeError, "shapely Points, got NoneType"),
        (object(), TypeError, "shapely Points, got object"),
    ],
)
def test_other_shapes_are_no_points(points: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        as_points_xy(points)


def test_one_point_may_be_given_flat_or_as_a_row() -> None:
    assert as_point_xy([1, 2]).tolist() == as_point_xy([[1, 2]]).tolist() == [1, 2]


@pytest.mark.parametrize("points", [[], [[1, 2], [3, 4]]])
def test_none_or_two_are_not_one_point(points: Any) -> None:
    with pytest.raises(ValueError, match=f"expected a single point, got {len(points)}"):
        as_point_xy(points)


@pytest.mark.parametrize("points", [[1.0, 2.0], ((1.0, 2.0),), np.array([1, 2]) / 1, np.eye(2)[:1]])
def test_a_single_point_is_reported_at_once(points: Any) -> None:
    assert single_xy(points) == tuple(as_point_xy(points).tolist())


@pytest.mark.parametrize(
    "points",
    [
        [np.nan, 1.0], [1.0, np.inf], [[1.0, np.nan]], [1, 2], ["1", 2.0], [1.0, "2"], [1.0],
        [1.0, 2.0, 3.0], [[1.0], [2.0]], [[[1.0, 2.0]]], [], np.zeros((2, 2)), HERE, "ab",
    ],
)  # fmt: skip
def test_of_other_points_nothing_is_said_at_once(points: Any) -> None:
    assert single_xy(points) is None


def test_sequences_stay_single_elements_of_an_object_array() -> None:
    array = as_objects(iter([(1, 2), (), "text"]))
    assert array.shape == (3,)
    assert array.tolist() == [(1, 2), (), "text"]


@pytest.mark.parametrize("share", [0, 0.001, 0.02, 0.1, 0.5, 0.99, 1])
@pytest.mark.parametrize("count", [0, 1, 7, 8, 65, 9090])
def test_what_is_true_is_found(count: int, share: float) -> None:
    mask = np.random.default_rng(3).random(2 * count) < share
    for looked_at in (mask[:count], mask[1 : count + 1], mask[::2]):
        assert true_in(looked_at).tolist() == np.flatnonzero(looked_at).tolist()


MEMORY_AGAIN = """
import resource
import numpy as np
import hypermap.core.arrays

def pages_given():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    np.ones(10**6)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

pages_given()
print(pages_given())
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="other C libraries keep other rules")
def test_memory_that_was_freed_is_not_given_page_by_page_again() -> None:
    done = subprocess.run([sys.executable, "-c", MEMORY_AGAIN], capture_output=True, check=True)
    assert int(done.stdout) < 10
