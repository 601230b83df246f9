"""Where a robot should look next: frontiers that it can reach, and unsure objects."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

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

LEAST_SIZE = 0.5
"""Shorter frontiers [m] are left out, if nobody says: they are gaps between rays."""

LEAST_GAIN = 0.2
"""Frontiers from which less of the unknown could be seen [m2] are left out, if nobody says."""

SURE_FROM = 5.0
"""Objects with less existence than this are unsure, if nobody says; five to ten observations."""

_PER_METER = 0.2
_BESIDE = 5.0  # meters from the grid at which a robot may stand that has not seen its own place


class Explorer:
    """Tells where a robot should look next; what it does is for the caller to decide.

    What is best comes first: what could be seen counts by exp(-0.2 d), where d is the length of
    the path to there [m].

    Attributes:
        planner: of the map and the robot.
        sensor: what the robot's sensor sees.

    Args:
        hypermap: the map, which must not change meanwhile.
        start: where the robot is. Unknown cells that it covers there are free. If it stands nearer
            to a wall than its radius, the place next to it where it could be counts.
        settings: the robot; None for a point.
        sensor: what it sees; None for a depth camera.
        keepout: zones around objects, or areas in the base frame, that the robot's center stays
            out of.
        occupancy: name of the layer; None for the only one.

    Raises:
        HypermapError: If there is not one such layer, it is empty, there is no such place, or the
            robot cannot be there.
        FrameError: If the layer's frame is not connected to the base frame.

    Source: weighing by exp(-0.2 d) is that of González-Baños and Latombe, "Navigation strategies
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
        robot = settings or PathSettings()
        if not isinstance(start, str | int):
            start = as_point_xy(start)
            hypermap = _standing(hypermap, start, robot.robot_radius, occupancy)
        self.sensor = sensor or Sensor()
        self.planner = Planner(hypermap, robot, keepout=keepout, occupancy=occupancy)
        self._hypermap = hypermap
        self._start = _foothold(self.planner.space, self.planner.point_of(start))
        self._meters = self.planner.distances(self._start).meters

    def frontiers(
        self, least_size: float = LEAST_SIZE, least_gain: float = LEAST_GAIN
    ) -> list[Frontier]:
        """Return the borders of the unknown that the robot can reach and look at, best first.

        Borders that are longer than the sensor sees are told in parts.

        Args:
            least_size: shorter ones are left out [m].
            least_gain: those from which less of the unknown could be seen are left out [m2].
        """
        found = find_frontiers(self.planner.space, self._meters, self.sensor, least_size)
        kept = [each for each in found if each.gain >= least_gain]
        return sorted(kept, key=lambda each: -each.gain * _discount(each.distance))

    def next_views(self, sure_from: float = SURE_FROM) -> list[NextView]:
        """Return from where the unsure objects should be looked at, best first.

        An object is unsure if its existence is below `sure_from`, or it was seen from one side
        alone, as its evidence tells. The best place is far around it from where it was seen, and
        near to the robot. Objects that no new place sees are left out.

        Args:
            sure_from: existence from which on an object is sure [log-odds].

        Raises:
            FormatError: If the evidence is kept in a file that cannot be read.
        """
        found = find_next_views(
            self._hypermap, self.planner, self._meters, self.sensor, sure_from, _PER_METER
        )
        return sorted(found, key=lambda each: -each.turn * _discount(each.distance))

    def path_to(self, goal: Frontier | NextView) -> Path:
        """Return the path from where the robot is to a place to look from."""
        return self.planner.path(self._start, [goal.pose.x, goal.pose.y])


def _discount(meters: float) -> float:
    return math.exp(-_PER_METER * meters)


def _foothold(space: FreeSpace, start_xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return where a robot is, or the place next to it where it could be."""
    row, col = space.grid.cells_at(start_xy)[0].tolist()
    if not space.grid.contains([row], [col])[0] or space.occupied[row, col]:
        return start_xy
    near = space.nearest_place(start_xy, space.settings.robot_radius + space.grid.resolution)
    return start_xy if near is None or space.free[row, col] else near


def _standing(
    hypermap: Hypermap, start_xy: FloatArray, radius: float, name: str | None
) -> Hypermap:
    """Return a map in which the unknown cells that the robot covers are free."""
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
    """Return a grid that holds the robot, if it stands not far beside it."""
    if robot.distance(grid.outline()) > _BESIDE:
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
