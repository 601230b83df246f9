"""The state of a log at one moment: which rows exist, in which order, with which values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray, IntArray, ObjectArray, of_rows
from hypermap.core.objects import ObjectTable, SemanticObject
from hypermap.core.store.object_log import ObjectLog

NOWHERE = -1


@dataclass(frozen=True, eq=False)
class Snapshot:
    """The first rows of a log, without those that its first changes ended; immutable.

    Attributes:
        log: the log.
        count: rows of the log that this snapshot sees.
        changes: changes of the log that this snapshot sees.
        size: number of objects.
    """

    log: ObjectLog
    count: int
    changes: int
    size: int

    def __len__(self) -> int:
        return self.size

    # The content of rows

    @cached_property
    def rows(self) -> IntArray:
        """The rows that exist, in the order of the layer, shape (N,)."""
        return self.in_order(self.there(np.arange(self.count)))

    @cached_property
    def table(self) -> ObjectTable:
        """All objects as columns, in the order of the layer."""
        return self.log.table if self.changes == 0 else self.take(self.rows)

    def take(self, rows: IntArray, more: Sequence[SemanticObject] = ()) -> ObjectTable:
        """Return some rows as columns; rows from `count` on are those of `more`."""
        first = self.log.first
        behind = rows[rows >= first].tolist()
        if not behind:
            return self.log.table.take(rows)
        written = self.log.written.objects if self.count > first else []
        objects = [
            written[row - first] if row < self.count else more[row - self.count] for row in behind
        ]
        return self.log.table.take_with(rows, ObjectTable.of(objects, self.log.codes))

    def column(self, name: str, rows: IntArray) -> NDArray[Any]:
        """Return a column of an `ObjectTable`, for some rows; those of `Written` at once."""
        column: NDArray[Any] = getattr(self.log.table, name)
        first = self.log.first
        if self.count == first:
            return of_rows(column, rows)
        if not hasattr(self.log.written, name):
            return np.asarray(getattr(self.take(rows), name))
        is_behind = rows >= first
        values = np.empty((len(rows), *column.shape[1:]), dtype=column.dtype)
        values[~is_behind] = of_rows(column, rows[~is_behind])
        values[is_behind] = of_rows(getattr(self.log.written, name), rows[is_behind] - first)
        return values

    def names(self, rows: IntArray) -> ObjectArray:
        """Return the names of some rows, shape (N,)."""
        return np.asarray(self.log.names[self.column("codes", rows)])

    def name(self, row: int) -> str:
        """Return the name of one row."""
        return str(self.log.names[self.log.code(row)])

    def id(self, row: int) -> int:
        """Return the id of one row."""
        first = self.log.first
        return int(self.log.table.ids[row] if row < first else self.log.written.ids[row - first])

    def object(self, row: int) -> SemanticObject:
        """Return one row as an object, with a copy of its footprint."""
        log = self.log
        if row < log.first:
            return log.table.object(row)
        return log.written.objects[row - log.first].copy()

    def row_of_id(self, object_id: int) -> int:
        """Return the row of an object; -1 if it does not exist."""
        log = self.log
        for row in reversed(log.written_rows_of(object_id)):
            if row < self.count and log.all_ended[row] > self.changes:
                return row
        row = log.table.row_of_id(object_id)
        is_gone = row >= 0 and self.changes > 0 and log.all_ended[row] <= self.changes
        return NOWHERE if is_gone else row

    # Which rows exist, and in which order

    def is_there(self, rows: IntArray) -> BoolArray:
        """Return which of some rows no change has ended, shape (N,)."""
        if self.changes == 0:
            return np.ones(len(rows), dtype=bool)
        return np.asarray(self.log.ended[rows] > self.changes)

    def there(self, rows: IntArray) -> IntArray:
        """Return the rows, of some, that no change has ended."""
        return rows if self.changes == 0 else rows[self.is_there(rows)]

    def place(self, row: int) -> int:
        """Return a number that ascends in the order of the layer."""
        first = self.log.first
        return row if row < first else int(self.log.written.places[row - first])

    def places(self, rows: IntArray) -> IntArray:
        """Return numbers that ascend in the order of the layer."""
        first = self.log.first
        if self.count == first:
            return rows
        places = rows.copy()
        is_behind = rows >= first
        places[is_behind] = self.log.written.places[rows[is_behind] - first]
        return places

    def in_order(self, rows: IntArray) -> IntArray:
        """Return ascending rows in the order of the layer."""
        if self.count == self.log.first:
            return rows
        return rows[np.argsort(self.places(rows), kind="stable")]
