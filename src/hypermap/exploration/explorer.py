"""Where a robot should look next: frontiers that it can reach, and uncertain objects."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arguments import check_kind
from hypermap.core.arrays import FloatArray, IntArray, as_point_xy
from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.masks import Zone
from hypermap.core.occupancy import FREE, UNKNOWN, OccupancyLayer
from hypermap.exploration.frontiers import Frontier, find_frontiers
from hypermap.exploration.next_views import NextView, find_next_views
from hypermap.exploration.sensor import Sensor
from hypermap.paths import FreeSpace, Path, PathSettings, Planner
from hypermap.paths.places import Place
from hypermap.paths.settings import robot_of

LEAST_SIZE = 0.5
"""Default minimum length of a frontier [m]; shorter ones are mostly gaps between rays."""

LEAST_GAIN = 0.2
"""Default minimum gain of a frontier: the unknown area that would be seen [m2]."""

SURE_FROM = 5.0
"""Default existence below which an object is uncertain; five to ten observations."""

_PER_METER = 0.2
_OUTSIDE = (
    5.0  # meters from the grid at which a robot may stand, having not yet seen the floor there
)


class Explorer:
    """Lists where a robot should look next; the caller decides where it goes.

    Results are sorted, best first: gain times exp(-0.2 d), where d is the length of the path to
    the viewpoint [m].

    Attributes:
        planner: of the map and the robot.
        sensor: range and field of view of the robot's sensor.

    Args:
        hypermap: the map; it must not change while the explorer is used.
        start: where the robot is. Unknown cells under it count as free. If it is closer to a wall
            than its radius, the nearest place where it fits is used.
        settings: the robot; None for a point.
        sensor: its range and field of view; None for a depth camera.
        keepout: zones around objects, or areas in the base frame, that the robot's center must
            not enter.
        occupancy: name of the layer; None for the only one.

    Raises:
        HypermapError: If there is not one such layer, it is empty, there is no such place, or the
            robot cannot be there.
        FrameError: If the layer's frame is not connected to the base frame.
        TypeError: If it is not a map, or the settings, the sensor or a zone are something else.

    Source: the discount exp(-0.2 d) is that of González-Baños and Latombe, "Navigation strategies
    for exploring indoor environments", IJRR 2002.

    >>> import numpy as np
    >>> from hypermap import GridGeometry, Hypermap, OccupancyLayer
    >>> cells = np.full((40, 80), -1, dtype=np.int8)
    >>> cells[:, :40] = 0  # the left half is free, the right one unknown
    >>> cells[[0, -1]] = cells[:, 0] = 100  # with walls at three sides
    >>> office = Hypermap([OccupancyLayer("occupancy", "map", GridGeometry(80, 40, 0.1), cells)])
    >>> (frontier,) = Explorer(office, [1.0, 2.0], PathSettings(robot_radius=0.2)).frontiers()
    >>> round(frontier.size, 1), frontier.pose.x < 4, abs(frontier.pose.yaw) < 0.1
    (3.8, True, True)
    """

    def __init__(
        self,
        hypermap: Hypermap,
        start: Place,
        settings: PathSettings | None = None,
        sensor: Sensor | None = None,
        *,
        keepout: Iterable[Zone | BaseGeometry] = (),
        occupancy: str | None = None,
    ) -> None:
        robot = robot_of(settings)
        check_kind(hypermap, Hypermap)
        if not isinstance(start, str | int):
            start = as_point_xy(start)
            hypermap = _with_robot(hypermap, start, robot.robot_radius, occupancy)
        self.sensor = sensor or Sensor()
        check_kind(self.sensor, Sensor)
        self.planner = Planner(hypermap, robot, keepout=keepout, occupancy=occupancy)
        self._hypermap = hypermap
        self._start = _nearest_fit(self.planner.space, self.planner.point_of(start))
        self._meters = self.planner.distances(self._start).meters

    def frontiers(
        self, least_size: float = LEAST_SIZE, least_gain: float = LEAST_GAIN
    ) -> list[Frontier]:
        """Return the frontiers that the robot can reach and see, best first.

        A frontier longer than the sensor's range is split.

        Args:
            least_size: minimum length [m].
            least_gain: minimum unknown area that would be seen [m2].
        """
        found = find_frontiers(self.planner.space, self._meters, self.sensor, least_size)
        kept = [each for each in found if each.gain >= least_gain]
        return sorted(kept, key=lambda each: -each.gain * _discount(each.distance))

    def next_views(self, sure_from: float = SURE_FROM) -> list[NextView]:
        """Return viewpoints from which to look at the uncertain objects, best first.

        An object is uncertain if its existence is below `sure_from`, or if according to its
        evidence it was only seen from one side. The best viewpoint is at a large angle around the
        object from the earlier views, and near the robot. Objects that cannot be seen from a new
        side are left out.

        Args:
            sure_from: existence below which an object is uncertain [log-odds].

        Raises:
            FormatError: If the evidence is in a file that cannot be read.
        """
        found = find_next_views(
            self._hypermap, self.planner, self._meters, self.sensor, sure_from, _PER_METER
        )
        return sorted(found, key=lambda each: -each.turn * _discount(each.distance))

    def path_to(self, goal: Frontier | NextView) -> Path:
        """Return the path from the robot to the viewpoint of a frontier or an object."""
        return self.planner.path(self._start, [goal.pose.x, goal.pose.y])


def _discount(meters: float) -> float:
    return math.exp(-_PER_METER * meters)


def _nearest_fit(space: FreeSpace, start_xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return where a robot is, or the nearest place where it fits."""
    row, col = space.grid.cells_at(start_xy)[0].tolist()
    if not space.grid.contains([row], [col])[0] or space.occupied[row, col]:
        return start_xy
    near = space.nearest_place(start_xy, space.settings.robot_radius + space.grid.resolution)
    return start_xy if near is None or space.free[row, col] else near


def _with_robot(
    hypermap: Hypermap, start_xy: FloatArray, radius: float, name: str | None
) -> Hypermap:
    """Return the map, with the unknown cells under the robot set to free."""
    layer = hypermap.occupancy(name)
    if layer.grid is None or layer.cells is None:
        return hypermap
    layer_T_base = hypermap.frames.lookup(layer.frame_id, hypermap.base_frame)
    robot = shapely.Point(layer_T_base.apply([start_xy])[0]).buffer(
        radius + 1.5 * layer.grid.resolution
    )
    grid, cells = _grown(layer.grid, layer.cells, robot)
    rows, cols = grid.cells_in(robot)
    unknown = cells[rows, cols] < 0
    if not unknown.any():
        return hypermap
    cells = cells.copy()
    cells[rows[unknown], cols[unknown]] = FREE
    free = OccupancyLayer(layer.name, layer.frame_id, grid, cells)
    layers = [free if each is layer else each for each in hypermap]
    return Hypermap(layers, hypermap.frames, hypermap.metadata)


def _grown(
    grid: GridGeometry, cells: IntArray, robot: BaseGeometry
) -> tuple[GridGeometry, IntArray]:
    """Return the grid, enlarged to contain a robot that is just outside of it."""
    if robot.distance(grid.outline()) > _OUTSIDE:
        return grid, cells
    places = grid.cells_at(shapely.get_coordinates(robot))
    before = np.maximum(0, -places.min(axis=0))
    after = np.maximum(0, places.max(axis=0) + 1 - grid.shape)
    if not (before.any() or after.any()):
        return grid, cells
    rows, cols = zip(before.tolist(), after.tolist(), strict=True)
    corner = Pose2D(-cols[0] * grid.resolution, -rows[0] * grid.resolution)
    height, width = np.add(grid.shape, before + after).tolist()
    larger = GridGeometry(width, height, grid.resolution, grid.origin @ corner)
    return larger, np.pad(cells, (rows, cols), constant_values=UNKNOWN)
