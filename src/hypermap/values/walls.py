"""Walls of an occupancy layer, and how many part two places."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import (
    binary_dilation,
    binary_opening,
    distance_transform_edt,
    find_objects,
    label,
)

from hypermap._loops import loop
from hypermap.core.arrays import BoolArray, IntArray
from hypermap.core.occupancy import FREE, OccupancyLayer

_LEAST = 3.0  # meters; what is shorter is furniture
_DEEP = 0.3  # meters; what is as thick, but shorter than a wall, is furniture before it
_GAP = 0.7  # meters
_NEIGHBORS = np.ones((3, 3), dtype=bool)


class Walls:
    """The walls of an occupancy layer; without one there are none.

    Args:
        occupancy: the layer.
    """

    def __init__(self, occupancy: OccupancyLayer | None) -> None:
        self._occupancy = None if occupancy is None or occupancy.grid is None else occupancy
        self._walls: BoolArray | None = None

    def distances_at(self, points_xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how far it is to a cell that is not free, for each point (N, 2) [m], shape (N,).

        Off the map nothing is free.
        """
        occupancy = self._occupancy
        if occupancy is None or occupancy.grid is None or occupancy.cells is None:
            return np.full(len(points_xy), np.inf)
        is_free = np.pad(occupancy.cells == FREE, 1)
        distances = distance_transform_edt(is_free) * occupancy.grid.resolution
        cells = np.clip(occupancy.grid.cells_at(points_xy) + 1, 0, np.array(is_free.shape) - 1)
        return np.asarray(distances[tuple(cells.T)])

    def between(self, places_xy: NDArray[np.float64], others_xy: NDArray[np.float64]) -> IntArray:
        """Return how many walls part N places from K others, shape (N, K).

        What is less than 0.7 m behind a wall is part of it: its other leaf, or a chair.
        """
        occupancy = self._occupancy
        if occupancy is None or occupancy.grid is None:
            return np.zeros((len(places_xy), len(others_xy)), dtype=np.int64)
        if self._walls is None:
            self._walls = wall_cells(occupancy)
        grid = occupancy.grid
        gap = math.ceil(_GAP / grid.resolution)
        places, others = grid.positions_at(places_xy), grid.positions_at(others_xy)
        count = np.zeros((len(places), len(others)), dtype=np.int64)
        _count(self._walls, places, others, gap, count)
        return count


def wall_cells(occupancy: OccupancyLayer) -> BoolArray:
    """Return which cells are walls: of something long, without the furniture before it.

    Behind a cupboard, the wall goes on straight.

    Args:
        occupancy: a layer with cells.
    """
    assert occupancy.grid is not None
    assert occupancy.cells is not None
    least = _LEAST / occupancy.grid.resolution
    cells = occupancy.cells > FREE
    side = max(2, math.ceil(_DEEP / occupancy.grid.resolution))
    is_thick = binary_opening(cells, np.ones((side, side), dtype=bool))
    furniture = is_thick & ~_long_things(is_thick, least)
    walls = cells & ~furniture
    parts, _ = label(furniture, _NEIGHBORS)
    ends = [_ends(parts, number, walls, box) for number, box in enumerate(find_objects(parts), 1)]
    for first, last in filter(None, ends):
        steps = 2 + int(2 * np.abs(last - first).max())
        walls[tuple(np.round(np.linspace(first, last, steps)).astype(int).T)] = True
    return _long_things(walls, least)


def _ends(
    parts: IntArray, number: int, walls: BoolArray, box: tuple[slice, ...]
) -> tuple[IntArray, IntArray] | None:
    """Return the two wall cells next to a part that are farthest from each other; None for none.

    Args:
        parts: number of the part that each cell belongs to.
        number: of the part.
        walls: which cells are walls.
        box: around the part.
    """
    low = np.array([max(0, side.start - 1) for side in box])
    around = tuple(slice(a, side.stop + 1) for a, side in zip(low, box, strict=True))
    next_to = binary_dilation(parts[around] == number, _NEIGHBORS) & walls[around]
    cells = np.argwhere(next_to) + low
    if len(cells) < 2:
        return None
    distances = np.hypot(*(cells[:, np.newaxis] - cells).transpose(2, 0, 1))
    first, last = np.unravel_index(np.argmax(distances), distances.shape)
    return cells[first], cells[last]


def _long_things(cells: BoolArray, least: float) -> BoolArray:
    """Return which cells are of something that is at least so many cells long."""
    parts, _ = label(cells, _NEIGHBORS)
    is_long = [max(side.stop - side.start for side in box) >= least for box in find_objects(parts)]
    return np.asarray(np.array([False, *is_long])[parts])


@loop()
def _count(
    walls: BoolArray,
    places: NDArray[np.float64],
    others: NDArray[np.float64],
    gap: int,
    count: IntArray,
) -> None:
    """Add to counts how many walls are on the way from each of N places to each of K others.

    Args:
        walls: which cells are walls, shape (height, width).
        places: as row and column, shape (N, 2).
        others: the same, shape (K, 2).
        gap: free steps, each of at most a cell, after which a wall is another one.
        count: shape (N, K).
    """
    height, width = walls.shape
    for i in range(len(places)):
        for j in range(len(others)):
            down, right = places[i, 0] - others[j, 0], places[i, 1] - others[j, 1]
            steps = 1 + int(math.hypot(down, right))
            free = gap + 1
            for step in range(steps + 1):
                row = math.floor(others[j, 0] + down * step / steps)
                col = math.floor(others[j, 1] + right * step / steps)
                if 0 <= row < height and 0 <= col < width and walls[row, col]:
                    count[i, j] += free > gap
                    free = 0
                else:
                    free += 1
