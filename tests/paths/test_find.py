"""Shortest and cheapest paths over grids, beside a visibility graph made with shapely."""

from __future__ import annotations

import csv
import itertools

import numpy as np
import pytest
import shapely
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from PIL import Image
from scipy.sparse.csgraph import dijkstra

from hypermap.core.errors import HypermapError
from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.core.occupancy import OccupancyLayer
from hypermap.paths import FreeSpace, NoPath, PathSettings, distances, find_path
from hypermap.paths.find import length_of
from hypermap.paths.segments import line_cost


def space_of(cells, resolution=1.0, origin=None, **settings_of_robot) -> FreeSpace:
    array = np.asarray(cells, dtype=np.int8)
    grid = GridGeometry(array.shape[1], array.shape[0], resolution, origin or Pose2D())
    layer = OccupancyLayer("occupancy", "map", grid, array)
    return FreeSpace.of(layer, PathSettings(**settings_of_robot))


def crossed(points, blocked, side=1.0) -> float:
    """Return the length of a polyline inside of blocked cells, by shapely."""
    rows, cols = np.nonzero(blocked)
    boxes = shapely.box(cols * side, rows * side, (cols + 1) * side, (rows + 1) * side)
    line = shapely.LineString(points)
    return float(shapely.length(shapely.intersection(shapely.union_all(boxes).buffer(-1e-7), line)))


def oracle(blocked, start, goals) -> np.ndarray:
    """Return the lengths of the shortest paths by a graph of all corners that see each other."""
    around = np.pad(blocked, 1, constant_values=True).astype(int)
    fours = [around[:-1, :-1], around[:-1, 1:], around[1:, :-1], around[1:, 1:]]
    count = sum(fours)
    pinched = (count == 2) & (fours[0] == fours[3])
    corners = np.argwhere(count == 1)[:, ::-1]
    turns = np.concatenate([[start], corners]).astype(float)
    nodes = np.concatenate([turns, np.reshape(goals, (-1, 2))])
    rows, cols = np.nonzero(~blocked)
    free = shapely.union_all(shapely.box(cols, rows, cols + 1, rows + 1))
    pinches = shapely.multipoints(np.argwhere(pinched)[:, ::-1].astype(float))
    shapely.prepare([free, pinches])
    one, other = np.nonzero(np.arange(len(turns))[:, None] < np.arange(len(nodes)))
    lines = shapely.linestrings(np.stack([nodes[one], nodes[other]], axis=1))
    seen = shapely.covers(free, lines) & ~shapely.dwithin(pinches, lines, 1e-9)
    seen |= shapely.length(lines) == 0
    # scipy takes a length of 0 for none at all.
    matrix = np.zeros((len(nodes), len(nodes)))
    matrix[one[seen], other[seen]] = np.maximum(shapely.length(lines[seen]), 1e-6)
    return dijkstra(matrix, directed=False, indices=0)[len(turns) :]


def test_a_goal_in_a_cone_too_narrow_for_a_cell_center_is_reached_straight():
    blocked = np.zeros((9, 4), dtype=bool)
    blocked.flat[[2, 4, 6, 19, 20, 23, 27, 33]] = True
    space = space_of(np.where(blocked, 100, 0))
    points = find_path(space, [0.5, 2.25], [1.25, 7.25])
    np.testing.assert_allclose(points, [[0.5, 2.25], [1, 5], [1.25, 7.25]], atol=1e-3)


@settings(max_examples=60)
@given(st.data())
def test_a_path_is_the_shortest_and_crosses_no_blocked_cell(data):
    height, width = (data.draw(st.integers(2, 9)) for _ in range(2))
    flat = data.draw(st.lists(st.booleans(), min_size=height * width, max_size=height * width))
    share = data.draw(st.lists(st.booleans(), min_size=height * width, max_size=height * width))
    blocked = np.reshape(np.array(flat) & np.array(share), (height, width))
    free = np.argwhere(~blocked)
    assume(len(free) >= 2)
    one, other = (free[data.draw(st.integers(0, len(free) - 1))] for _ in range(2))
    inside = st.sampled_from([0.25, 0.5, 0.9])
    start, goal = (
        np.array([c + data.draw(inside), r + data.draw(inside)]) for r, c in (one, other)
    )
    assume(not np.array_equal(start, goal))
    space = space_of(np.where(blocked, 100, 0))
    center = np.floor(goal) + 0.5
    expected, expected_of_center = oracle(blocked, start, [goal, center])
    if np.isinf(expected):
        with pytest.raises(NoPath, match="no path leads from"):
            find_path(space, start, goal)
        assert np.isinf(distances(space, start).at(goal)[0])
        return
    points = find_path(space, start, goal)
    assert points[[0, -1]].tolist() == [start.tolist(), goal.tolist()]
    assert length_of(points) == pytest.approx(expected, abs=2e-3)
    assert crossed(points, blocked) == 0
    swept = distances(space, start).at(goal)[0]
    assert swept == pytest.approx(expected_of_center, abs=5e-3)


@settings(max_examples=40)
@example(14, 0.2, 8)  # a way past a corner that is narrower than from center to center
@given(st.integers(0, 2**32 - 1), st.floats(0.02, 0.4), st.integers(4, 14))
def test_one_sweep_finds_the_shortest_way_to_each_cell(seed, share, side):
    rng = np.random.default_rng(seed)
    blocked = rng.random((side, side)) < share
    blocked[0, 0] = False
    start = [0.25, 0.9]
    rows, cols = np.nonzero(~blocked)
    expected = oracle(blocked, start, np.column_stack([cols, rows]) + 0.5)
    swept = distances(space_of(np.where(blocked, 100, 0)), start).meters[rows, cols]
    np.testing.assert_allclose(swept, expected, atol=5e-3)


def test_known_questions_are_answered_within_a_tenth_of_a_percent(shared_data):
    folder = shared_data / "paths"
    with Image.open(folder / "cape.png") as image:
        blocked = np.asarray(image)[::-1] == 0
    height = len(blocked)
    space = space_of(np.where(blocked, 100, 0), resolution=0.05)
    with (folder / "cape.csv").open() as file:
        questions = [[float(text) for text in row] for row in list(csv.reader(file))[1:]]
    assert len(questions) == 201
    for x0, y0, x1, y1, optimum in questions:
        points = find_path(
            space, [0.05 * x0, 0.05 * (height - y0)], [0.05 * x1, 0.05 * (height - y1)]
        )
        assert length_of(points) / 0.05 == pytest.approx(optimum, rel=1e-3)
        for one, other in itertools.pairwise(points / 0.05):
            steps = np.linspace(0, 1, int(20 * np.hypot(*(other - one))) + 2)[1:-1, np.newaxis]
            cols, rows = np.floor(one + steps * (other - one)).astype(int).T
            assert not blocked[rows, cols].any()


WALL = np.zeros((40, 60), dtype=np.int8)
WALL[:30, 28:32] = 100


@pytest.mark.parametrize("turned", [False, True])
def test_a_line_along_cells_does_not_pass_between_two_that_touch_at_a_corner(turned):
    cost = np.ones((4, 2), dtype=np.float32)
    cost[1, 0] = cost[2, 1] = np.inf
    lines = [(1, 0.5, 1, 2.0), (1, 0.5, 1, 3.5)]
    if turned:
        cost, lines = cost.T.copy(), [(y0, x0, y1, x1) for x0, y0, x1, y1 in lines]
    assert [line_cost(cost, *line) for line in lines] == [1.5, np.inf]


def test_a_robot_keeps_its_radius_from_walls():
    points = find_path(space_of(WALL, 0.1, robot_radius=0.45), [1.0, 1.0], [5.0, 1.0])
    walls = shapely.box(2.8, 0, 3.2, 3)
    assert walls.distance(shapely.LineString(points)) > 0.45 - 0.1
    with pytest.raises(NoPath, match=r"from \(1.00, 1.50\) to \(5.00, 1.50\) for a radius of 1 m"):
        find_path(space_of(WALL, 0.1, robot_radius=1.0), [1.0, 1.5], [5.0, 1.5])


def test_a_cheapest_path_keeps_off_walls_where_it_can():
    start, goal = [1.0, 1.0], [5.0, 1.0]
    near = find_path(space_of(WALL, 0.1, robot_radius=0.2), start, goal)
    wide = space_of(WALL, 0.1, robot_radius=0.2, inflation_radius=0.6, cost_scaling=3.0)
    far = find_path(wide, start, goal)
    walls = shapely.box(2.8, 0, 3.2, 3)
    assert walls.distance(shapely.LineString(far)) > walls.distance(shapely.LineString(near)) + 0.1
    assert length_of(near) < length_of(far) < 1.15 * length_of(near)
    assert crossed(far, WALL > 0, 0.1) == 0


def test_the_cost_near_walls_is_that_of_nav2():
    # By hand: 0.4 m from the wall, with a radius of 0.1 m, 252 exp(-3 * 0.3), over 50 + 0.8 of it.
    space = space_of(WALL, 0.1, robot_radius=0.1, inflation_radius=0.55, cost_scaling=3.0)
    assert space.cost[5, 24] == pytest.approx((50 + 0.8 * 252 * np.exp(-0.9)) / 50)
    assert space.cost[5, 21] == 1
    assert np.isinf(space.cost[5, 27])


@settings(max_examples=30)
@example(562631)  # a room behind a door that is seen from one corner alone
@given(st.integers(0, 2**32 - 1))
def test_where_nothing_costs_more_the_cheapest_path_is_nearly_the_shortest(seed):
    from hypermap.paths.weighted import cheapest_cells, straightened

    rng = np.random.default_rng(seed)
    blocked = rng.random((30, 30)) < 0.15
    blocked[0, 0] = blocked[-1, -1] = False
    space = space_of(np.where(blocked, 100, 0))
    far = distances(space, [0.5, 0.5]).meters[-1, -1]
    cells = cheapest_cells(space.cost, 0, 899)
    assert (cells is None) == np.isinf(far)
    if cells is not None:
        rows, cols = np.divmod(cells, 30)
        points = straightened(space.cost, np.column_stack([cols, rows]) + 0.5)
        # Steps to eight neighbors alone are up to 8.2 % longer (Bailey et al., SoCS 2015).
        assert far - 0.01 <= length_of(points) <= 1.09 * far
        assert crossed(points, blocked) == 0


def test_unknown_cells_are_free_where_the_caller_says_so():
    cells = WALL.copy()
    cells[30:, 28:32] = -1
    with pytest.raises(NoPath):
        find_path(space_of(cells, 0.1), [1.0, 1.0], [5.0, 1.0])
    assert len(find_path(space_of(cells, 0.1, unknown_is_free=True), [1, 1], [5, 1])) == 4


def test_a_keepout_zone_is_driven_around():
    grid = GridGeometry(60, 40, 0.1)
    layer = OccupancyLayer("occupancy", "map", grid, np.zeros((40, 60), dtype=np.int8))
    zone = shapely.box(2.5, 0, 3.5, 3)
    space = FreeSpace.of(layer, keepout=[zone])
    line = shapely.LineString(find_path(space, [1, 1], [5, 1]))
    assert line.length > 5
    assert zone.buffer(-0.06).disjoint(line)
    with pytest.raises(HypermapError, match=r"is in a keepout zone \(cell row 10, col 30\)"):
        find_path(space, [3.05, 1.05], [5, 1])


@pytest.mark.parametrize(
    ("start", "robot", "reason"),
    [
        ([3.05, 1.05], {}, r"is in a wall \(cell row 10, col 30\); the nearest free cell is row"),
        ([2.75, 1.05], {"robot_radius": 0.3}, r"too near to a wall for a radius of 0.3 m \(cell"),
        ([9.0, 1.0], {}, r"the start \(9.00, 1.00\) is off the grid; the nearest free cell is row"),
    ],
)
def test_a_start_that_is_not_free_is_reported_with_the_nearest_that_is(start, robot, reason):
    with pytest.raises(HypermapError, match=reason):
        find_path(space_of(WALL, 0.1, **robot), start, [5.0, 1.0])


def test_a_start_in_the_unknown_is_reported():
    with pytest.raises(HypermapError, match=r"is in an unknown cell .*; no cell is free"):
        find_path(space_of(-np.ones((3, 3))), [0.5, 0.5], [1.5, 1.5])


def test_a_layer_without_cells_has_no_paths():
    with pytest.raises(HypermapError, match="'occupancy' is empty"):
        FreeSpace.of(OccupancyLayer("occupancy", "map"))


def test_a_map_of_one_cell_has_a_path():
    points = find_path(space_of([[0]]), [0.2, 0.2], [0.8, 0.6])
    assert points.tolist() == [[0.2, 0.2], [0.8, 0.6]]


def test_paths_lie_where_the_grid_lies():
    origin = Pose2D(10, -3, np.pi / 2)
    turned = find_path(space_of(WALL, 0.1, origin), origin.apply([1, 1]), origin.apply([5, 1]))
    flat = find_path(space_of(WALL, 0.1), [1, 1], [5, 1])
    assert turned == pytest.approx(origin.apply(flat), abs=1e-4)


@pytest.mark.parametrize("name", ["robot_radius", "inflation_radius", "cost_scaling"])
@pytest.mark.parametrize("value", [-0.1, float("nan"), float("inf")])
def test_settings_are_0_or_more(name, value):
    with pytest.raises(ValueError, match=f"{name} must be 0 or more"):
        PathSettings(**{name: value})
