"""A lattice over the floor, with links that walls cut."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, diags_array

from hypermap.core.arrays import BoolArray, IntArray
from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry, along
from hypermap.core.occupancy import FREE, OccupancyLayer
from hypermap.values.walls import Walls

_LINK = 0.25  # meters
_BY_WALL = 0.6  # meters


@dataclass(frozen=True, eq=False)
class Lattice:
    """The centers of a grid's cells, linked to their four neighbors.

    Attributes:
        grid: its cells' centers are the nodes, numbered by rows.
        links: pairs of neighboring nodes, shape (L, 2).
        is_open: whether the floor between the two is free all the way, shape (L,).
        is_floor: whether a node lies on free floor, shape (height, width).
        occupancy: where the walls are; None for none.
    """

    grid: GridGeometry
    links: IntArray
    is_open: BoolArray
    is_floor: BoolArray
    occupancy: OccupancyLayer | None = None

    @staticmethod
    def over(grid: GridGeometry, occupancy: OccupancyLayer | None = None) -> Lattice:
        """Return a lattice in the frame of an occupancy layer; without one all links are open."""
        numbers = np.arange(grid.width * grid.height).reshape(grid.shape)
        along_x = np.stack([numbers[:, :-1].ravel(), numbers[:, 1:].ravel()], axis=1)
        along_y = np.stack([numbers[:-1].ravel(), numbers[1:].ravel()], axis=1)
        links = np.concatenate([along_x, along_y])
        centers = grid.centers(*np.divmod(numbers.ravel(), grid.width))
        return Lattice(
            grid,
            links,
            _all_free(occupancy, centers[links[:, 0]], centers[links[:, 1]]),
            floor_cells(grid, occupancy),
            occupancy,
        )

    def laplacian(self, through_walls: float) -> csr_array:
        """Return the weighted graph Laplacian, shape (N, N).

        Args:
            through_walls: weight of a link of 0.25 m that is not open, 0 to 1; that of the others
                is 1. A wall weakens longer links less: it is like some more meters of floor.
        """
        side = self.grid.resolution
        kept = through_walls * side / (through_walls * side + (1 - through_walls) * _LINK)
        weights = np.where(self.is_open, 1.0, kept)
        ends, others = self.links.T
        count = self.grid.width * self.grid.height
        between = coo_array(
            (
                -np.concatenate([weights, weights]),
                (np.concatenate([ends, others]), np.concatenate([others, ends])),
            ),
            shape=(count, count),
        ).tocsr()
        return csr_array(between - diags_array(between.sum(axis=1)))

    @cached_property
    def centers_xy(self) -> NDArray[np.float64]:
        """Places of the nodes, shape (N, 2)."""
        count = self.grid.width * self.grid.height
        return self.grid.centers(*np.divmod(np.arange(count), self.grid.width))

    @cached_property
    def walls(self) -> Walls:
        """The walls around the nodes."""
        return Walls(self.occupancy)

    @cached_property
    def is_by_wall(self) -> BoolArray:
        """Whether a cell that is not free is within `_BY_WALL` of a node, shape (N,)."""
        return np.asarray(self.walls.distances_at(self.centers_xy) < _BY_WALL)

    @cached_property
    def has_walls(self) -> bool:
        """Whether any link is not open."""
        return not bool(self.is_open.all())

    def weights_at(self, points_xy: NDArray[np.float64]) -> csr_array:
        """Return the nodes' interpolation weights for each point, shape (M, N); rows add up to 1.

        A point between four nodes that all see each other takes from all of them (bilinear
        interpolation), another one from the nearest of them that it sees, so that a sample does not
        count on the other side of a wall. Off the grid, the nearest node counts.
        """
        height, width = self.grid.shape
        places = self.grid.positions_at(points_xy) - 0.5
        places = np.clip(places, 0, np.array([height, width]) - 1.0)
        corner = np.minimum(np.floor(places), np.maximum([height - 2, width - 2], 0)).astype(int)
        share = places - corner
        is_parted = ~self._is_clear[corner[:, 0], corner[:, 1]]
        share[is_parted] = self._seen(points_xy[is_parted], corner[is_parted], share[is_parted])
        rows, nodes, weights = [], [], []
        for down, right in ((0, 0), (0, 1), (1, 0), (1, 1)):
            weight = np.abs(1 - down - share[:, 0]) * np.abs(1 - right - share[:, 1])
            some = np.flatnonzero(weight)
            rows.append(some)
            nodes.append((corner[some, 0] + down) * width + corner[some, 1] + right)
            weights.append(weight[some])
        return coo_array(
            (np.concatenate(weights), (np.concatenate(rows), np.concatenate(nodes))),
            shape=(len(points_xy), height * width),
        ).tocsr()

    def _seen(
        self, points_xy: NDArray[np.float64], corner: IntArray, share: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return which of the four nodes around each point it takes from: 0 or 1, shape (M, 2)."""
        best = np.round(share)
        nearest = np.full(len(share), np.inf)
        last = np.array(self.grid.shape) - 1
        for step in ((0, 0), (0, 1), (1, 0), (1, 1)):
            nodes = corner + step
            distances = np.hypot(*(share - step).T)
            nodes_xy = self.grid.centers(*nodes.T)
            is_seen = (nodes <= last).all(axis=1) & _all_free(self.occupancy, points_xy, nodes_xy)
            is_better = is_seen & (distances < nearest)
            best[is_better] = step
            nearest[is_better] = distances[is_better]
        return best

    @cached_property
    def _is_clear(self) -> BoolArray:
        """Whether all links around the square at the upper right of each node are open."""
        height, width = self.grid.shape
        count = height * (width - 1)
        across = np.zeros((height, width), dtype=bool)
        across[:, :-1] = self.is_open[:count].reshape(height, width - 1)
        up = np.zeros((height, width), dtype=bool)
        up[:-1] = self.is_open[count:].reshape(height - 1, width)
        clear = np.zeros((height, width), dtype=bool)
        clear[:-1, :-1] = across[:-1, :-1] & across[1:, :-1] & up[:-1, :-1] & up[:-1, 1:]
        if height == 1:
            clear |= across
        if width == 1:
            clear |= up
        return clear


def floor_cells(grid: GridGeometry, occupancy: OccupancyLayer | None) -> BoolArray:
    """Return which cells have their center on free floor, (height, width); all without a map."""
    centers = grid.centers(*np.divmod(np.arange(grid.width * grid.height), grid.width))
    return _all_free(occupancy, centers, centers).reshape(grid.shape)


def padded_grid(points_xy: NDArray[np.float64], margin: float, resolution: float) -> GridGeometry:
    """Return a grid that has all points, shape (N, 2), and a margin [m] around them."""
    first = np.floor((points_xy.min(axis=0) - margin) / resolution)
    last = np.ceil((points_xy.max(axis=0) + margin) / resolution)
    width, height = np.maximum(last - first, 1).astype(int).tolist()
    x, y = (along(cells, resolution) for cells in first.tolist())
    return GridGeometry(width, height, resolution, Pose2D(x, y))


def _all_free(
    occupancy: OccupancyLayer | None, begins: NDArray[np.float64], ends: NDArray[np.float64]
) -> BoolArray:
    """Return whether all cells between two points are free, for N pairs (N, 2), shape (N,)."""
    if occupancy is None or occupancy.grid is None:
        return np.ones(len(begins), dtype=bool)
    longest = float(np.hypot(*(ends - begins).T).max(initial=0))
    steps = 1 + math.ceil(2 * longest / occupancy.grid.resolution)
    free = np.ones(len(begins), dtype=bool)
    for share in np.linspace(0, 1, steps):
        free &= occupancy.value_at(begins + share * (ends - begins)) == FREE
    return free
