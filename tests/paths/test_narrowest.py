"""What is said where no path leads: how small a robot would have to be, and where."""

from __future__ import annotations

import re

import numpy as np
import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st

from hypermap import GridGeometry, OccupancyLayer
from hypermap.core.errors import HypermapError
from hypermap.paths import FreeSpace, NoPath, PathSettings, find_path

from .test_find import space_of

DOORS = np.zeros((40, 90), dtype=np.int8)  # of 0.8 m and, beside a longer way, 1.2 m
DOORS[:, 30] = DOORS[:, 60] = 100
DOORS[16:24, 30] = DOORS[24:36, 60] = 0


def test_the_narrowest_place_of_the_widest_way_is_told():
    message = r"for a radius of 0.5 m; the widest way lets 0.39 m pass and is narrowest at \((.*)\)"
    with pytest.raises(NoPath, match=message) as error:
        find_path(space_of(DOORS, 0.1, robot_radius=0.5), [1, 1], [8, 1])
    x, y = map(float, re.findall(r"at \((.*), (.*)\)", str(error.value))[0])
    assert (x, y) == (pytest.approx(3.05, abs=0.1), pytest.approx(2.0, abs=0.1))
    assert len(find_path(space_of(DOORS, 0.1, robot_radius=0.39), [1, 1], [8, 1])) > 1


def test_what_only_unknown_cells_connect_is_told():
    cells = np.where(np.arange(90) == 30, -1, DOORS * 0).astype(np.int8)
    with pytest.raises(NoPath, match=r"only unknown cells connect them; .* --through-unknown"):
        find_path(space_of(cells, 0.1, robot_radius=0.2), [1, 1], [8, 1])
    cells[:, 60] = 100
    with pytest.raises(NoPath, match="; walls separate them"):
        find_path(space_of(cells, 0.1, robot_radius=0.2), [1, 1], [8, 1])


def test_keepout_zones_that_separate_two_places_are_told():
    space = space_of(DOORS, 0.1, robot_radius=0.2)
    kept_out = np.zeros(DOORS.shape, dtype=bool)
    kept_out[:, 30] = True
    closed = type(space)(
        **{**vars(space), "kept_out": kept_out, "cost": np.where(kept_out, np.inf, space.cost)}
    )
    with pytest.raises(NoPath, match="; walls or keepout zones separate them"):
        find_path(closed, [1, 1], [8, 1])


def test_only_the_center_of_a_robot_stays_out_of_keepout_zones():
    layer = OccupancyLayer("occupancy", "map", GridGeometry(90, 40, 0.1), DOORS)
    beside_door = [shapely.box(2.5, 0.0, 3.5, 1.95)]  # and through its lower half
    told = FreeSpace.of(layer, PathSettings(robot_radius=0.5), beside_door)
    with pytest.raises(NoPath, match=r"the widest way lets 0.39 m pass"):
        find_path(told, [1, 1], [8, 1])
    smaller = FreeSpace.of(layer, PathSettings(robot_radius=0.39), beside_door)
    assert len(find_path(smaller, [1, 1], [8, 1])) > 1


@given(
    st.lists(st.tuples(st.integers(0, 19), st.integers(0, 29)), min_size=20, max_size=60),
    st.sampled_from([0.12, 0.2, 0.25, 0.31]),
)
def test_a_robot_passes_that_is_as_small_as_is_told_and_no_larger_one(places, radius):
    cells = np.zeros((20, 30), dtype=np.int8)
    for row, col in places:
        cells[row, col] = 100
    start, goal = [0.05, 0.05], [2.95, 1.95]
    try:
        find_path(space_of(cells, 0.1, robot_radius=radius), start, goal)
    except NoPath as error:
        found = re.search(r"lets ([\d.]+) m pass and is narrowest at \((.*), (.*)\)", str(error))
    except HypermapError:
        assume(False)  # the robot cannot be at one of the ends
    else:
        assume(False)
    if found is None:
        with pytest.raises(NoPath):
            find_path(space_of(cells, 0.1), start, goal)
        return
    told, x, y = map(float, found.groups())
    assert len(find_path(space_of(cells, 0.1, robot_radius=told), start, goal)) > 1
    with pytest.raises(NoPath):
        find_path(space_of(cells, 0.1, robot_radius=told + 0.0101), start, goal)
    rows, cols = np.nonzero(cells)
    walls = shapely.multipoints(np.column_stack([(cols + 0.5) / 10, (rows + 0.5) / 10]))
    assert walls.distance(shapely.Point(x, y)) < told + 0.01 + 0.08  # a cell's corner
