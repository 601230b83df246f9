"""Which of many boxes are where: grids of several cell sizes, each box in the one that fits it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import IntArray, as_view
from hypermap.core.outlines import ranges

_FINER = 4  # a grid's cells are so many times as wide as those of the next finer one
_MOST_LEVELS = 32
_FEW = 32  # boxes that are looked at one by one
_MANY = 0.25  # of all boxes; for so many it is faster to look at all
_AT_ONCE = 2**13  # points looked up in one go, so that they stay in the processor's cache


@dataclass(frozen=True, eq=False)
class _Level:
    """A grid, and the boxes that meet each of its cells.

    What lies off the grid counts to the nearest cell, so that one box far away costs nothing.

    Attributes:
        x: of the corner of cell (0, 0) [m].
        y: the same.
        per_metre: cells per metre.
        width: cells along x.
        height: cells along y.
        starts: where the rows of each cell begin in `rows`, and the end of the last one.
        rows: of the boxes, cell by cell.
        all_starts: `starts` for Python loops, which are faster over it.
        all_rows: the same of `rows`.
    """

    x: float
    y: float
    per_metre: float
    width: int
    height: int
    starts: IntArray
    rows: IntArray
    all_starts: memoryview[int]
    all_rows: memoryview[int]

    @classmethod
    def of(
        cls, boxes: NDArray[np.float64], rows: IntArray, extent: tuple[float, ...], cell: float
    ) -> _Level:
        x, y = extent[0], extent[1]
        width, height = (
            max(1, math.ceil((extent[axis + 2] - extent[axis]) / cell)) for axis in (0, 1)
        )
        nothing = np.zeros(1, dtype=np.int32)
        none = as_view(nothing)
        empty = cls(x, y, 1 / cell, width, height, nothing, nothing, none, none)
        columns = empty.columns_of(boxes[:, 0]), empty.columns_of(boxes[:, 2])
        lines = empty.lines_of(boxes[:, 1]), empty.lines_of(boxes[:, 3])
        across, up = columns[1] - columns[0] + 1, lines[1] - lines[0] + 1
        # Each box takes so many lines of cells, and each of these so many cells.
        line_of = ranges(lines[0], up)
        first_cell = line_of * width + np.repeat(columns[0], up)
        cells = ranges(first_cell, np.repeat(across, up))
        owners = np.repeat(rows, across * up)
        order = np.argsort(cells, kind="stable")
        counts = np.bincount(cells, minlength=width * height)
        starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        sorted_rows = owners[order].astype(np.int64)
        views = as_view(starts), as_view(sorted_rows)
        return cls(x, y, 1 / cell, width, height, starts, sorted_rows, *views)

    def columns_of(self, x: NDArray[np.float64]) -> IntArray:
        """Return the cells of coordinates along x."""
        return np.clip((x - self.x) * self.per_metre, 0, self.width - 1).astype(np.int64)

    def lines_of(self, y: NDArray[np.float64]) -> IntArray:
        """Return the cells of coordinates along y."""
        return np.clip((y - self.y) * self.per_metre, 0, self.height - 1).astype(np.int64)


class BoxGrid:
    """Finds boxes by place; made once and never changed.

    A box lies in the finest grid whose cells are at least as wide as it, so in four cells at
    most; all boxes of a map with millions of cups and some halls are found as fast.

    Attributes:
        cell: width of the finest grid's cells [m].
    """

    def __init__(self, boxes: NDArray[np.float64]) -> None:
        """Sort boxes, shape (N, 4): x0, y0, x1, y1 [m], into grids."""
        self._boxes = boxes
        self._sides = np.ascontiguousarray(boxes.T)
        self._all_boxes = as_view(boxes.ravel())
        self._levels: list[_Level] = []
        self.cell = 1.0
        if len(boxes):
            self._sort(boxes)
        self._for_one = [
            (g.x, g.y, g.per_metre, g.width, g.height, g.all_starts, g.all_rows)
            for g in self._levels
        ]

    def _sort(self, boxes: NDArray[np.float64]) -> None:
        """Make the grids."""
        sizes = np.maximum(boxes[:, 2] - boxes[:, 0], boxes[:, 3] - boxes[:, 1])
        extent = _extent_of_most(boxes)
        span = max(extent[2] - extent[0], extent[3] - extent[1])
        spacing = math.sqrt((extent[2] - extent[0]) * (extent[3] - extent[1]) / len(boxes))
        # The last bound keeps the grid small where all boxes lie in a line.
        cell = self.cell = max(float(np.median(sizes)), spacing, span / len(boxes), 1e-6)
        fitting = np.ceil(np.log(np.maximum(sizes, cell) / cell) / math.log(_FINER))
        level_of = np.minimum(fitting, _MOST_LEVELS).astype(np.int64)
        for level in np.unique(level_of).tolist():
            rows = np.flatnonzero(level_of == level)
            self._levels.append(_Level.of(boxes[rows], rows, extent, cell * _FINER**level))

    def at(self, x: float, y: float) -> list[int]:
        """Return the rows of the boxes at one point, in any order; far faster than `at_all`."""
        found = []
        boxes = self._all_boxes
        for left, low, per_metre, width, height, starts, rows in self._for_one:
            column, line = (x - left) * per_metre, (y - low) * per_metre
            cell = int(column) if 0 < column < width else (0 if column <= 0 else width - 1)
            cell += width * (int(line) if 0 < line < height else (0 if line <= 0 else height - 1))
            begin, end = starts[cell], starts[cell + 1]
            while begin < end:
                row = rows[begin]
                k = 4 * row
                if boxes[k] <= x <= boxes[k + 2] and boxes[k + 1] <= y <= boxes[k + 3]:
                    found.append(row)
                begin += 1
        return found

    def at_all(self, points_xy: NDArray[np.float64]) -> tuple[IntArray, IntArray]:
        """Return which of the points, (N, 2), lies in which box: places among them, and rows."""
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
        near = level.rows[ranges(first, counts)]
        asked = np.repeat(np.arange(len(x)), counts)
        # One side after the other: most boxes are out after the first.
        for axis, here in enumerate((x, y)):
            for side, is_within in ((axis, np.less_equal), (axis + 2, np.greater_equal)):
                inside = is_within(self._sides[side][near], here[asked])
                near, asked = near[inside], asked[inside]
        return asked, near

    def meeting(self, x0: float, y0: float, x1: float, y1: float) -> IntArray:
        """Return the rows of the boxes that meet a box, in ascending order."""
        count = len(self._boxes)
        parts, size = [], 0
        for west, south, per_metre, width, height, starts, rows in self._for_one:
            # Written out: four calls for each level would take longer than all the rest.
            column, line = (x0 - west) * per_metre, (y0 - south) * per_metre
            first = int(column) if 0 < column < width else (0 if column <= 0 else width - 1)
            bottom = int(line) if 0 < line < height else (0 if line <= 0 else height - 1)
            column, line = (x1 - west) * per_metre, (y1 - south) * per_metre
            last = int(column) if 0 < column < width else (0 if column <= 0 else width - 1)
            top = int(line) if 0 < line < height else (0 if line <= 0 else height - 1)
            # The cells of one line of the grid lie side by side.
            for cell in range(bottom * width, top * width + 1, width):
                begin, end = starts[cell + first], starts[cell + last + 1]
                if begin < end:
                    parts.append(rows[begin:end])
                    size += end - begin
        if size <= _FEW:
            return self._few_meeting({row for part in parts for row in part}, x0, y0, x1, y1)
        if size > count * _MANY:
            found = np.arange(count)
            left, low, right, high = self._sides
        else:
            found = np.concatenate(parts)
            found.sort()
            is_new = np.ones(size, dtype=bool)  # a box lies in several cells
            np.not_equal(found[1:], found[:-1], out=is_new[1:])
            found = found[is_new]
            left, low, right, high = (side[found] for side in self._sides)
        meets = (left <= x1) & (x0 <= right) & (low <= y1) & (y0 <= high)
        return np.asarray(found[meets])

    def _few_meeting(self, rows: set[int], x0: float, y0: float, x1: float, y1: float) -> IntArray:
        found = []
        boxes = self._all_boxes
        for row in rows:
            k = 4 * row
            if boxes[k] <= x1 and x0 <= boxes[k + 2] and boxes[k + 1] <= y1 and y0 <= boxes[k + 3]:
                found.append(row)
        return np.array(sorted(found), dtype=np.int64)


def _extent_of_most(boxes: NDArray[np.float64]) -> tuple[float, ...]:
    """Return a box around the middles of all boxes but those that lie apart."""
    middles = (boxes[:, :2] + boxes[:, 2:]) / 2
    low, high = np.quantile(middles, (0.01, 0.99), axis=0)
    margin = (high - low) * 0.05
    lowest = np.maximum(low - margin, boxes[:, :2].min(axis=0))
    highest = np.minimum(high + margin, boxes[:, 2:].max(axis=0))
    return (*lowest.tolist(), *highest.tolist())
