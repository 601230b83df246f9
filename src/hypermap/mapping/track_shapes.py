"""The shapes of all tracks, as columns."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from hypermap._loops import loop
from hypermap.core.arrays import IntArray, ObjectArray, as_objects
from hypermap.mapping.columns import Column
from hypermap.mapping.occlusion import SamplePoints
from hypermap.mapping.prepared_polygon import Box, PreparedPolygon

Rows: TypeAlias = list[int]


class TrackShapes:
    """The shapes of all tracks as columns, for fast rejection by bounding boxes.

    Rows are in the order in which tracks were added; removing one moves later rows up.

    Attributes:
        polygons: the shape of each track in the map frame [m].
    """

    def __init__(self) -> None:
        self.polygons: list[PreparedPolygon] = []
        self._classes = Column(np.empty(0, dtype=np.int64))
        self._boxes = Column(np.empty((0, 4)))
        self._heights = Column(np.empty((0, 2)))
        self._around = Column(np.empty((0, 8, 2)))
        self._xy = Column(np.empty((0, 9, 2)))
        self._widths = Column(np.empty(0))  # NaN until the row is sampled

    def copy(self) -> TrackShapes:
        """Return an independent copy."""
        other = TrackShapes()
        other.polygons = list(self.polygons)
        other._classes = self._classes.copy()
        other._boxes = self._boxes.copy()
        other._heights = self._heights.copy()
        other._around = Column(np.empty_like(self._around.values))  # faster than a copy
        other._xy = Column(np.empty_like(self._xy.values))
        other._widths = Column(np.full(len(self), math.nan))
        return other

    def __len__(self) -> int:
        return len(self.polygons)

    @property
    def classes(self) -> IntArray:
        """A number for the class of each track, int64, shape (N,)."""
        return self._classes.values

    @property
    def boxes(self) -> NDArray[np.float64]:
        """(xmin, ymin, xmax, ymax) of each shape [m], shape (N, 4)."""
        return self._boxes.values

    @property
    def heights(self) -> NDArray[np.float64]:
        """Lowest and highest point of each track [m], float64, shape (N, 2); writable."""
        return self._heights.values

    def geometries(self, rows: Sequence[int]) -> ObjectArray:
        """Return the shapely geometries of some rows, shape (R,)."""
        return as_objects([self.polygons[row].geometry for row in rows])

    def append(
        self, class_: int, shape: PreparedPolygon, heights: tuple[float, float] = (0.0, 0.0)
    ) -> int:
        """Add a shape and return its row."""
        self.polygons.append(shape)
        self._classes.append(class_)
        self._boxes.append(shape.box)
        self._heights.append(heights)
        self._around.append(math.nan)
        self._xy.append(math.nan)
        self._widths.append(math.nan)
        return len(self) - 1

    def replace(self, row: int, shape: PreparedPolygon) -> None:
        """Replace the shape in a row."""
        self.polygons[row] = shape
        self.boxes[row] = shape.box
        self._widths.values[row] = math.nan

    def samples(self, rows: IntArray) -> SamplePoints:
        """Return the sample points of all shapes, of which those in some rows are made first."""
        found = SamplePoints(self._around.values, self._xy.values, self._widths.values)
        for row in rows[np.isnan(found.widths[rows])].tolist():
            found.sample(row, self.polygons[row])
        return found

    def keep(self, rows: IntArray) -> None:
        """Keep some rows, in this order, shape (R,)."""
        for column in (self._classes, self._boxes, self._heights):
            column.keep(rows)
        for samples in (self._around, self._xy, self._widths):
            samples.keep(rows)
        self.polygons = [self.polygons[row] for row in rows.tolist()]

    def near(self, class_: int | None, box: Box) -> Rows:
        """Return the rows whose boxes intersect a box; of one class, or of all with None."""
        found = np.empty(len(self), np.int64)
        count = _meeting(self.boxes, self.classes, -1 if class_ is None else class_, box, found)
        rows: Rows = found[:count].tolist()
        return rows

    def others_near(self, rows: Rows) -> list[tuple[int, int]]:
        """Return pairs of one of some rows, and a row of another class whose box meets its own.

        The second ones are not among the rows.
        """
        chosen, most = np.array(rows, np.int64), len(rows) * len(self)
        found = np.empty((most, 2), np.int64)
        count = _meeting_others(self.boxes, self.classes, chosen, found)
        pairs: list[tuple[int, int]] = list(map(tuple, found[:count].tolist()))
        return pairs

    def within(self, limits: Box, position: NDArray[np.float64], max_range: float) -> Rows:
        """Return the rows whose boxes are within limits, with centers near a place.

        Args:
            limits: xmin, ymin, xmax, ymax [m].
            position: x and y of the place [m], shape (2,).
            max_range: largest distance from the place [m].
        """
        found = np.empty(len(self), np.int64)
        count = _within(self.boxes, limits, (position[0], position[1], max_range), found)
        rows: Rows = found[:count].tolist()
        return rows


@loop()
def _within(
    boxes: NDArray[np.float64], limits: Box, circle: tuple[float, float, float], found: IntArray
) -> int:
    """Find the boxes within limits whose centers are in a circle, and return how many there are.

    Args:
        boxes: as `TrackShapes.boxes`.
        limits: xmin, ymin, xmax, ymax [m].
        circle: x and y of its center, and its radius [m].
        found: filled with their rows, shape (N,).
    """
    count = 0
    for row in range(len(boxes)):
        left, bottom, right, top = boxes[row, 0], boxes[row, 1], boxes[row, 2], boxes[row, 3]
        is_inside = left >= limits[0] and bottom >= limits[1]
        is_inside = is_inside and right <= limits[2] and top <= limits[3]
        dx, dy = (left + right) / 2 - circle[0], (bottom + top) / 2 - circle[1]
        if is_inside and np.hypot(dx, dy) <= circle[2]:
            found[count] = row
            count += 1
    return count


@loop()
def _meeting(
    boxes: NDArray[np.float64], classes: IntArray, class_: int, box: Box, found: IntArray
) -> int:
    """Find the boxes of a class that meet another box, and return how many there are.

    Args:
        boxes: as `TrackShapes.boxes`.
        classes: as `TrackShapes.classes`.
        class_: the number of a class; -1 for all.
        box: xmin, ymin, xmax, ymax [m].
        found: filled with their rows, shape (N,).
    """
    count = 0
    for row in range(len(boxes)):
        meets = boxes[row, 0] <= box[2] and boxes[row, 1] <= box[3]
        meets = meets and boxes[row, 2] >= box[0] and boxes[row, 3] >= box[1]
        if meets and (class_ < 0 or classes[row] == class_):
            found[count] = row
            count += 1
    return count


@loop()
def _meeting_others(
    boxes: NDArray[np.float64], classes: IntArray, rows: IntArray, found: IntArray
) -> int:
    """Find the boxes of other classes that meet those of some rows; return how many pairs.

    Args:
        boxes: as `TrackShapes.boxes`.
        classes: as `TrackShapes.classes`.
        rows: shape (R,).
        found: filled with a row and another one of none of these, shape (R N, 2).
    """
    count = 0
    for row in rows:
        for other in range(len(boxes)):
            meets = boxes[other, 0] <= boxes[row, 2] and boxes[other, 1] <= boxes[row, 3]
            meets = meets and boxes[other, 2] >= boxes[row, 0] and boxes[other, 3] >= boxes[row, 1]
            if meets and classes[other] != classes[row]:
                is_chosen = False
                for one in rows:
                    is_chosen = is_chosen or one == other
                if not is_chosen:
                    found[count, 0], found[count, 1] = row, other
                    count += 1
    return count
