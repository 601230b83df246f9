"""A spatial index of boxes: grids of several cell sizes, each box in the one that fits it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import IntArray, as_view, of_rows
from hypermap.core.store.outlines import ranges

_FINER = 4  # width of a grid's cells over that of the next finer grid
_MOST_LEVELS = 32
_AT_ONCE = 2**13  # points looked up at a time, so that they stay in the CPU cache
_FEW_CELLS = 9  # up to so many are searched one by one
_MOST_KEPT = 2**17  # boxes in cached cells

Near = tuple[float, float, float, float, int]  # a box, and its row


@dataclass(frozen=True, eq=False)
class _Level:
    """A grid, and the boxes that meet each of its cells.

    Boxes outside the grid belong to the nearest cell, so that one box far away costs nothing.

    Attributes:
        x: of the corner of cell (0, 0) [m].
        y: the same.
        per_meter: cells per meter.
        width: cells along x.
        height: cells along y.
        starts: where each cell begins in `rows`, and the end of the last one.
        rows: of the boxes, cell by cell.
        sides: x0, y0, x1, y1 of the boxes, cell by cell, shape (4, R).
    """

    x: float
    y: float
    per_meter: float
    width: int
    height: int
    starts: IntArray
    rows: IntArray
    sides: NDArray[np.float64]

    @classmethod
    def of(
        cls, boxes: NDArray[np.float64], rows: IntArray, extent: tuple[float, ...], cell: float
    ) -> _Level:
        x, y = extent[0], extent[1]
        width, height = (
            max(1, math.ceil((extent[axis + 2] - extent[axis]) / cell)) for axis in (0, 1)
        )
        nothing = np.zeros(1, dtype=np.int64)
        empty = cls(x, y, 1 / cell, width, height, nothing, nothing, boxes)
        columns = empty.columns_of(boxes[:, 0]), empty.columns_of(boxes[:, 2])
        lines = empty.lines_of(boxes[:, 1]), empty.lines_of(boxes[:, 3])
        across, up = columns[1] - columns[0] + 1, lines[1] - lines[0] + 1
        # The rows of cells of each box, and the cells of each of these rows
        line_of, box_of = ranges(lines[0], up)
        cells, part_of = ranges(line_of * width + columns[0][box_of], across[box_of])
        owners = box_of[part_of[np.argsort(cells)]]
        counts = np.bincount(cells, minlength=width * height)
        starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        sides = np.ascontiguousarray(boxes.T).take(owners, axis=1)
        return cls(x, y, 1 / cell, width, height, starts, rows[owners], sides)

    def columns_of(self, x: NDArray[np.float64]) -> IntArray:
        """Return the cells of coordinates along x."""
        return np.clip((x - self.x) * self.per_meter, 0, self.width - 1).astype(np.int64)

    def lines_of(self, y: NDArray[np.float64]) -> IntArray:
        """Return the cells of coordinates along y."""
        return np.clip((y - self.y) * self.per_meter, 0, self.height - 1).astype(np.int64)


class BoxGrid:
    """Finds boxes by points; made once and never changed.

    A box is in the finest grid whose cells are at least as wide as the box, so in at most four
    cells. This stays fast for a map with millions of cups and a few halls.

    Attributes:
        cell: width of the finest grid's cells [m].
    """

    def __init__(self, boxes: NDArray[np.float64], sizes: NDArray[np.float64]) -> None:
        """Sort boxes into grids.

        Args:
            boxes: x0, y0, x1, y1 [m], shape (N, 4).
            sizes: sort key for `near`, shape (N,).
        """
        self._all_boxes = as_view(boxes.ravel())
        self._all_sizes = as_view(sizes)
        self._levels: list[_Level] = []  # the finest one first
        self._for_one: list[tuple[int, int, memoryview[int], memoryview[int]]] = []
        self._finest = 0.0, 0.0, 1.0, 1, 1
        self._near: dict[int, list[Near]] = {}
        self._kept = 0
        self.cell = 1.0
        if len(boxes):
            self._sort(boxes)

    def _sort(self, boxes: NDArray[np.float64]) -> None:
        """Make the grids."""
        sizes = np.maximum(boxes[:, 2] - boxes[:, 0], boxes[:, 3] - boxes[:, 1])
        extent = _extent_of_most(boxes)
        span = max(extent[2] - extent[0], extent[3] - extent[1])
        spacing = math.sqrt((extent[2] - extent[0]) * (extent[3] - extent[1]) / len(boxes))
        # The last bound keeps the grid small if all boxes are in a line.
        cell = self.cell = max(float(np.median(sizes)), spacing, span / len(boxes), 1e-6)
        fitting = np.ceil(np.log(np.maximum(sizes, cell) / cell) / math.log(_FINER))
        level_of = np.minimum(fitting, _MOST_LEVELS).astype(np.int64)
        for level in np.unique(level_of).tolist():
            rows = np.flatnonzero(level_of == level)
            wider = _FINER**level
            grid = _Level.of(of_rows(boxes, rows), rows, extent, cell * wider)
            self._levels.append(grid)
            self._for_one.append((wider, grid.width, as_view(grid.starts), as_view(grid.rows)))
        finest = self._levels[0]  # at least half of the boxes fit its cells
        self._finest = finest.x, finest.y, finest.per_meter, finest.width, finest.height

    def near(self, x: float, y: float) -> list[Near]:
        """Return the boxes that may be at one point, smallest first; the same for a whole cell.

        The list is cached and must not be changed.
        """
        west, south, per_meter, width, height = self._finest
        column, line = (x - west) * per_meter, (y - south) * per_meter
        if not (0 <= column < width and 0 <= line < height):
            column, line = min(max(column, 0), width - 1), min(max(line, 0), height - 1)
        cell = int(line) * width + int(column)
        try:
            return self._near[cell]
        except KeyError:
            return self._look_up(cell)

    def meeting(self, x0: float, y0: float, x1: float, y1: float) -> list[int] | None:
        """Return the rows of the boxes that meet a small box, in ascending order.

        Returns:
            None if the box is not small, or not on the grid.
        """
        west, south, per_meter, width, height = self._finest
        left, right = int((x0 - west) * per_meter), int((x1 - west) * per_meter)
        low, high = int((y0 - south) * per_meter), int((y1 - south) * per_meter)
        if left < 0 or low < 0 or right >= width or high >= height:
            return None
        if (right - left + 1) * (high - low + 1) > _FEW_CELLS:
            return None
        rows = set()
        for first in range(low * width, high * width + 1, width):
            for cell in range(first + left, first + right + 1):
                for a, b, c, d, row in self._near_cell(cell):
                    if a <= x1 and x0 <= c and b <= y1 and y0 <= d:
                        rows.add(row)
        return sorted(rows)

    def _near_cell(self, cell: int) -> list[Near]:
        try:
            return self._near[cell]
        except KeyError:
            return self._look_up(cell)

    def _look_up(self, cell: int) -> list[Near]:
        """Return the boxes near a cell of the finest grid, and cache them."""
        line, column = divmod(cell, self._finest[3])
        found: list[int] = []
        for wider, width, starts, rows in self._for_one:
            # All grids share a corner, and their widths differ by powers of two: no rounding.
            there = (line // wider) * width + column // wider
            found += rows[starts[there] : starts[there + 1]].tolist()
        found.sort()
        found.sort(key=self._all_sizes.__getitem__)
        sides = self._all_boxes
        near = []
        for row in found:
            k = 4 * row
            near.append((sides[k], sides[k + 1], sides[k + 2], sides[k + 3], row))
        self._kept += len(near) + 1
        if self._kept > _MOST_KEPT:
            self._near, self._kept = {}, len(near) + 1
        self._near[cell] = near
        return near

    def at_all(self, points_xy: NDArray[np.float64]) -> tuple[IntArray, IntArray]:
        """Return which of the points, (N, 2), is in which box: indices of points, and rows."""
        found = [(np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64))]
        for start in range(0, len(points_xy), _AT_ONCE):
            x, y = np.ascontiguousarray(points_xy[start : start + _AT_ONCE].T)
            for level in self._levels:
                places, rows = self._at_level(level, x, y)
                found.append((places + start, rows))
        places_of, rows_of = zip(*found, strict=True)
        return np.concatenate(places_of), np.concatenate(rows_of)

    def _at_level(
        self, level: _Level, x: NDArray[np.float64], y: NDArray[np.float64]
    ) -> tuple[IntArray, IntArray]:
        cells = level.lines_of(y) * level.width + level.columns_of(x)
        first = level.starts[cells]
        counts = level.starts[cells + 1] - first
        near, asked = ranges(first, counts)
        for axis, coordinate in enumerate((x, y)):
            here = coordinate[asked]
            inside = level.sides[axis][near] <= here
            inside &= here <= level.sides[axis + 2][near]
            kept = np.flatnonzero(inside)  # several times faster than a mask
            near, asked = near[kept], asked[kept]
        return asked, level.rows[near]


def _extent_of_most(boxes: NDArray[np.float64]) -> tuple[float, ...]:
    """Return a box around the centers of all boxes, outliers excluded."""
    middles = (boxes[:, :2] + boxes[:, 2:]) / 2
    low, high = np.quantile(middles, (0.01, 0.99), axis=0)
    margin = (high - low) * 0.05
    lowest = np.maximum(low - margin, boxes[:, :2].min(axis=0))
    highest = np.minimum(high + margin, boxes[:, 2:].max(axis=0))
    return (*lowest.tolist(), *highest.tolist())
