"""Where robots stand to look at things: compared with a plain check that shares no code with it.

The check walks along paths and lines of sight in steps of a centimeter, and tries all free cells
of the robot's part of the floor where the planner says that there is no place.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray
from scipy import ndimage

from hypermap.core.found import FoundObject
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.formats import open_map
from hypermap.paths import Approach, NoPath, PathSettings, Planner

Points = NDArray[np.float64]
STEP = 0.01
SIDE = 0.05


@dataclass
class Floor:
    """What the check knows of a map: where a robot fits, and what can be looked across."""

    grid: GridGeometry
    fits: NDArray[np.bool_]
    part: NDArray[np.bool_]  # the largest part of it that is connected
    clear: NDArray[np.bool_]

    @classmethod
    def of(cls, hypermap: Hypermap, things: list[FoundObject], radius: float) -> Floor:
        layer = hypermap.occupancy()
        assert layer.grid is not None
        assert layer.cells is not None
        known_free = (layer.cells >= 0) & (layer.cells < 50)
        far = np.round(ndimage.distance_transform_edt(known_free) * layer.grid.resolution, 6)
        fits = known_free & (far > radius)
        parts, count = ndimage.label(fits)
        sizes = ndimage.sum_labels(fits, parts, range(1, count + 1))
        clear = known_free.copy()
        for thing in things:
            around = shapely.buffer(thing.object.footprint, layer.grid.resolution)
            clear[layer.grid.cells_in(around)] = True
        return cls(layer.grid, fits, parts == 1 + int(np.argmax(sizes)), clear)

    def start(self) -> Points:
        rows, cols = np.nonzero(self.part)
        middle = len(rows) // 2
        return self.grid.centers(rows[[middle]], cols[[middle]])[0]

    def all_in(self, cells: NDArray[np.bool_], begin: Points, end: Points) -> bool:
        """Whether all points of a line lie in such cells."""
        count = max(2, math.ceil(math.dist(begin, end) / STEP))
        points = begin + (end - begin) * np.linspace(0, 1, count)[:, np.newaxis]
        rows, cols = self.grid.cells_at(points).T
        return bool(self.grid.contains(rows, cols).all() and cells[rows, cols].all())

    def places(self, shape: shapely.Geometry, distance: float) -> Points:
        """Return where a robot could surely stand: with a margin for what lies on a border."""
        rows, cols = np.nonzero(self.part)
        centers = self.grid.centers(rows, cols)
        gaps = shapely.distance(shape, shapely.points(centers))
        wide = ~ndimage.binary_dilation(~self.clear)
        return np.array(
            [
                center
                for center in centers[np.abs(gaps - distance) <= self.grid.resolution / 2]
                if self.all_in(wide, center, nearest_point(shape, center))
            ]
        )


def nearest_point(shape: shapely.Geometry, point: Points) -> Points:
    return shapely.get_coordinates(shapely.shortest_line(shape, shapely.Point(point)))[0]


def check_pose(floor: Floor, thing: FoundObject, there: Approach, distance: float) -> None:
    place = np.array([there.pose.x, there.pose.y])
    shape = thing.object.footprint
    assert shape.distance(shapely.Point(place)) == pytest.approx(
        distance, abs=floor.grid.resolution
    )
    dx, dy = np.array(thing.point_xy) - place
    assert math.remainder(math.atan2(dy, dx) - there.pose.yaw, math.tau) == pytest.approx(0)
    assert floor.all_in(floor.clear, place, nearest_point(shape, place)), "a wall is between"
    assert there.path is not None
    points = there.path.points_xy
    assert points[0] == pytest.approx(floor.start())
    assert points[-1] == pytest.approx(place)
    for begin, end in itertools.pairwise(points):
        assert floor.all_in(floor.fits, begin, end), "the robot does not fit"


def check_all(hypermap: Hypermap, radius: float, distance: float) -> int:
    """Check the approach to each object; return to how many there is none."""
    planner = Planner(hypermap, PathSettings(radius))
    things = planner.places.objects()
    floor = Floor.of(hypermap, things, radius)
    none = 0
    for thing in things:
        there = approach(planner, thing, distance, floor.start())
        if there is None:
            none += 1
            assert len(floor.places(thing.object.footprint, distance)) == 0
        else:
            check_pose(floor, thing, there, distance)
    return none


def approach(
    planner: Planner, thing: FoundObject, distance: float, start: Points
) -> Approach | None:
    try:
        return planner.approach(thing.object.id, distance, start)
    except NoPath:
        return None


def cluttered(seed: int) -> Hypermap:
    """Return a floor of 6 x 5 m with walls, unknown places, tables, and things on them."""
    rng = np.random.default_rng(seed)
    cells = np.zeros((100, 120), dtype=np.int8)
    cells[[0, -1]] = cells[:, [0, -1]] = 100
    for value in (100, 100, 100, 100, -1, -1):
        row, col = rng.integers(5, 90, 2)
        height, width = rng.permutation([rng.integers(2, 4), rng.integers(10, 40)])
        cells[row : row + height, col : col + width] = value
    grid = GridGeometry(120, 100, SIDE)
    things = []
    for number in range(8):
        x, y, turn = rng.uniform([0.3, 0.3, 0], [5.4, 4.4, 90])
        size = rng.uniform(0.1, 0.9, 2) if number % 2 else rng.uniform(0.05, 0.15, 2)
        shape = shapely.affinity.rotate(shapely.box(x, y, x + size[0], y + size[1]), turn)
        if number % 2:
            cells[grid.cells_in(shape)] = 100
        things.append(SemanticObject("table" if number % 2 else "cup", shape, number))
    layers = [OccupancyLayer("occupancy", "map", grid, cells)]
    return Hypermap([*layers, SemanticLayer("semantic", "map", things)])


def test_each_pose_on_a_cluttered_floor_is_reached_faces_and_sees_its_object():
    robots = [(0.0, 0.4), (0.2, 0.6), (0.3, 0.8)]
    none = [check_all(cluttered(seed), *robot) for seed in range(4) for robot in robots]
    assert 0 < sum(none) < 8 * len(none) / 2  # or a half of the check was never made


def test_each_pose_in_a_mapped_room_is_reached_faces_and_sees_its_object(shared_data: Path):
    none = check_all(open_map(shared_data / "maps" / "lab.hmap"), 0.2, 0.6)
    assert none < 5
