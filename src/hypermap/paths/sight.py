"""From where an object is seen: free places around it, with nothing but objects between."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import BoolArray, FloatArray, IntArray, PointsLike, as_point_xy
from hypermap.paths.free_space import FreeSpace
from hypermap.paths.segments import line_cost


class Sight:
    """Lines of sight over a grid; walls and unknown cells block them, mapped objects do not.

    A cup stands on a table: the table's cells are occupied, but are no wall.

    Args:
        space: the grid.
        shapes: footprints of all objects, in its frame.
    """

    def __init__(self, space: FreeSpace, shapes: Iterable[BaseGeometry]) -> None:
        self._space = space
        self._cost = np.where(space.occupied | space.unknown, np.float32(np.inf), np.float32(1))
        for shape in shapes:
            window = space.grid.window_in(shapely.buffer(shape, space.grid.resolution))
            self._cost[window.slices][window.inside] = 1

    @property
    def clear(self) -> BoolArray:
        """Which cells do not block a line of sight, shape (height, width)."""
        return np.isfinite(self._cost)

    def around(
        self, shape: BaseGeometry, least: float, most: float
    ) -> tuple[IntArray, NDArray[np.float64]]:
        """Return the free cells whose centers are between two distances from a shape [m].

        Returns:
            Their flat indices, shape (N,), and their distances from the shape [m].
        """
        grid = self._space.grid
        rows, cols = grid.window_in(shapely.buffer(shape, most)).cells()
        cells = np.asarray(rows * grid.width + cols)
        cells = cells[self._space.free.ravel()[cells]]
        rows, cols = np.divmod(cells, grid.width)
        points = shapely.points(grid.centers(rows, cols))
        gaps: NDArray[np.float64] = np.asarray(shapely.distance(shape, points))
        chosen = (gaps >= least) & (gaps <= most)
        return cells[chosen], gaps[chosen]

    def sees(self, point_xy: PointsLike, shape: BaseGeometry) -> bool:
        """Return whether nothing blocks the line from a point to the nearest point of a shape.

        Args:
            point_xy: in the frame of the grid [m].
            shape: likewise.
        """
        line = shapely.shortest_line(shape, shapely.Point(as_point_xy(point_xy)))
        ends = self._space.grid.positions_at(shapely.get_coordinates(line))
        (y, x), (own_y, own_x) = ends.tolist()
        return bool(np.isfinite(line_cost(self._cost, own_x, own_y, x, y)))

    def first_that_sees(
        self, shape: BaseGeometry, cells: IntArray, order: FloatArray
    ) -> int | None:
        """Return which of some cells sees the nearest point of a shape; None where none does.

        Args:
            shape: in the frame of the grid.
            cells: flat indices, shape (N,).
            order: the cell with the lowest number is looked at first; infinite ones never.
        """
        grid = self._space.grid
        best_first: list[int] = np.argsort(order, kind="stable").tolist()
        for i in best_first:
            if not np.isfinite(order[i]):
                return None
            row, col = divmod(int(cells[i]), grid.width)
            center = shapely.points(grid.centers([row], [col])[0])
            line = shapely.get_coordinates(shapely.shortest_line(shape, center))
            y, x = grid.positions_at(line[:1])[0].tolist()
            if np.isfinite(line_cost(self._cost, col + 0.5, row + 0.5, x, y)):
                return i
        return None
