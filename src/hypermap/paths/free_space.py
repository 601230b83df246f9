"""The free space of a robot: where its center may be, and the cost of driving there."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import scipy
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import BoolArray, PointsLike, as_point_xy
from hypermap.core.errors import HypermapError
from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.core.occupancy import OCCUPIED, OccupancyLayer
from hypermap.paths.settings import PathSettings, robot_of
from hypermap.paths.strips import Strips, strips_of

_DECIMALS = 6  # of a cell; closer points count as on the border of cells
_ROUNDING = 1e-9  # m; six cells of 0.05 m are not farther than 0.3 m
_INSCRIBED = 252  # the highest cost of a cell where the robot may be
_NEUTRAL, _FACTOR = 50, 0.8  # a cell costs 50 and 0.8 times its inflation


@dataclass(frozen=True, eq=False)
class FreeSpace:
    """A grid with the cells that a robot's center may be in.

    Attributes:
        frame_id: of all points.
        grid: geometry of the cells.
        cost: of a meter in each cell, 1 or more; infinite where the robot cannot be: float32, shape
            (height, width).
        occupied: the occupied cells, regardless of the robot, of the same shape.
        unknown: which cells are unknown.
        kept_out: which cells lie in a keepout zone; None for none.
        settings: of the robot.
    """

    frame_id: str
    grid: GridGeometry
    cost: NDArray[np.float32]
    occupied: BoolArray
    unknown: BoolArray
    kept_out: BoolArray | None
    settings: PathSettings

    @classmethod
    def of(
        cls,
        occupancy: OccupancyLayer,
        settings: PathSettings | None = None,
        keepout: Iterable[BaseGeometry] = (),
    ) -> FreeSpace:
        """Return the free space of a robot.

        A cell is free below 50 percent. The robot's radius is measured between the centers of
        cells, so a path may be nearer to a wall by up to a cell.

        Args:
            occupancy: the grid.
            settings: the robot.
            keepout: areas in the layer's frame that the robot's center stays out of.

        Raises:
            HypermapError: If the layer is empty.
            TypeError: If the settings are something else, such as a radius.

        Source: the cost is that of Nav2's inflation layer, 252 exp(-scaling (distance - radius)),
        weighed as its NavFn planner does, (50 + 0.8 cost) / 50.
        """
        if occupancy.grid is None or occupancy.cells is None:
            raise HypermapError(f"layer {occupancy.name!r} is empty, so there are no paths in it")
        chosen = robot_of(settings)
        unknown = occupancy.cells < 0
        occupied = occupancy.cells >= OCCUPIED / 2
        blocked = occupied if chosen.unknown_is_free else occupied | unknown
        cost = _cost(blocked, occupancy.grid.resolution, chosen)
        kept_out = None
        for area in keepout:
            if kept_out is None:
                kept_out = np.zeros(blocked.shape, dtype=bool)
            window = occupancy.grid.window_in(area)
            kept_out[window.slices] |= window.inside
        if kept_out is not None:
            cost[kept_out] = np.inf
        return cls(occupancy.frame_id, occupancy.grid, cost, occupied, unknown, kept_out, chosen)

    @functools.cached_property
    def free(self) -> BoolArray:
        """Which cells the robot's center may be in, shape (height, width)."""
        return np.isfinite(self.cost)

    @functools.cached_property
    def strips(self) -> Strips:
        """The same as runs and corners."""
        return strips_of(self.free)

    def place(self, point_xy: PointsLike, what: str) -> tuple[tuple[float, float], int]:
        """Return a point as (x, y) in cells, and the number of the free cell that contains it.

        A point on the border of several cells is in any of them.

        Args:
            point_xy: in the frame of the grid [m].
            what: the name of the point in error messages, such as "the start".

        Raises:
            HypermapError: If none is free; it names the cell and the nearest free one.
        """
        point = as_point_xy(point_xy)
        y, x = np.round(self.grid.positions_at(point)[0], _DECIMALS).tolist()
        height, width = self.grid.shape
        for row in {int(np.floor(y)), int(np.ceil(y)) - 1}:
            for col in {int(np.floor(x)), int(np.ceil(x)) - 1}:
                if 0 <= row < height and 0 <= col < width and self.free[row, col]:
                    return (x, y), row * width + col
        raise HypermapError(self._refusal(point, int(np.floor(y)), int(np.floor(x)), what))

    def nearest_place(self, point_xy: PointsLike, within: float) -> NDArray[np.float64] | None:
        """Return the nearest center of a free cell [m], shape (2,); None if none is that near."""
        point = as_point_xy(point_xy)
        around = self.grid.window_in(shapely.Point(point).buffer(within))
        rows, cols = around.cells(around.positions(self.free[around.slices]))
        if not len(rows):
            return None
        centers = self.grid.centers(rows, cols)
        nearest: NDArray[np.float64] = centers[np.argmin(np.hypot(*(centers - point).T))]
        return nearest

    def middle_of(
        self,
        area: BaseGeometry,
        middle_xy: PointsLike | None = None,
        preferred: BoolArray | None = None,
    ) -> NDArray[np.float64] | None:
        """Return the free cell of an area that is nearest to its middle.

        Args:
            area: in the frame of the grid.
            middle_xy: its middle [m]; None for the point farthest from its outline.
            preferred: cells to use if one of them is free, of the grid's shape.

        Returns:
            Its center [m], shape (2,); None if no cell of the area is free.
        """
        rows, cols = self.grid.window_in(area).cells()
        chosen = self.free[rows, cols]
        if preferred is not None and (better := chosen & preferred[rows, cols]).any():
            chosen = better
        if not chosen.any():
            return None
        if middle_xy is None:
            circle = np.asarray(shapely.maximum_inscribed_circle([area], 0.1))
            middle_xy = shapely.get_coordinates(circle)[0]
        centers = self.grid.centers(rows[chosen], cols[chosen])
        far = np.hypot(*(centers - as_point_xy(middle_xy)).T)
        nearest: NDArray[np.float64] = centers[int(np.argmin(far))]
        return nearest

    def within(self, area: BaseGeometry) -> FreeSpace | None:
        """Return the part inside an area, on a smaller grid; None if no cell in it is free.

        Args:
            area: in the frame of the grid.
        """
        window = self.grid.window_in(area)
        cost = np.where(window.inside, self.cost[window.slices], np.float32(np.inf))
        if not np.isfinite(cost).any():
            return None
        height, width = window.shape
        corner = Pose2D(*(self.grid.resolution * np.array([window.col, window.row])).tolist())
        return replace(
            self,
            grid=GridGeometry(width, height, self.grid.resolution, self.grid.origin @ corner),
            cost=cost,
            occupied=self.occupied[window.slices],
            unknown=self.unknown[window.slices],
            kept_out=None if self.kept_out is None else self.kept_out[window.slices],
        )

    def _refusal(self, point: NDArray[np.float64], row: int, col: int, what: str) -> str:
        says = f"{what} ({point[0]:.2f}, {point[1]:.2f}) {self._reason(row, col)}"
        rows, cols = np.nonzero(self.free)
        if not len(rows):
            return f"{says}; no cell is free for this robot"
        i = int(np.argmin((rows - row) ** 2 + (cols - col) ** 2))
        x, y = self.grid.centers(rows[i : i + 1], cols[i : i + 1])[0]
        return f"{says}; the nearest free cell is row {rows[i]}, col {cols[i]}, at {x:.3f},{y:.3f}"

    def _reason(self, row: int, col: int) -> str:
        """Return why a cell is not free."""
        height, width = self.grid.shape
        if not (0 <= row < height and 0 <= col < width):
            return "is off the grid"
        cell = f"(cell row {row}, col {col})"
        if self.occupied[row, col]:
            return f"is in a wall {cell}"
        if self.unknown[row, col] and not self.settings.unknown_is_free:
            return f"is in an unknown cell {cell}"
        if self.kept_out is not None and self.kept_out[row, col]:
            return f"is in a keepout zone {cell}"
        radius = self.settings.robot_radius
        return f"is too near to a wall for a radius of {radius:g} m {cell}"


def _cost(blocked: BoolArray, resolution: float, settings: PathSettings) -> NDArray[np.float32]:
    reach = max(settings.robot_radius, settings.inflation_radius)
    if reach == 0 or not blocked.any():
        return np.where(blocked, np.float32(np.inf), np.float32(1))
    far = scipy.ndimage.distance_transform_edt(~blocked) * resolution
    cost = np.ones(blocked.shape, dtype=np.float32)
    too_near = far <= settings.robot_radius + _ROUNDING
    near = ~too_near & (far <= settings.inflation_radius)
    beyond = far[near] - settings.robot_radius
    inflated = _INSCRIBED * np.exp(-settings.cost_scaling * beyond)
    cost[near] = (_NEUTRAL + _FACTOR * inflated) / _NEUTRAL
    cost[too_near] = np.inf
    return cost
