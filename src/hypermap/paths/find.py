"""Paths and distances over the free space of a grid."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import PointsLike, as_point_xy
from hypermap.core.errors import HypermapError
from hypermap.paths.cones import SOURCE, Reached
from hypermap.paths.free_space import FreeSpace
from hypermap.paths.geodesic import reach
from hypermap.paths.narrowest import why_no_path
from hypermap.paths.segments import line_cost
from hypermap.paths.weighted import cheapest_cells, straightened

_OFF = 1e-4  # cells; distance between a path and the corner that it turns around


class NoPath(HypermapError):
    """No path leads from one place to another."""


@dataclass(frozen=True, eq=False)
class Distances:
    """The distances of all cells of a grid from one point.

    Attributes:
        space: the free space.
        start_xy: the point, in its frame [m], shape (2,).
        meters: length of the shortest path to the center of each cell, float32, shape
            (height, width); infinite where no path leads.
    """

    space: FreeSpace
    start_xy: NDArray[np.float64]
    meters: NDArray[np.float32]

    def at(self, points_xy: PointsLike) -> NDArray[np.float64]:
        """Return the length of the path to the cell of each point [m], shape (N,).

        Infinite where no path leads, and off the grid.
        """
        rows, cols = self.space.grid.cells_at(points_xy).T
        there = self.space.grid.contains(rows, cols)
        result = np.full(len(rows), np.inf)
        result[there] = self.meters[rows[there], cols[there]]
        return result


def distances(space: FreeSpace, start_xy: PointsLike) -> Distances:
    """Return the lengths of the shortest paths from a point to all cells, in one sweep.

    They are exact for straight lines that turn at corners of cells, up to a thousandth of a cell.
    The cost near walls does not count.

    Raises:
        HypermapError: If the robot cannot be at the point.
    """
    source, _ = space.place(start_xy, "the start")
    reached = reach(space.strips, space.grid.width, source)
    meters = (reached.far * np.float32(space.grid.resolution)).reshape(space.grid.shape)
    return Distances(space, as_point_xy(start_xy), meters)


def find_path(space: FreeSpace, start_xy: PointsLike, goal_xy: PointsLike) -> NDArray[np.float64]:
    """Return the shortest path as a polyline, or the cheapest, where being near walls has a cost.

    Shortest is the shortest any-angle path, up to a cell next to the goal. The cheapest
    is found among 16 directions, and straightened.

    Args:
        space: where the robot can be.
        start_xy: in its frame [m].
        goal_xy: likewise.

    Returns:
        Points (x, y) from the start to the goal [m], shape (N, 2), N >= 2.

    Raises:
        NoPath: If none leads there.
        HypermapError: If the robot cannot be at one of the points.
    """
    start, first = space.place(start_xy, "the start")
    goal, last = space.place(goal_xy, "the goal")
    if space.settings.inflation_radius > space.settings.robot_radius:
        points = _cheapest(space, start, first, goal, last)
    else:
        points = _shortest(space, start, goal, last)
    if points is None:
        raise NoPath(
            f"no path leads from {_text(start_xy)} to {_text(goal_xy)} for a radius of "
            f"{space.settings.robot_radius:g} m; {why_no_path(space, first, last)}"
        )
    meters = space.grid.origin.apply(points * space.grid.resolution)
    meters[0], meters[-1] = as_point_xy(start_xy), as_point_xy(goal_xy)
    return meters


def length_of(points_xy: NDArray[np.float64]) -> float:
    """Return the length of a polyline, shape (N, 2)."""
    return float(np.hypot(*np.diff(points_xy, axis=0).T).sum())


def _text(point_xy: PointsLike) -> str:
    x, y = as_point_xy(point_xy)
    return f"({x:.2f}, {y:.2f})"


def _cheapest(
    space: FreeSpace, start: tuple[float, float], first: int, goal: tuple[float, float], last: int
) -> NDArray[np.float64] | None:
    """Return the cheapest path in cells, (x, y), shape (N, 2)."""
    cells = cheapest_cells(space.cost, first, last)
    if cells is None:
        return None
    rows, cols = np.divmod(cells, space.grid.width)
    centers = np.column_stack([cols + 0.5, rows + 0.5])
    return straightened(space.cost, np.concatenate([[start], centers, [goal]]))


def _shortest(
    space: FreeSpace, start: tuple[float, float], goal: tuple[float, float], last: int
) -> NDArray[np.float64] | None:
    """Return the shortest path in cells, (x, y), shape (N, 2)."""
    reached = reach(space.strips, space.grid.width, start, goal, last)
    if not np.isfinite(reached.far[last]):
        return None
    best, way = np.inf, [start, goal]
    for root in _roots_near(space, reached, last):
        turns = _turns(space, reached, start, root)
        far = 0.0 if root == SOURCE else float(reached.corner_far[root])
        far += float(np.hypot(*np.subtract(goal, turns[-1])))
        if far < best and np.isfinite(line_cost(space.cost, *turns[-1], *goal)):
            best, way = far, [*turns, goal]
    if best == np.inf:  # the goal is seen from its own cell's center in any case
        row, col = divmod(last, space.grid.width)
        turns = _turns(space, reached, start, int(reached.roots[last]))
        way = [*turns, (col + 0.5, row + 0.5), goal]
    return np.array(way)


def _roots_near(space: FreeSpace, reached: Reached, cell: int) -> list[int]:
    """Return the last corners on the paths to a cell and its neighbors.

    With all corners before these: the cone behind one may be too narrow to hold a cell's center.
    """
    height, width = space.grid.shape
    row, col = divmod(cell, width)
    rows = slice(max(0, row - 2), row + 3)
    cols = slice(max(0, col - 2), col + 3)
    far, roots = (part.reshape(height, width)[rows, cols] for part in (reached.far, reached.roots))
    lines = space.strips.lines
    near = np.arange(lines[max(0, row - 1)], lines[min(height, row + 2) + 1])
    near = near[(np.abs(space.strips.xs[near] - col) <= 2) & np.isfinite(reached.corner_far[near])]
    found = {*roots[np.isfinite(far)].tolist(), *near.tolist()}
    waiting = list(found)
    while waiting:
        if (root := waiting.pop()) == SOURCE:
            continue
        before = int(reached.corner_roots[root])
        if before not in found:
            found.add(before)
            waiting.append(before)
    return sorted(found)


def _turns(
    space: FreeSpace, reached: Reached, start: tuple[float, float], root: int
) -> list[tuple[float, float]]:
    """Return the points of the path from the start to a corner."""
    corners = []
    while root != SOURCE:
        corners.append(root)
        root = int(reached.corner_roots[root])
    strips = space.strips
    for off in (_OFF, 0.0):
        turns = [
            (
                float(strips.xs[i] - off * strips.sides[i]),
                float(strips.ys[i] - off * strips.levels[i]),
            )
            for i in reversed(corners)
        ]
        way = [start, *turns]
        if all(
            np.isfinite(line_cost(space.cost, *one, *other))
            for one, other in itertools.pairwise(way)
        ):
            break
    return way
