"""Arrays that grow and shrink by rows: the columns of the table of tracks."""

from __future__ import annotations

from typing import Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hypermap.core.arrays import IntArray

Item = TypeVar("Item", bound=np.generic)


class Column(Generic[Item]):
    """An array to which rows are added at the end, each in constant time on the average.

    Attributes:
        values: the rows, to read and to write; outdated when rows come or go.
    """

    def __init__(self, rows: NDArray[Item]) -> None:
        """Begin with some rows, or with none, whose array says what a row is like."""
        self._room = self.values = rows
        self._begin, self._end = 0, len(rows)

    def __len__(self) -> int:
        return self._end - self._begin

    def copy(self) -> Column[Item]:
        """Return a column of the same rows; a change of one does not change the other."""
        return Column(self.values.copy())

    def append(self, row: ArrayLike) -> None:
        """Add a row."""
        if self._end == len(self._room):
            self._grow(1)
        self._room[self._end] = row
        self._end += 1
        self.values = self._room[self._begin : self._end]

    def room_for(self, count: int) -> NDArray[Item]:
        """Return room for so many rows behind the last one, to fill; `extend` adds them."""
        if self._end + count > len(self._room):
            self._grow(count)
        return self._room[self._end : self._end + count]

    def extend(self, count: int) -> None:
        """Add the first rows of the room that `room_for` returned."""
        self._end += count
        self.values = self._room[self._begin : self._end]

    def _grow(self, more: int) -> None:
        count = len(self)
        room = np.empty((max(8, 2 * (count + more)), *self._room.shape[1:]), self._room.dtype)
        room[:count] = self.values
        self._room, self._begin, self._end = room, 0, count

    def keep(self, rows: IntArray) -> None:
        """Keep some rows, in this order, shape (R,)."""
        self._room = self.values = self.values[rows]
        self._begin, self._end = 0, len(self._room)

    def remove_first(self, count: int = 1) -> None:
        """Remove the first rows, in constant time."""
        self._begin += count
        self.values = self._room[self._begin : self._end]
