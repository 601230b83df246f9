"""The change log of a semantic layer; nothing is removed from it.

A log starts with a table. A change appends new rows and marks the rows that it ends. Nothing is
copied, and readers of an earlier snapshot still see the same rows. The capacity of a log is
limited. When it is full, a new log starts with a table of all current objects. So a change is
cheap on average, however many objects there are.
"""

from __future__ import annotations

import threading
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import IntArray, ObjectArray, as_objects, as_view
from hypermap.core.objects import ObjectTable, SemanticObject
from hypermap.core.shapes import valid_copies
from hypermap.core.store.box_grid import BoxGrid
from hypermap.core.store.outlines import Outlines, Rings
from hypermap.core.store.recent_boxes import RecentBoxes
from hypermap.core.tangles import is_sound

_FEWEST = 1024  # rows written or ended before a new log begins
_SHARE = 8  # or one in so many of the table's rows, if that is more
_NEVER = np.iinfo(np.int64).max


@dataclass(frozen=True, eq=False)
class Written:
    """The rows after a log's table as columns, with room for more.

    Attributes:
        objects: as they were given.
        places: in the order of the layer; an object that replaces another has its number.
        ids, codes, shapes, centroids, areas, boxes: as in an `ObjectTable`.
        index: where the boxes are.
    """

    objects: list[SemanticObject]
    places: NDArray[np.int64]
    ids: NDArray[np.int64]
    codes: NDArray[np.int32]
    shapes: ObjectArray
    centroids: NDArray[np.float64]
    areas: NDArray[np.float64]
    boxes: NDArray[np.float64]
    index: RecentBoxes

    @classmethod
    def room(cls, capacity: int, cell: float) -> Written:
        """Return no rows, with room for `capacity`."""
        index = RecentBoxes(capacity, cell)
        return cls(
            [],
            np.empty(capacity, dtype=np.int64),
            np.empty(capacity, dtype=np.int64),
            np.empty(capacity, dtype=np.int32),
            np.empty(capacity, dtype=object),
            np.empty((capacity, 2)),
            np.empty(capacity),
            index.boxes,
            index,
        )


class ObjectLog:
    """A table, and the rows that changes have appended to it.

    Row numbers continue from one to the other. Only `write` changes a log, and other threads may
    read its first rows while it grows.

    Attributes:
        table: the objects with which the log began.
        first: the first row after it.
        writing: held while the log is changed.
        count: rows so far.
        changes: changes begun so far.
    """

    def __init__(self, table: ObjectTable) -> None:
        self.table = table
        self.writing = threading.Lock()
        self.first = self.count = len(table)
        self.changes = 0
        self._room = max(_FEWEST, len(table) // _SHARE)
        self._capacity = self._room
        self._codes = dict(table.vocabulary)
        self._names = as_objects(self._codes)
        self._of_code: dict[int, IntArray] = {}
        self._of_id: dict[int, list[int]] = {}

    # Expensive, so made for the first query or change that needs it

    @cached_property
    def grid(self) -> BoxGrid:
        """The spatial index of the table's shapes."""
        return BoxGrid(self.table.boxes, self.table.areas)

    @cached_property
    def tree(self) -> shapely.STRtree:
        """The same, for areas."""
        return shapely.STRtree(self.table.shapes)

    @cached_property
    def outlines(self) -> Outlines:
        """The outlines of the table's shapes."""
        return Outlines(self.table.shapes)

    @cached_property
    def rings(self) -> Rings:
        """The outlines of all rows, for single points."""
        return Rings(self.shape)

    @cached_property
    def written(self) -> Written:
        """The rows after the table."""
        return Written.room(self._capacity, self.grid.cell)

    @cached_property
    def ended(self) -> NDArray[np.int64]:
        """Which change ended each row, from 1 on, shape (R,); a very large number if none did."""
        return np.full(self.first + self._capacity, _NEVER)

    @cached_property
    def all_ended(self) -> memoryview[int]:
        """The same, several times faster for single rows."""
        return as_view(self.ended)

    # Queries

    @property
    def codes(self) -> Mapping[str, int]:
        """The vocabulary: name -> code."""
        return self._codes

    @property
    def names(self) -> ObjectArray:
        """The names by their codes, shape (V,)."""
        names = self._names  # another thread may set an older array at the same time
        if len(names) != len(self._codes):
            names = self._names = as_objects(list(self._codes))
        return names

    def table_rows_of(self, code: int) -> IntArray:
        """Return the rows of the table that have a name, shape (M,)."""
        if code not in self._of_code:
            self._of_code[code] = np.flatnonzero(self.table.codes == code)
        return self._of_code[code]

    def written_rows_of(self, object_id: int) -> Sequence[int]:
        """Return the rows of an object after the table, the newest last."""
        return self._of_id.get(object_id, ())

    def shape(self, row: int) -> BaseGeometry:
        """Return the shape of one row."""
        columns, at = (self.table, row) if row < self.first else (self.written, row - self.first)
        shape: BaseGeometry = columns.shapes[at]
        return shape

    def code(self, row: int) -> int:
        """Return the code of one row's name."""
        columns, at = (self.table, row) if row < self.first else (self.written, row - self.first)
        return int(columns.codes[at])

    # Changes

    def has_room(self, rows: int) -> bool:
        """Return whether there is room to write or end so many rows."""
        return rows <= self._room

    def write(
        self, ended: Collection[int], items: Sequence[SemanticObject], places: Sequence[int]
    ) -> None:
        """End rows and write others, as one change.

        After a change that is interrupted, as by Ctrl-C, no snapshot is the newest of the log: none
        sees what was written, and the next change begins a new log.

        Args:
            ended: rows that exist.
            items: new objects, with ids.
            places: of each item in the order of the layer.
        """
        shapes = [_valid(item.footprint) for item in items]  # if this fails, nothing is changed
        all_ended = self.all_ended  # before any reader needs it, so that there is only one
        self.changes += 1  # first: from here on, no snapshot is the newest until one is made
        self._room -= len(ended) + len(items)
        for item, shape, place in zip(items, shapes, places, strict=True):
            self._write(len(self.written.objects), item, shape, place)
        for row in ended:
            all_ended[row] = self.changes
        self.count += len(items)

    def _write(self, at: int, item: SemanticObject, shape: BaseGeometry, place: int) -> None:
        written = self.written
        assert item.id is not None  # the layer assigned it
        centroid = shape.centroid
        written.places[at] = place
        written.ids[at] = item.id
        written.codes[at] = self._codes.setdefault(item.name, len(self._codes))
        written.shapes[at] = shape
        written.areas[at] = shape.area
        written.centroids[at, 0], written.centroids[at, 1] = centroid.x, centroid.y
        written.index.put(at, shape.bounds)
        written.objects.append(item)
        self._of_id.setdefault(item.id, []).append(self.first + at)


def _valid(footprint: BaseGeometry) -> BaseGeometry:
    """Return the same as `valid_copies`, for one."""
    if is_sound(footprint):
        return footprint
    shape: BaseGeometry = valid_copies(as_objects([footprint]))[0]
    return shape
