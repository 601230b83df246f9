"""What a semantic layer holds at one moment, and the answers to all questions about it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import BoolArray, IntArray, ObjectArray, of_rows
from hypermap.core.object_log import ObjectLog
from hypermap.core.objects import ObjectTable, SemanticObject
from hypermap.core.shapes import as_area, box_of, have_points

Box = tuple[float, float, float, float]  # x0, y0, x1, y1

_NOWHERE = -1
_NO_NAME = -1  # as a code
_ONE_BY_ONE = 16  # points asked at once that are faster one by one
_FEW = 12  # shapes that are not worth preparing an area for
_MANY = 64  # shapes that are worth looking at their boxes first
_ROUNDING = 1 + 1e-9  # more than two distances can differ by rounding


@dataclass(frozen=True, eq=False)
class Snapshot:
    """The first rows of a log, less those that its first changes have ended; never changes.

    Questions answer with rows, which `column` and `object` turn into what is known of them.

    Attributes:
        log: the log.
        count: rows of the log that are seen.
        changes: changes of the log that are seen.
        size: objects that are there.
        next_id: above all ids given so far.
    """

    log: ObjectLog
    count: int
    changes: int
    size: int
    next_id: int

    @classmethod
    def of(cls, table: ObjectTable, next_id: int) -> Snapshot:
        """Return what a layer with these objects holds."""
        return cls(ObjectLog(table), len(table), 0, len(table), next_id)

    def __len__(self) -> int:
        return self.size

    def __reduce__(self) -> tuple[Any, ...]:
        return Snapshot.of, (self.table, self.next_id)  # without what a log has computed

    # The objects

    @cached_property
    def rows(self) -> IntArray:
        """The rows that are there, in the order of the layer, shape (N,)."""
        return self._in_order(self._there(np.arange(self.count)))

    @cached_property
    def table(self) -> ObjectTable:
        """All objects as columns, in the order of the layer."""
        return self.log.table if self.changes == 0 else self.take(self.rows)

    def take(self, rows: IntArray, more: Sequence[SemanticObject] = ()) -> ObjectTable:
        """Return some rows as columns; from `count` on, they are those of more objects."""
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
        """Return one of the columns of an `ObjectTable` that questions need, for some rows."""
        column: NDArray[Any] = getattr(self.log.table, name)
        first = self.log.first
        if self.count == first:
            return of_rows(column, rows)
        is_behind = rows >= first
        values = np.empty((len(rows), *column.shape[1:]), dtype=column.dtype)
        values[~is_behind] = of_rows(column, rows[~is_behind])
        values[is_behind] = of_rows(getattr(self.log.written, name), rows[is_behind] - first)
        return values

    def names(self, rows: IntArray) -> ObjectArray:
        """Return the names of some rows."""
        return np.asarray(self.log.names[self.column("codes", rows)])

    def name(self, row: int) -> str:
        """Return the name of one row."""
        return str(self.log.names[self.log.code(row)])

    def id(self, row: int) -> int:
        """Return the id of one row."""
        first = self.log.first
        return int(self.log.table.ids[row] if row < first else self.log.written.ids[row - first])

    def object(self, row: int) -> SemanticObject:
        """Return one row as an object, with a footprint of its own."""
        log = self.log
        if row < log.first:
            return log.table.object(row)
        return log.written.objects[row - log.first].copy()

    def row_of_id(self, object_id: int) -> int:
        """Return the row of an object; -1 if it is not there."""
        log = self.log
        for row in reversed(log.written_rows_of(object_id)):
            if row < self.count and log.all_ended[row] > self.changes:
                return row
        row = log.table.row_of_id(object_id)
        is_gone = row >= 0 and self.changes > 0 and log.all_ended[row] <= self.changes
        return _NOWHERE if is_gone else row

    # Questions

    def row_at(self, x: float, y: float) -> int:
        """Return the row of the smallest object at a point; -1 if there is none."""
        log, changes = self.log, self.changes
        best = _NOWHERE
        for x0, y0, x1, y1, row in log.grid.near(x, y):
            if not (x0 <= x <= x1 and y0 <= y <= y1):
                continue
            if log.rings.cover(row, x, y) and (changes == 0 or log.all_ended[row] > changes):
                best = row
                break
        return best if self.count == log.first else self._or_written_at(best, x, y)

    def _or_written_at(self, best: int, x: float, y: float) -> int:
        """Return the row of the smallest object behind the table at a point, if below the best."""
        log, written, first = self.log, self.log.written, self.log.first
        least = (math.inf, 0) if best < 0 else (log.table.areas[best], best)
        for at in written.index.at(x, y, self.count - first):
            if log.all_ended[first + at] > self.changes:
                size = written.areas[at], written.places[at]
                if size < least and log.rings.cover(first + at, x, y):
                    best, least = first + at, size
        return best

    def all_rows_at(self, point_xy: NDArray[np.float64]) -> IntArray:
        """Return the rows of all objects at a point of shape (2,), the smallest first.

        The first is that of `row_at`: of equally large ones, that which comes first in the layer.
        """
        rows = self.rows_in(shapely.Point(point_xy))
        return rows[np.argsort(self.column("areas", rows), kind="stable")]

    def rows_at(self, points_xy: NDArray[np.float64]) -> IntArray:
        """Return the row of the smallest object at each point, (N, 2); -1 where there is none."""
        if len(points_xy) <= _ONE_BY_ONE:
            return np.array([self.row_at(x, y) for x, y in points_xy.tolist()], dtype=np.int64)
        places, rows = self.log.grid.at_all(points_xy)
        kept = np.flatnonzero(self.log.outlines.cover(rows, of_rows(points_xy, places)))
        places, rows = places[kept], rows[kept]
        first = self.log.first
        if self.count > first:
            written = self.log.written
            there, behind = written.index.at_all(points_xy, self.count - first)
            covered = have_points(written.shapes[behind], of_rows(points_xy, there))
            places = np.concatenate([places, there[covered]])
            rows = np.concatenate([rows, behind[covered] + first])
        if self.changes:
            is_there = self._is_there(rows)
            places, rows = places[is_there], rows[is_there]
        # The smallest of all comes last, and so is what stays.
        order = np.lexsort((self._places(rows), self.column("areas", rows)))[::-1]
        smallest = np.full(len(points_xy), _NOWHERE)
        smallest[places[order]] = rows[order]
        return smallest

    def rows_in(self, area: BaseGeometry, code: int | None = None) -> IntArray:
        """Return the rows of the objects that meet an area, in the order of the layer.

        Args:
            area: in the layer's frame.
            code: only objects with this name's code; None for all.
        """
        log, box = self.log, box_of(area)
        # Of a box, the envelope is a copy, as `as_area` returns it, in a third of the time.
        asked = as_area(area) if box is None else area.envelope
        near = None if box is None else self._near(box)
        if near is not None:
            return self._in_order(np.array(self._few_in(asked, near, code), dtype=np.int64))
        if asked.is_empty:
            return np.empty(0, dtype=np.int64)
        rows = log.tree.query(asked)
        rows.sort()
        if self.count > log.first:
            behind = log.written.index.meeting(*asked.bounds, self.count - log.first)
            rows = np.concatenate([rows, behind + log.first])
        if code is not None:
            rows = rows[self.column("codes", rows) == code]
        rows = self._there(rows)
        return self._in_order(rows[self._meet(asked, box, rows)])

    def _near(self, box: Box) -> list[int] | None:
        """Return the ascending rows whose boxes meet a small one; None if it is not small."""
        log = self.log
        rows = log.grid.meeting(*box)
        if rows is not None and self.count > log.first:
            behind = log.written.index.meeting(*box, self.count - log.first)
            rows += (behind + log.first).tolist()
        return rows

    def _few_in(self, area: BaseGeometry, rows: list[int], code: int | None) -> list[int]:
        """Return which of some rows are there, have a name's code, and meet an area."""
        log = self.log
        if self.changes:
            rows = [row for row in rows if log.all_ended[row] > self.changes]
        if code is not None:
            rows = [row for row in rows if log.code(row) == code]
        return [row for row in rows if area.intersects(log.shape(row))]

    def rows_of_names(self, names: Iterable[str], area: BaseGeometry | None = None) -> IntArray:
        """Return the rows of objects with one of some names, in an area or anywhere, in order."""
        each = [self.rows_of(name, area) for name in dict.fromkeys(names)]
        if len(each) == 1:
            return each[0]
        return self._in_order(np.sort(np.concatenate([np.empty(0, dtype=np.int64), *each])))

    def rows_of(self, what: str | float, area: BaseGeometry | None = None) -> IntArray:
        """Return the rows of the objects with a name or id, in an area or anywhere, in order."""
        if area is not None and isinstance(what, str):
            return self.rows_in(area, self.log.codes.get(what, _NO_NAME))
        if isinstance(what, str):
            return self._in_order(self._there(self._rows_of_name(what)))
        row = self.row_of_id(int(what)) if what == what // 1 else _NOWHERE
        rows = np.array([row] if row >= 0 else [], dtype=np.int64)
        return rows if area is None else np.intersect1d(rows, self.rows_in(area))

    def _rows_of_name(self, name: str) -> IntArray:
        code = self.log.codes.get(name, _NO_NAME)
        rows, first = self.log.table_rows_of(code), self.log.first
        if self.count == first:
            return rows
        behind = np.flatnonzero(self.log.written.codes[: self.count - first] == code)
        return np.concatenate([rows, behind + first])

    def nearest(
        self, what: str | float, point_xy: NDArray[np.float64], k: int
    ) -> tuple[IntArray, NDArray[np.float64]]:
        """Return the k rows with a name or id that are nearest to a point of shape (2,).

        Returns:
            Rows and the distances to their shapes [m], both of shape (K,), nearest first; of
            equally near ones, that with the nearer centroid first.
        """
        rows = self.rows_of(what)
        if len(rows) > max(k, _MANY):
            rows = self._candidates(rows, point_xy, k)
        distances = self._distances(rows, point_xy)
        away = self.column("centroids", rows) - point_xy
        to_centroids = np.hypot(away[:, 0], away[:, 1])
        order = np.lexsort((to_centroids, distances))[:k]
        return rows[order], distances[order]

    def _candidates(self, rows: IntArray, point_xy: NDArray[np.float64], k: int) -> IntArray:
        """Return those of more than k rows that may be among the k nearest.

        They are no farther than the k-th of those whose boxes are the nearest; nor are their boxes.
        """
        x, y = point_xy
        x0, y0, x1, y1 = self.column("boxes", rows).T
        to_boxes = np.hypot(
            np.maximum(0, np.maximum(x0 - x, x - x1)), np.maximum(0, np.maximum(y0 - y, y - y1))
        )
        first = rows[np.argpartition(to_boxes, k - 1)[:k]]
        farthest = self._distances(first, point_xy).max()
        return np.asarray(rows[to_boxes <= farthest * _ROUNDING])

    def _distances(self, rows: IntArray, point_xy: NDArray[np.float64]) -> NDArray[np.float64]:
        shapes, point = self.column("shapes", rows), shapely.points(point_xy)
        with np.errstate(all="ignore"):  # GEOS divides by the lengths of edges without length
            return np.asarray(shapely.distance(shapes, point))

    def _meet(self, area: BaseGeometry, box: Box | None, rows: IntArray) -> BoolArray:
        """Return which rows' shapes meet an area, which their boxes do."""
        if len(rows) < (_FEW if box is None else _MANY):
            return np.asarray(shapely.intersects(area, self.column("shapes", rows)))
        shapely.prepare(area)  # which is a copy that no other thread has
        if box is not None:
            x0, y0, x1, y1 = self.column("boxes", rows).T
            left, low, right, high = box
            meets = (left <= x0) & (x1 <= right) & (low <= y0) & (y1 <= high)
        else:
            meets = rows < self.log.first
            corners = self.log.outlines.first_corners(rows[meets])
            meets[meets] = shapely.intersects_xy(area, corners)
        meets[~meets] = shapely.intersects(area, self.column("shapes", rows[~meets]))
        return np.asarray(meets)

    # Rows

    def _is_there(self, rows: IntArray) -> BoolArray:
        """Return which of some rows no change has ended."""
        if self.changes == 0:
            return np.ones(len(rows), dtype=bool)
        return np.asarray(self.log.ended[rows] > self.changes)

    def _there(self, rows: IntArray) -> IntArray:
        return rows if self.changes == 0 else rows[self._is_there(rows)]

    def _place(self, row: int) -> int:
        first = self.log.first
        return row if row < first else int(self.log.written.places[row - first])

    def _places(self, rows: IntArray) -> IntArray:
        """Return numbers that ascend in the order of the layer."""
        first = self.log.first
        if self.count == first:
            return rows
        places = rows.copy()
        is_behind = rows >= first
        places[is_behind] = self.log.written.places[rows[is_behind] - first]
        return places

    def _in_order(self, rows: IntArray) -> IntArray:
        """Return ascending rows in the order of the layer."""
        if self.count == self.log.first:
            return rows
        return rows[np.argsort(self._places(rows), kind="stable")]

    def has_any(self, names: Iterable[str]) -> bool:
        """Return whether an object has one of the names."""
        return any(len(self.rows_of(name)) for name in names)

    # Changes

    def changed(
        self, gone: Mapping[int, int], new: Sequence[SemanticObject], next_id: int
    ) -> Snapshot:
        """Return what is there after a change; this snapshot stays as it is.

        Args:
            gone: id -> row, of objects that are there.
            new: objects with ids. One with an id that is gone takes that object's place;
                the others come last.
            next_id: as of the snapshot afterwards.
        """
        if not (gone or new):
            return self
        size = self.size + len(new) - len(gone)
        with self.log.writing:
            is_newest = (self.count, self.changes) == (self.log.count, self.log.changes)
            if is_newest and self.log.has_room(len(gone) + len(new)):
                place_of = {number: self._place(row) for number, row in gone.items()}
                places = [place_of.get(x.id or 0, self.count + i) for i, x in enumerate(new)]
                self.log.write(gone.values(), new, places)
                return Snapshot(self.log, self.log.count, self.log.changes, size, next_id)
        return self._merged(gone, new, next_id)

    def _merged(
        self, gone: Mapping[int, int], new: Sequence[SemanticObject], next_id: int
    ) -> Snapshot:
        """Return what is there after a change, in a new log."""
        new_rows = {item.id or 0: self.count + i for i, item in enumerate(new)}
        place_of = np.empty(self.count, dtype=np.int64)
        place_of[self.rows] = np.arange(self.size)
        rows = self.rows.copy()
        for number, row in gone.items():
            rows[place_of[row]] = new_rows.pop(number, _NOWHERE)
        rows = np.concatenate([rows[rows >= 0], np.array([*new_rows.values()], dtype=np.int64)])
        return Snapshot.of(self.take(rows, new), next_id)
