from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hypermap.core.store.box_grid import BoxGrid
from hypermap.core.store.recent_boxes import RecentBoxes

lengths = st.one_of(st.integers(0, 3), st.sampled_from([0.1, 40.0, 1e6]))
boxes = st.tuples(st.integers(-9, 9), st.integers(-9, 9), lengths, lengths).map(
    lambda b: (float(b[0]), float(b[1]), float(b[0] + b[2]), float(b[1] + b[3]))
)
points = st.tuples(st.integers(-12, 12), st.integers(-12, 12))


def as_boxes(drawn) -> np.ndarray:
    return np.array(drawn, dtype=float).reshape(-1, 4)


def grid_of(drawn) -> BoxGrid:
    """Return a grid of boxes whose sizes are their widths."""
    array = as_boxes(drawn)
    return BoxGrid(array, array[:, 2] - array[:, 0])


def at(grid: BoxGrid, x: float, y: float) -> list[int]:
    """Return the rows at a point, as who asks for what is near sorts them out."""
    return [r for x0, y0, x1, y1, r in grid.near(x, y) if x0 <= x <= x1 and y0 <= y <= y1]


def meeting(drawn, area) -> list[int]:
    x0, y0, x1, y1 = area
    boxes = list(enumerate(drawn))
    return [i for i, b in boxes if b[0] <= x1 and x0 <= b[2] and b[1] <= y1 and y0 <= b[3]]


def expected_at(drawn, x: float, y: float) -> list[int]:
    return [i for i, (x0, y0, x1, y1) in enumerate(drawn) if x0 <= x <= x1 and y0 <= y <= y1]


@given(st.lists(boxes, max_size=30), st.lists(points, max_size=20), boxes)
def test_boxes_are_found_where_they_are(drawn, asked, area) -> None:
    grid = grid_of(drawn)
    for x, y in [*asked, *asked]:  # looked up, and kept
        near = grid.near(x, y)
        assert near == sorted(near, key=lambda box: (box[2] - box[0], box[4]))
        assert sorted(at(grid, x, y)) == expected_at(drawn, x, y)
    places, rows = grid.at_all(np.array(asked, dtype=float).reshape(-1, 2))
    expected = {(i, row) for i, (x, y) in enumerate(asked) for row in expected_at(drawn, x, y)}
    pairs = list(zip(places.tolist(), rows.tolist(), strict=True))
    assert set(pairs) == expected
    assert len(pairs) == len(expected)
    assert grid.meeting(*area) in (None, meeting(drawn, area))


def test_a_small_box_on_the_grid_is_answered_from_its_cells() -> None:
    rng = np.random.default_rng(1)
    corners = rng.uniform(0, 50, (800, 2))
    drawn = np.concatenate([corners, corners + rng.choice([0.5, 2, 20], (800, 1))], axis=1)
    grid = grid_of(drawn)
    for x, y in rng.uniform(5, 45, (50, 2)):
        area = (x, y, x + 1, y + 0.5)
        assert grid.meeting(*area) == meeting(drawn, area)
    assert grid.meeting(0, 0, 50, 50) is None
    assert grid.meeting(-90, -90, -89, -89) is None
    assert grid.meeting(89, 89, 90, 90) is None


def test_cells_that_are_no_longer_kept_are_looked_up_again(monkeypatch) -> None:
    monkeypatch.setattr("hypermap.core.store.box_grid._MOST_KEPT", 4)
    drawn = [(i, j, i + 1.5, j + 1.0) for i in range(6) for j in range(6)]
    grid = grid_of(drawn)
    for x, y in [(i + 0.25, j + 0.25) for _ in range(2) for i in range(7) for j in range(7)]:
        assert sorted(at(grid, x, y)) == expected_at(drawn, x, y)


@given(st.lists(boxes, min_size=1, max_size=30), st.lists(points, max_size=20), boxes, st.data())
def test_recent_boxes_are_found_among_the_first_so_many(drawn, asked, area, data) -> None:
    recent = RecentBoxes(len(drawn), cell=1.0)
    for i, box in enumerate(drawn):
        recent.put(i, box)
    some = data.draw(st.integers(0, len(drawn)))
    for count in (some, len(drawn), some):  # that asks again after more were asked for
        grid = grid_of(drawn[:count])
        for x, y in asked:
            assert sorted(recent.at(x, y, count)) == expected_at(drawn[:count], x, y)
        xy = np.array(asked, dtype=float).reshape(-1, 2)
        for mine, other in zip(recent.at_all(xy, count), grid.at_all(xy), strict=True):
            assert sorted(mine) == sorted(other)
        assert recent.meeting(*area, count).tolist() == meeting(drawn[:count], area)


@pytest.mark.parametrize("points", [0, 20, 400])
def test_few_and_many_points_are_found_in_recent_boxes(points: int) -> None:
    rng = np.random.default_rng(2)
    corners = rng.uniform(0, 20, (600, 2))
    drawn = np.concatenate([corners, corners + rng.choice([0.5, 2, 9], (600, 1))], axis=1)
    recent = RecentBoxes(len(drawn), cell=1.0)
    for i, box in enumerate(drawn.tolist()):
        recent.put(i, tuple(box))
    xy = rng.uniform(-1, 30, (points, 2))
    for count in (600, 250, 599):
        pairs = list(zip(*map(np.ndarray.tolist, recent.at_all(xy, count)), strict=True))
        here = [(i, at) for i, (x, y) in enumerate(xy) for at in expected_at(drawn[:count], x, y)]
        assert sorted(pairs) == here


@pytest.mark.parametrize("far", [(1e9, 1e9), (-1e300, 0.0), (1e308, -1e308)])
def test_a_point_far_away_is_no_trouble(far: tuple[float, float]) -> None:
    drawn = [(0.0, 0.0, 1.0, 1.0), (5e8, 5e8, 1e9, 1e9)]
    grid, recent = grid_of(drawn), RecentBoxes(2, cell=1.0)
    for i, box in enumerate(drawn):
        recent.put(i, box)
    expected = expected_at(drawn, *far)
    assert at(grid, *far) == expected
    assert recent.at(*far, 2) == expected
    assert grid.at_all(np.array([far]))[1].tolist() == expected


def test_one_box_far_away_does_not_make_the_grid_coarse() -> None:
    rng = np.random.default_rng(0)
    corners = rng.uniform(0, 100, (5000, 2))
    near = np.column_stack([corners, corners + 0.5])
    far = np.array([[1e9 - 1, 1e9 - 1, 1e9, 1e9]])
    assert grid_of(np.concatenate([near, far])).cell < 4
