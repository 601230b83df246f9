"""The shapes of all tracks, as columns."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import compress
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from hypermap._loops import loop
from hypermap.core.arrays import BoolArray, IntArray, ObjectArray, as_objects
from hypermap.mapping.columns import Column
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

    def copy(self) -> TrackShapes:
        """Return an independent copy."""
        other = TrackShapes()
        other.polygons = list(self.polygons)
        other._classes = self._classes.copy()
        other._boxes = self._boxes.copy()
        other._heights = self._heights.copy()
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
        return len(self) - 1

    def replace(self, row: int, shape: PreparedPolygon) -> None:
        """Replace the shape in a row."""
        self.polygons[row] = shape
        self.boxes[row] = shape.box

    def keep(self, wanted: BoolArray) -> None:
        """Remove the rows that are not wanted, shape (N,)."""
        for column in (self._classes, self._boxes, self._heights):
            column.keep(wanted)
        self.polygons = list(compress(self.polygons, wanted))

    def near(self, class_: int | None, box: Box) -> Rows:
        """Return the rows whose boxes intersect a box; of one class, or of all with None."""
        found = np.empty(len(self), np.int64)
        count = _meeting(self.boxes, self.classes, -1 if class_ is None else class_, box, found)
        rows: Rows = found[:count].tolist()
        return rows

    def within(self, limits: Box, position: NDArray[np.float64], max_range: float) -> Rows:
        """Return the rows whose boxes are within limits, with centers near a place.

        Args:
            limits: xmin, ymin, xmax, ymax [m].
            position: x and y of the place [m], shape (2,).
            max_range: largest distance from the place [m].
        """
        xmin, ymin, xmax, ymax = limits
        left, bottom, right, top = self.boxes.T
        is_inside = (left >= xmin) & (bottom >= ymin) & (right <= xmax) & (top <= ymax)
        dx, dy = (left + right) / 2 - position[0], (bottom + top) / 2 - position[1]
        rows: Rows = (is_inside & (np.hypot(dx, dy) <= max_range)).nonzero()[0].tolist()
        return rows


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
