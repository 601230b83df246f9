"""A spatial index of boxes added one by one: a sparse grid that only grows."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import IntArray, as_view, of_rows
from hypermap.core.store.box_grid import BoxGrid

_FINER = 4  # as in a BoxGrid
_FEW_CELLS = 9  # up to so many are searched one by one
_FEWER = 6  # a grid of all boxes is worth it from one point per so many boxes on
_FAR = 1e12  # meters; points beyond are moved there

Cells = dict[tuple[int, int], list[int]]


class RecentBoxes:
    """Finds boxes among the first `count` that were added.

    One thread may add boxes while others search those added before.

    Attributes:
        boxes: x0, y0, x1, y1 of each [m], shape (capacity, 4).
    """

    def __init__(self, capacity: int, cell: float) -> None:
        """Make room for boxes, most of which are about as wide as `cell` [m]."""
        self.boxes = np.zeros((capacity, 4))
        self._all_boxes = as_view(self.boxes.ravel())
        self._cell = cell
        self._levels: list[tuple[float, Cells]] = []  # cells per meter, and positions in cells
        self._level_of: dict[int, Cells] = {}
        self._grid = 0, BoxGrid(self.boxes[:0], self.boxes[:0, 0])

    def put(self, position: int, box: tuple[float, float, float, float]) -> None:
        """Add a box; positions count from 0."""
        x0, y0, x1, y1 = box
        for side, value in enumerate(box, 4 * position):
            self._all_boxes[side] = value
        size = max(x1 - x0, y1 - y0) / self._cell
        level = math.ceil(math.log(size, _FINER)) if size > 1 else 0
        per_meter = 1 / (self._cell * _FINER**level)
        if level not in self._level_of:
            self._level_of[level] = {}
            self._levels.append((per_meter, self._level_of[level]))
        cells = self._level_of[level]
        for column in range(math.floor(x0 * per_meter), math.floor(x1 * per_meter) + 1):
            for line in range(math.floor(y0 * per_meter), math.floor(y1 * per_meter) + 1):
                cells.setdefault((column, line), []).append(position)

    def at(self, x: float, y: float, count: int) -> list[int]:
        """Return the positions below `count` of the boxes at one point, in any order."""
        x, y = min(max(x, -_FAR), _FAR), min(max(y, -_FAR), _FAR)
        found = []
        boxes = self._all_boxes
        for per_meter, cells in self._levels:
            for position in cells.get((math.floor(x * per_meter), math.floor(y * per_meter)), ()):
                if position < count:
                    k = 4 * position
                    if boxes[k] <= x <= boxes[k + 2] and boxes[k + 1] <= y <= boxes[k + 3]:
                        found.append(position)
        return found

    def at_all(self, points_xy: NDArray[np.float64], count: int) -> tuple[IntArray, IntArray]:
        """Return which of the points, (N, 2), is in which box: indices of points, positions."""
        known, grid = self._grid
        if known < count:
            if _FEWER * len(points_xy) < count:
                found = [self.at(x, y, count) for x, y in points_xy.tolist()]
                pairs = [(place, at) for place, each in enumerate(found) for at in each]
                places, positions = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
                return places, positions
            known, grid = self._grid = count, BoxGrid(self.boxes[:count], np.zeros(count))
        places, positions = grid.at_all(points_xy)
        if known == count:
            return places, positions
        was_there = positions < count
        return places[was_there], positions[was_there]

    def meeting(self, x0: float, y0: float, x1: float, y1: float, count: int) -> IntArray:
        """Return the positions below `count` of the boxes that meet a box, in ascending order."""
        cells = self._cells(x0, y0, x1, y1)
        if cells is None:
            boxes, found = self.boxes[:count], np.arange(count)
        else:
            found = np.array(sorted({at for cell in cells for at in cell if at < count}), dtype=int)
            boxes = of_rows(self.boxes, found)
        left, low, right, high = boxes.T
        meets = (left <= x1) & (x0 <= right) & (low <= y1) & (y0 <= high)
        return np.asarray(found[meets])

    def _cells(self, x0: float, y0: float, x1: float, y1: float) -> list[list[int]] | None:
        """Return the boxes of the cells that meet a box; None if there are many cells."""
        found = []
        for per_meter, cells in self._levels:
            columns = range(math.floor(x0 * per_meter), math.floor(x1 * per_meter) + 1)
            lines = range(math.floor(y0 * per_meter), math.floor(y1 * per_meter) + 1)
            if len(columns) * len(lines) > _FEW_CELLS:
                return None
            found += [cells.get((column, line), []) for column in columns for line in lines]
        return found
