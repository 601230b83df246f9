from __future__ import annotations

import math
from typing import Any
from unittest import mock

import numpy as np
import pytest
import shapely
from hypothesis import example, given
from hypothesis import strategies as st
from shapely.geometry.base import BaseGeometry

from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry, Window
from hypermap.testing.strategies import areas, grids, points

TURNED = GridGeometry(width=4, height=3, resolution=0.5, origin=Pose2D(1.0, 2.0, math.pi / 2))
LAB = GridGeometry(width=320, height=576, resolution=0.05, origin=Pose2D(-8.0, -20.8))


def cells_in_by_brute_force(grid: GridGeometry, area: BaseGeometry) -> list[tuple[int, int]]:
    """Ask shapely about each center by itself."""
    rows, cols = np.indices(grid.shape).reshape(2, -1)
    centers = grid.centers(rows, cols)
    return [
        (int(row), int(col))
        for row, col, center in zip(rows, cols, centers, strict=True)
        if area.covers(shapely.Point(center))
    ]


def cells_in(grid: GridGeometry, area: BaseGeometry) -> list[tuple[int, int]]:
    rows, cols = grid.cells_in(area)
    return list(zip(rows.tolist(), cols.tolist(), strict=True))


@pytest.mark.parametrize(
    ("point", "cell"),
    [
        ((1.0, 2.0), (0, 0)),  # the corner itself belongs to the cell above and right of it
        ((0.99, 2.01), (0, 0)),
        ((0.99, 3.99), (0, 3)),
        ((-0.49, 2.01), (2, 0)),
        ((1.01, 2.01), (-1, 0)),  # rounded down, not toward zero
        ((0.99, 1.99), (0, -1)),
    ],
)
def test_a_point_lies_in_the_cell_around_it(point: Any, cell: Any) -> None:
    assert TURNED.cells_at(point).tolist() == [list(cell)]


@given(grids, st.data())
def test_a_cells_centre_lies_in_it(grid: GridGeometry, data: st.DataObject) -> None:
    row = data.draw(st.integers(-100, 100))
    col = data.draw(st.integers(-100, 100))
    assert grid.cells_at(grid.centers([row], [col])).tolist() == [[row, col]]


@given(grids, points(min_size=1))
def test_a_point_is_within_half_a_cell_of_its_cells_centre(grid, xy) -> None:
    rows, cols = grid.cells_at(xy).T
    to_cells = grid.origin.inverse()
    offsets = to_cells.apply(xy) - to_cells.apply(grid.centers(rows, cols))
    assert np.abs(offsets).max() <= grid.resolution * (0.5 + 1e-9) + 1e-9


@given(grids, points())
def test_the_matrix_for_compiled_loops_says_the_same(grid: GridGeometry, xy: np.ndarray) -> None:
    exact = (np.column_stack([xy, np.ones(len(xy))]) @ grid.to_cells_matrix().T)[:, :2]
    offsets = exact - grid.cells_at(xy)[:, ::-1]
    assert ((offsets > -1e-6) & (offsets < 1 + 1e-6)).all()


@pytest.mark.parametrize("far", [1e15, 1e300, -1e300])
def test_a_point_very_far_away_lies_off_the_grid(far: float) -> None:
    for grid in (TURNED, LAB, GridGeometry(3, 3, 1e-6)):
        rows, cols = grid.cells_at([[far, 0.0], [0.0, far], [far, far]]).T
        assert not grid.contains(rows, cols).any()


def test_sides_may_be_any_integers() -> None:
    grid = GridGeometry(np.int16(30000), np.int16(30000), 0.5)  # whose sum is no int16
    assert grid.contains([29999, 30000], [29999, 0]).tolist() == [True, False]


def test_the_grid_contains_its_own_cells_alone() -> None:
    rows, cols = np.mgrid[-1:4, -1:5].reshape(2, -1)
    assert TURNED.contains(rows, cols).sum() == 12
    assert TURNED.shape == (3, 4)


def test_the_corners_go_round_from_the_origin() -> None:
    expected = [(1, 2), (1, 4), (-0.5, 4), (-0.5, 2)]
    np.testing.assert_allclose(TURNED.corners(), expected, atol=1e-12)
    assert TURNED.outline().exterior.is_ccw
    assert TURNED.outline().area == pytest.approx(3.0)


@given(st.data(), grids)
def test_an_area_holds_the_cells_whose_centre_it_covers(data: st.DataObject, grid) -> None:
    area = data.draw(areas(around=grid.outline().buffer(grid.resolution)))
    # Centers this near to the boundary may be counted either way.
    margin = grid.resolution * 1e-5
    found = set(cells_in(grid, area))
    assert found >= set(cells_in_by_brute_force(grid, area.buffer(-margin)))
    assert found <= set(cells_in_by_brute_force(grid, area.buffer(margin)))


@given(st.data(), grids)
def test_a_centre_on_the_boundary_counts(data: st.DataObject, grid: GridGeometry) -> None:
    col0, col1 = sorted(data.draw(st.tuples(*[st.integers(0, grid.width - 1)] * 2)))
    row0, row1 = sorted(data.draw(st.tuples(*[st.integers(0, grid.height - 1)] * 2)))
    corners = grid.centers([row0, row0, row1, row1], [col0, col1, col1, col0])
    expected = [(r, c) for r in range(row0, row1 + 1) for c in range(col0, col1 + 1)]
    assert cells_in(grid, shapely.Polygon(corners)) == expected


@given(st.data())
def test_an_area_of_a_large_grid_holds_the_centres_that_it_covers(data: st.DataObject) -> None:
    grid = GridGeometry(200, 150, 0.05, Pose2D(-3.0, 1.0, data.draw(st.floats(-3, 3))))
    area = data.draw(areas(around=grid.outline()))
    rows, cols = np.indices(grid.shape).reshape(2, -1)
    centers = grid.centers(rows, cols)
    inside, near = (shapely.contains_xy(area.buffer(margin), centers) for margin in (-1e-6, 1e-6))
    mask = np.zeros(grid.shape, dtype=bool)
    mask[grid.cells_in(area)] = True
    assert (mask.ravel() >= inside).all()
    assert (mask.ravel() <= near).all()


@pytest.mark.parametrize(
    ("area", "count"),
    [
        (shapely.Polygon(), 0),
        (shapely.MultiPolygon(), 0),
        (shapely.box(100, 100, 101, 101), 0),
        (shapely.box(-8.0, -20.8, -8.0 + 0.024, -20.8 + 0.024), 0),  # short of the first center
        (shapely.box(-8.0, -20.8, -8.0 + 0.026, -20.8 + 0.026), 1),
        (shapely.box(-8.0, -20.8, -7.0, -19.8), 400),
        (shapely.box(-9.0, -21.8, -7.0, -19.8), 400),  # what lies off the grid is not reported
        (LAB.outline(), 320 * 576),
        (shapely.box(-1e6, -1e6, 1e6, 1e6), 320 * 576),
        (shapely.box(-1e308, -1e308, 1e308, 1e308), 320 * 576),
        (shapely.Polygon([(-1e300, -1e300), (1e300, -1e300), (0, 1e300)]), 320 * 576),
        (shapely.box(-9, -21, 9, 9).difference(shapely.box(-8.1, -20.9, 8.1, 8.1)), 0),
        (shapely.LineString([(-7.975, -20.775), (-7.975, -20.275)]), 11),
        (shapely.Point(-7.975, -20.775), 1),
    ],
)
def test_areas_of_every_size_are_cut_to_the_grid(area: BaseGeometry, count: int) -> None:
    assert len(cells_in(LAB, area)) == count


def test_an_outline_that_crosses_itself_holds_what_it_winds_around() -> None:
    grid = GridGeometry(4, 4, 1.0)
    bow_tie = shapely.Polygon([(0, 0), (4, 4), (4, 0), (0, 4)])
    assert cells_in(grid, bow_tie) == [
        (0, 0), (0, 3), (1, 0), (1, 1), (1, 2), (1, 3), (2, 0), (2, 1), (2, 2), (2, 3), (3, 0),
        (3, 3),
    ]  # fmt: skip
    twice_around = shapely.Polygon([(0, 0), (4, 0), (4, 4), (1, 4), (1, 1), (3, 1), (3, 3), (0, 3)])
    assert (2, 2) in cells_in(grid, twice_around)


quarters = st.tuples(st.integers(-2, 22), st.integers(-2, 18))


@given(st.lists(quarters, min_size=3, max_size=6))
@example([(2, 2), (14, 2), (14, 12), (10, 12), (10, 8), (2, 8)])  # level between two rows
def test_corners_and_edges_may_lie_on_centres_and_between(corners: list[tuple[int, int]]) -> None:
    grid = GridGeometry(5, 4, 1.0)
    ring = shapely.Polygon(corners)
    area = shapely.transform(ring if ring.is_valid else ring.convex_hull, lambda xy: xy / 4)
    assert cells_in(grid, area) == cells_in_by_brute_force(grid, area)


def test_a_grid_may_have_more_cells_than_32_bits_can_count() -> None:
    grid = GridGeometry(2**31, 3, 1e-3)
    ends = [(0, 0), (2, 2**31 - 1)]
    assert cells_in(grid, shapely.MultiPoint(grid.centers([0, 2], [0, 2**31 - 1]))) == ends


def test_the_window_masks_the_part_of_the_grid_around_the_area() -> None:
    grid = GridGeometry(10, 10, 1.0)
    window = grid.window_in(shapely.Polygon([(2, 3), (6, 3), (2, 7)]))
    cells = np.arange(100).reshape(10, 10)
    expected = [r * 10 + c for r, c in cells_in(grid, shapely.Polygon([(2, 3), (6, 3), (2, 7)]))]
    assert cells[window.slices][window.inside].tolist() == expected
    assert window.inside.shape == (4, 4)
    nothing = grid.window_in(shapely.Polygon())
    assert nothing.inside.shape == cells[nothing.slices].shape == (0, 0)


@given(grids, st.none() | areas(), st.integers(1, 60))
def test_windows_of_a_few_rows_show_what_one_of_all_does(grid, area, at_once) -> None:
    whole = (
        np.ones(grid.shape, dtype=bool) if area is None else mask_of([grid.window_in(area)], grid)
    )

    with mock.patch("hypermap.core.grid.AT_ONCE", at_once):
        windows = list(grid.windows_in(area))

    assert mask_of(windows, grid).tolist() == whole.tolist()
    assert all(w.inside.size <= max(at_once, grid.width) for w in windows)
    cells = [cell for w in windows for cell in zip(*w.cells(), strict=True)]
    assert cells == list(zip(*np.nonzero(whole), strict=True))


@given(grids, areas(), st.integers(1, 60), st.data())
def test_a_window_sifts_the_cells_that_are_chosen(grid, area, at_once, data) -> None:
    whole = mask_of([grid.window_in(area)], grid)
    seed, share = data.draw(st.integers(0, 99)), data.draw(st.sampled_from([0.02, 0.5, 1]))
    wanted = np.random.default_rng(seed).random(grid.shape) < share
    with mock.patch("hypermap.core.grid.AT_ONCE", at_once):
        windows = list(grid.windows_in(area))

    cells = [
        cell
        for window in windows
        for cell in zip(*window.cells(window.positions(wanted[window.slices])), strict=True)
    ]
    assert cells == list(zip(*np.nonzero(whole & wanted), strict=True))


@given(st.integers(1, 200), areas())
def test_rows_are_crossed_in_parts_where_there_are_many(at_once: int, area: BaseGeometry) -> None:
    grid = GridGeometry(40, 30, 0.25, Pose2D(-5.0, -4.0))
    expected = grid.window_in(area)
    with mock.patch("hypermap.core.spans._AT_ONCE", at_once):
        assert grid.window_in(area).spans.tolist() == expected.spans.tolist()


def mask_of(windows: list[Window], grid: GridGeometry) -> np.ndarray:
    mask = np.zeros(grid.shape, dtype=bool)
    for window in windows:
        mask[window.slices] = window.inside
    return mask


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"width": 0}, ValueError, "a grid needs at least one cell, got 0 x 3"),
        ({"height": -1}, ValueError, "a grid needs at least one cell, got 4 x -1"),
        ({"width": 1.5}, TypeError, "'float' object cannot be interpreted as an integer"),
        ({"resolution": 0.0}, ValueError, "resolution must be from 1e-06 to 1e+06 m, got 0.0"),
        ({"resolution": -0.05}, ValueError, "resolution must be from 1e-06 to 1e+06 m, got -0.05"),
        ({"resolution": math.nan}, ValueError, "resolution must be from 1e-06 to 1e+06 m, got nan"),
        ({"resolution": math.inf}, ValueError, "resolution must be from 1e-06 to 1e+06 m, got inf"),
        ({"origin": Pose2D(1e13)}, ValueError,
         "a grid must be within 1e+12 m, this one reaches 1e+13 m"),
        ({"height": 10**13}, ValueError,
         "a grid must be within 1e+12 m, this one reaches 5e+12 m"),
        ({"resolution": 1e-9}, ValueError, "resolution must be from 1e-06 to 1e+06 m, got 1e-09"),
    ],
)  # fmt: skip
def test_what_is_no_grid_is_refused(changes: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error) as caught:
        GridGeometry(**{"width": 4, "height": 3, "resolution": 0.5, **changes})
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("area", "error", "message"),
    [
        ("POLYGON", TypeError, "an area must be a shapely geometry, got str"),
        (None, TypeError, "an area must be a shapely geometry, got NoneType"),
        (shapely.LineString([(0, 0), (1, math.inf)]), ValueError,
         "an area must be finite; there is a NaN or infinite coordinate"),
    ],
)  # fmt: skip
def test_what_is_no_area_is_refused(area: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error) as caught:
        LAB.cells_in(area)
    assert str(caught.value) == message
