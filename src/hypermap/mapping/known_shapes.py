"""The shapes of all known objects, as columns."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import compress
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from hypermap._loops import loop
from hypermap.core.arrays import BoolArray, IntArray, ObjectArray, as_objects
from hypermap.mapping.columns import Column
from hypermap.mapping.outlines import Box, Outline

Rows: TypeAlias = list[int]

_ANY = -1  # stands for all classes


class KnownShapes:
    """The shapes of all known objects as columns, so that most are ruled out by their boxes.

    Rows are in the order in which objects were added; removing one moves those behind it up.

    Attributes:
        outlines: the shape of each object, in the map frame.
    """

    def __init__(self) -> None:
        self.outlines: list[Outline] = []
        self._classes = Column(np.empty(0, dtype=np.int64))
        self._boxes = Column(np.empty((0, 4)))
        self._heights = Column(np.empty((0, 2)))

    def copy(self) -> KnownShapes:
        """Return the same shapes; a change of one does not change the other."""
        other = KnownShapes()
        other.outlines = list(self.outlines)
        other._classes = self._classes.copy()
        other._boxes = self._boxes.copy()
        other._heights = self._heights.copy()
        return other

    def __len__(self) -> int:
        return len(self.outlines)

    @property
    def classes(self) -> IntArray:
        """A number for the class of each object, int64, shape (N,)."""
        return self._classes.values

    @property
    def boxes(self) -> NDArray[np.float64]:
        """(xmin, ymin, xmax, ymax) of each shape [m], shape (N, 4)."""
        return self._boxes.values

    @property
    def heights(self) -> NDArray[np.float64]:
        """Lowest and highest point of each object [m], shape (N, 2); may be written to."""
        return self._heights.values

    def geometries(self, rows: Sequence[int]) -> ObjectArray:
        """Return the shapely geometries of some rows."""
        return as_objects([self.outlines[row].geometry for row in rows])

    def append(self, class_: int, shape: Outline, heights: tuple[float, float] = (0.0, 0.0)) -> int:
        """Add a shape and return its row."""
        self.outlines.append(shape)
        self._classes.append(class_)
        self._boxes.append(shape.box)
        self._heights.append(heights)
        return len(self) - 1

    def replace(self, row: int, shape: Outline) -> None:
        """Give the object in a row another shape."""
        self.outlines[row] = shape
        self.boxes[row] = shape.box

    def keep(self, wanted: BoolArray) -> None:
        """Remove the rows that are not wanted, shape (N,)."""
        for column in (self._classes, self._boxes, self._heights):
            column.keep(wanted)
        self.outlines = list(compress(self.outlines, wanted))

    def near(self, class_: int | None, box: Box) -> Rows:
        """Return the rows of a class, or of all classes, whose boxes meet a box."""
        rows: Rows = _meeting(
            self.classes, self.boxes, _ANY if class_ is None else class_, *box
        ).tolist()
        return rows

    def within(self, limits: Box, position: NDArray[np.float64], max_range: float) -> Rows:
        """Return the rows whose boxes lie within limits and are centred near a place.

        Args:
            limits: xmin, ymin, xmax, ymax [m].
            position: x and y of the place [m], shape (2,).
            max_range: distance from there [m].
        """
        rows: Rows = _within(
            self.boxes, *limits, float(position[0]), float(position[1]), max_range
        ).tolist()
        return rows


@loop()
def _meeting(
    classes: IntArray,
    boxes: NDArray[np.float64],
    class_: int,
    xmin: float,
    ymin: float,
    xmax: float,
    ymax: float,
) -> NDArray[np.int64]:
    rows = np.empty(len(classes), dtype=np.int64)
    count = 0
    for row in range(len(classes)):
        if (
            (class_ == _ANY or class_ == classes[row])
            and boxes[row, 0] <= xmax
            and boxes[row, 1] <= ymax
            and boxes[row, 2] >= xmin
            and boxes[row, 3] >= ymin
        ):
            rows[count] = row
            count += 1
    return rows[:count]


@loop()
def _within(
    boxes: NDArray[np.float64],
    xmin: float,
    ymin: float,
    xmax: float,
    ymax: float,
    x: float,
    y: float,
    max_range: float,
) -> NDArray[np.int64]:
    rows = np.empty(len(boxes), dtype=np.int64)
    count = 0
    for row in range(len(boxes)):
        left, bottom, right, top = boxes[row, 0], boxes[row, 1], boxes[row, 2], boxes[row, 3]
        is_inside = left >= xmin and bottom >= ymin and right <= xmax and top <= ymax
        if is_inside and np.hypot((left + right) / 2 - x, (bottom + top) / 2 - y) <= max_range:
            rows[count] = row
            count += 1
    return rows[:count]
