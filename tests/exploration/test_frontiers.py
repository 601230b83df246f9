"""Borders of the unknown: which there are, from where they are seen, and what they promise."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from hypermap import FrameTree, GridGeometry, Hypermap, OccupancyLayer, Pose2D, Transform
from hypermap.core.errors import HypermapError
from hypermap.exploration import Explorer, Sensor
from hypermap.exploration.frontiers import frontier_cells, pieces
from hypermap.exploration.visibility import CLEAR, UNKNOWN, WALL, Visibility
from hypermap.paths import PathSettings

SIDE = 0.05
ROBOT = PathSettings(robot_radius=0.2)


def a_map(cells: np.ndarray, origin: Pose2D | None = None) -> Hypermap:
    height, width = cells.shape
    grid = GridGeometry(width, height, SIDE, origin or Pose2D())
    return Hypermap([OccupancyLayer("occupancy", "map", grid, cells)])


def half_known() -> np.ndarray:
    """Return 12 x 6 m: free to the left of x = 6, walls at three sides, unknown to the right."""
    cells = np.full((120, 240), -1, dtype=np.int8)
    cells[:, :120] = 0
    cells[[0, -1], :120] = cells[:, 0] = 100
    return cells


def test_a_frontier_promises_the_sector_that_is_unknown():
    sensor = Sensor(max_range=2.0, fov_deg=60)
    found = Explorer(a_map(half_known()), [1.0, 3.0], ROBOT, sensor).frontiers()
    # 5.9 m of border, of which no part is longer than 2 m.
    assert sum(each.size for each in found) == pytest.approx(5.9)
    assert all(each.size <= 2.05 for each in found)
    for each in found:
        before = 6.0 - each.pose.x  # the robot stays so far from the unknown
        assert 0.2 < before < 0.35
        assert each.place_xy[0] == pytest.approx(5.975)
    middle = min(found, key=lambda each: abs(each.place_xy[1] - 3))
    # A sector of 60 degrees and 2 m, but for the triangle that is known.
    before = 6.0 - middle.pose.x
    expected = 0.5 * 4 * math.pi / 3 - before**2 * math.tan(math.pi / 6)
    assert middle.gain == pytest.approx(expected, rel=0.04)
    assert middle.pose.yaw == pytest.approx(0, abs=0.3)
    assert middle.distance == pytest.approx(math.dist((1, 3), (middle.pose.x, middle.pose.y)), 0.01)


def test_the_best_frontier_is_near_and_shows_much():
    cells = np.full((60, 400), -1, dtype=np.int8)
    cells[5:55, 100:300] = 0
    found = Explorer(a_map(cells), [7.0, 1.5], ROBOT, Sensor(fov_deg=360)).frontiers()
    worth = [each.gain * math.exp(-0.2 * each.distance) for each in found]
    assert worth == sorted(worth, reverse=True)
    assert found[0].distance < found[-1].distance


def test_a_map_that_is_known_within_walls_has_no_frontier():
    cells = np.zeros((60, 60), dtype=np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = 100
    assert Explorer(a_map(cells), [1.5, 1.5], ROBOT).frontiers() == []


def test_what_is_off_the_grid_is_unknown():
    cells = np.zeros((60, 60), dtype=np.int8)
    found = Explorer(a_map(cells), [1.5, 1.5], ROBOT).frontiers()
    assert sum(each.size for each in found) == pytest.approx(4 * 59 * SIDE)


def test_what_the_robot_cannot_reach_is_not_reported():
    cells = half_known()
    cells[:, 60] = 100
    cells[55:61, 60] = 0  # a door of 0.3 m
    near = Sensor(max_range=2.0)  # which shows no border through the door
    assert Explorer(a_map(cells), [1.0, 3.0], ROBOT, near).frontiers() == []
    assert Explorer(a_map(cells), [1.0, 3.0], PathSettings(robot_radius=0.1), near).frontiers()
    wide = Explorer(a_map(cells), [1.0, 3.0], ROBOT).frontiers()
    assert {each.pose.x < 3 for each in wide} == {True}
    zones = [shapely.box(3, 0, 6, 6)]
    assert Explorer(a_map(half_known()), [1.0, 3.0], ROBOT, near, keepout=zones).frontiers() == []


def test_short_borders_and_those_that_show_little_are_left_out():
    cells = np.zeros((80, 80), dtype=np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = 100
    cells[40:42, 40:42] = -1  # 0.01 m2, with a border of 8 cells
    explorer = Explorer(a_map(cells), [1.0, 1.0], ROBOT)
    assert explorer.frontiers() == []
    assert explorer.frontiers(least_size=0.2) == []
    (speck,) = explorer.frontiers(least_size=0.2, least_gain=0.001)
    assert speck.gain == pytest.approx(0.01)
    assert explorer.frontiers(least_size=0.5, least_gain=0) == []


def test_a_camera_that_looks_over_the_floor_stands_back():
    sensor = Sensor(max_range=4.0, min_range=1.5)
    for each in Explorer(a_map(half_known()), [1.0, 3.0], ROBOT, sensor).frontiers():
        assert math.dist((each.pose.x, each.pose.y), each.place_xy) >= 1.5


def test_where_the_robot_stands_is_free_though_no_sensor_sees_it():
    cells = half_known()
    cells[55:65, 15:25] = -1  # below the robot and around it
    robot = PathSettings(robot_radius=0.3)
    assert Explorer(a_map(cells), [1.0, 3.0], robot).frontiers()
    # With nothing known around it, the robot can turn where it is.
    lost = Explorer(a_map(half_known()), [9.0, 3.0], robot, Sensor(fov_deg=360)).frontiers()
    assert lost
    assert max(each.distance for each in lost) <= 0.1
    with pytest.raises(HypermapError, match=r"the start \(6.00, 0.00\) is in a wall"):
        Explorer(a_map(half_known()), [5.999, 0.001], ROBOT)


def test_a_robot_may_stand_beside_what_it_has_seen():
    """As one whose camera sees the floor from some way ahead on, where the map then begins."""
    cells = half_known()
    bold = PathSettings(robot_radius=0.2, unknown_is_free=True)
    (border, *_) = Explorer(a_map(cells[:, 1:]), [-1.0, 3.0], bold).frontiers()
    assert border.distance == pytest.approx(border.pose.x + 1.0, abs=1.0)
    assert (
        Explorer(a_map(cells[:, 1:]), [-1.0, 3.0], ROBOT, Sensor(min_range=0.5)).frontiers() == []
    )
    with pytest.raises(HypermapError, match=r"the start \(-9.00, 3.00\) is off the grid"):
        Explorer(a_map(cells), [-9.0, 3.0], ROBOT)


def test_a_robot_that_stands_too_near_to_a_wall_starts_beside_it():
    found = Explorer(a_map(half_known()), [0.12, 3.0], ROBOT).frontiers()
    assert found
    with pytest.raises(HypermapError, match="is in a wall"):
        Explorer(a_map(half_known()), [0.02, 3.0], ROBOT)


def test_a_robot_may_drive_through_the_unknown():
    cells = half_known()
    cells[:, 40:60] = -1
    near = Explorer(a_map(cells), [1.0, 3.0], ROBOT).frontiers()
    bold = PathSettings(robot_radius=0.2, unknown_is_free=True)
    far = Explorer(a_map(cells), [1.0, 3.0], bold).frontiers()
    assert max(each.place_xy[0] for each in near) < 2.1
    assert max(each.place_xy[0] for each in far) > 5.9


def test_poses_are_in_the_base_frame_though_the_grid_is_turned():
    turned = Hypermap(
        [a_map(half_known(), Pose2D(3.0, -1.0, math.pi / 2))["occupancy"]],
        FrameTree([Transform("map", "robot", Pose2D(1.0, 0.0))]),
    )
    # The grid's x axis points along y: cell centers at (x, y) are at (3 - y, x - 1).
    found = Explorer(turned, [0.0, 0.0], ROBOT, Sensor(max_range=8)).frontiers()
    (border,) = found
    assert border.place_xy[1] == pytest.approx(4.975)
    assert border.pose.yaw == pytest.approx(math.pi / 2, abs=0.3)


def test_a_path_leads_to_where_a_frontier_is_seen():
    explorer = Explorer(a_map(half_known()), [1.0, 3.0], ROBOT)
    best = explorer.frontiers()[0]
    path = explorer.path_to(best)
    assert path.points_xy[-1] == pytest.approx([best.pose.x, best.pose.y])
    assert path.length == pytest.approx(best.distance, abs=0.05)


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"max_range": 0.0}, "max_range must be above 0"),
        ({"max_range": math.nan}, "max_range must be above 0"),
        ({"min_range": 5.0}, "min_range must be 0 or more, and below max_range"),
        ({"fov_deg": 0.0}, "fov_deg must be above 0"),
        ({"fov_deg": 361.0}, "fov_deg must be above 0 and at most 360"),
    ],
)
def test_a_sensor_that_cannot_be_is_refused(values, reason):
    with pytest.raises(ValueError, match=reason):
        Sensor(**values)


def test_rays_that_would_cross_too_many_cells_are_refused():
    grid = GridGeometry(3, 3, 0.001)
    layer = OccupancyLayer("occupancy", "map", grid, np.zeros((3, 3), dtype=np.int8))
    with pytest.raises(HypermapError, match="at most 2000 cells of the map, which are 2 m; got 4"):
        Explorer(Hypermap([layer]), [0.0015, 0.0015]).frontiers()


@given(arrays(np.int8, st.tuples(st.integers(1, 8), st.integers(1, 8)), elements=st.integers(0, 2)))
def test_frontier_cells_are_free_and_touch_an_unknown_side(states):
    found = frontier_cells(states == CLEAR, states == UNKNOWN)
    height, width = states.shape
    for row in range(height):
        for col in range(width):
            beside = [(row + 1, col), (row - 1, col), (row, col + 1), (row, col - 1)]
            is_border = any(
                not (0 <= r < height and 0 <= c < width) or states[r, c] == UNKNOWN
                for r, c in beside
            )
            assert found[row, col] == (states[row, col] == CLEAR and is_border)


@given(
    arrays(np.bool_, st.tuples(st.integers(1, 12), st.integers(1, 12))),
    st.integers(1, 4),
    st.floats(2, 6),
)
def test_pieces_are_short_and_hold_each_cell_once_at_most(cells, least, longest):
    found = list(pieces(cells, least, longest))
    places = [tuple(place) for piece in found for place in piece.tolist()]
    assert len(set(places)) == len(places)
    assert all(cells[place] for place in places)
    assert all(len(piece) >= least for piece in found)
    assert all(np.ptp(piece, axis=0).max() <= longest * math.sqrt(2) + 1 for piece in found)
    if least == 1:
        assert len(places) == cells.sum()


@settings(max_examples=40)
@given(
    arrays(np.uint8, (9, 9), elements=st.sampled_from([CLEAR, CLEAR, CLEAR, UNKNOWN, WALL])),
    st.integers(0, 8),
    st.integers(0, 8),
)
def test_what_is_seen_is_joined_to_the_eye(cells, row, col):
    """Between what is seen and the eye is no wall: it can be walked to over cells that are none."""
    cells[row, col] = CLEAR
    seen = Visibility(GridGeometry(9, 9, 1.0), cells, 6.0).of(row, col)
    from scipy import ndimage

    labels, _ = ndimage.label(np.pad(cells != WALL, 20, constant_values=True))
    rows, cols = seen.clear_on(cells.shape)
    assert (cells[rows, cols] == CLEAR).all()
    assert (labels[rows + 20, cols + 20] == labels[row + 20, col + 20]).all()
    assert (np.hypot(rows - row, cols - col) <= 6.0 + math.sqrt(0.5)).all()


def test_all_of_an_empty_room_is_seen():
    cells = np.full((41, 61), WALL, dtype=np.uint8)
    cells[1:-1, 1:-1] = CLEAR
    cells[20, 30] = UNKNOWN
    seen = Visibility(GridGeometry(61, 41, 0.1), cells, 8.0).of(10, 10)
    rows, _ = seen.clear_on(cells.shape)
    assert len(rows) == 39 * 59 - 1
    assert seen.unknown.sum() == 1
    ray = math.tau * int(np.flatnonzero(seen.unknown)[0]) / len(seen.unknown)
    assert ray == pytest.approx(math.atan2(10, 20), abs=0.05)
