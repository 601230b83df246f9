"""The objects of a layer as a question sees them, answered by the database.

The database finds the objects whose boxes or names are in question, by its indexes; that their
shapes really meet a point or an area is decided here, by the functions that decide it for a map in
memory. So a map gives the same answers from a store as from its file, to the last bit.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import IntArray, ObjectArray, as_objects
from hypermap.core.objects import MAX_ID, ObjectTable, SemanticObject
from hypermap.core.shapes import as_area
from hypermap.fleet.store.database import Database
from hypermap.fleet.store.rows import OBJECT, Row, table_of
from hypermap.fleet.store.tables import SRID

_NOWHERE = -1
_AT_ONCE = 10_000  # points in one question
# Small numbers come as smallint, for which an index of integers by btree_gist is no use.
_NOW = f"SELECT {OBJECT} FROM objects WHERE layer_id = %s::integer AND valid_to IS NULL"
_BOX = f"ST_MakeEnvelope(%s, %s, %s, %s, {SRID})"
_POINT = f"ST_SetSRID(ST_MakePoint(%s, %s), {SRID})"


class Writer(Protocol):
    """What changes the objects of a layer in the store."""

    def __call__(self, gone: Mapping[int, int], new: Sequence[SemanticObject]) -> None:
        """Replace objects, given as id -> the version that the change is of; add the others."""
        ...


class StoredObjects:
    """The objects of a layer that is in a database.

    A row is an object's position in the order of the layer. Each question asks the database once,
    and what it returns is kept here, so an instance is for one question and its answer.
    """

    def __init__(self, database: Database, layer_id: int, write: Writer) -> None:
        self._database = database
        self._layer_id = layer_id
        self._write = write
        self._known: dict[int, Row] = {}  # by position

    def __len__(self) -> int:
        return int(
            self._asked("SELECT count(*) FROM objects WHERE layer_id = %s AND valid_to IS NULL")[0][
                0
            ]
        )

    @property
    def next_id(self) -> int:
        """The least id that no object of the layer has had so far."""
        return int(self._asked("SELECT next_id FROM layers WHERE id = %s")[0][0])

    # The content of rows

    @cached_property
    def rows(self) -> IntArray:
        """The rows of all objects, shape (N,)."""
        return self._found(self._asked(_NOW))

    @cached_property
    def table(self) -> ObjectTable:
        """All objects as columns."""
        return self.take(self.rows)

    def take(self, rows: IntArray) -> ObjectTable:
        """Return some rows, which a question has found, as columns."""
        return table_of([self._known[row] for row in rows.tolist()])

    def column(self, name: str, rows: IntArray) -> NDArray[Any]:
        """Return a column of an `ObjectTable` for some rows."""
        column: NDArray[Any] = getattr(self.take(rows), name)
        return column

    def names(self, rows: IntArray) -> ObjectArray:
        """Return the names of some rows, shape (N,)."""
        return self.take(rows).names

    def name(self, row: int) -> str:
        """Return the name of one row."""
        return str(self._known[row][2])

    def id(self, row: int) -> int:
        """Return the id of one row."""
        return int(self._known[row][1])

    def object(self, row: int) -> SemanticObject:
        """Return one row as an object."""
        return table_of([self._known[row]]).object(0)

    def row_of_id(self, object_id: int) -> int:
        """Return the row of an object; -1 if it does not exist."""
        rows = self.named(object_id)
        return int(rows[0]) if len(rows) else _NOWHERE

    # Questions

    def at(self, x: float, y: float) -> int:
        """Return the row of the smallest object at a point; -1 if there is none."""
        rows = self.all_at(np.array([x, y]))
        return int(rows[0]) if len(rows) else _NOWHERE

    def at_each(self, points_xy: NDArray[np.float64]) -> IntArray:
        """Return the row of the smallest object at each point, (N, 2); -1 if there is none."""
        starts = range(0, len(points_xy), _AT_ONCE)
        parts = [self._at_some(points_xy[start : start + _AT_ONCE]) for start in starts]
        return np.concatenate([np.empty(0, dtype=np.int64), *parts])

    def _at_some(self, points_xy: NDArray[np.float64]) -> IntArray:
        found = self._database.rows(
            f"SELECT asked.number, {OBJECT} FROM unnest(%s::float8[], %s::float8[]) "
            "WITH ORDINALITY AS asked (asked_x, asked_y, number) JOIN objects "
            "ON layer_id = %s::integer AND valid_to IS NULL "
            f"AND shape && ST_SetSRID(ST_MakePoint(asked_x, asked_y), {SRID})",
            *points_xy.T.tolist(),
            self._layer_id,
        )
        rows = self._found([each[1:] for each in found], in_order=False)
        points = np.array([each[0] - 1 for each in found], dtype=np.int64)
        meets = shapely.intersects(shapely.points(points_xy[points]), self._shapes(rows))
        # The smallest comes last, so it overwrites the others.
        order = np.lexsort((rows, self._areas(rows)))[::-1]
        order = order[meets[order]]
        smallest = np.full(len(points_xy), _NOWHERE)
        smallest[points[order]] = rows[order]
        return smallest

    def all_at(self, point_xy: NDArray[np.float64]) -> IntArray:
        """Return the rows of all objects at a point of shape (2,), the smallest first."""
        rows = self._found(self._asked(f"{_NOW} AND shape && {_POINT}", *point_xy.tolist()))
        rows = rows[shapely.intersects(shapely.Point(point_xy), self._shapes(rows))]
        return rows[np.argsort(self._areas(rows), kind="stable")]

    def in_area(self, area: BaseGeometry) -> IntArray:
        """Return the rows of the objects that meet an area, shape (M,)."""
        return self._in_area(area, "")

    def named(self, what: str | float, area: BaseGeometry | None = None) -> IntArray:
        """Return the rows of the objects with a name or id, in an area or anywhere, shape (M,)."""
        if isinstance(what, str):
            return self.with_names([what], area)
        if what != what // 1 or not 0 <= what <= MAX_ID:
            return np.empty(0, dtype=np.int64)
        if area is not None:
            return self._in_area(area, " AND id = %s", int(what))
        return self._found(self._asked(f"{_NOW} AND id = %s", int(what)))

    def with_names(self, names: Iterable[str], area: BaseGeometry | None = None) -> IntArray:
        """Return the rows of objects with one of some names, in an area or anywhere."""
        wanted = [name.replace("\x00", "") for name in names]  # text has no such character
        if area is not None:
            return self._in_area(area, " AND name = ANY (%s)", wanted)
        return self._found(self._asked(f"{_NOW} AND name = ANY (%s)", wanted))

    def nearest(
        self, what: str | float, point_xy: NDArray[np.float64], k: int
    ) -> tuple[IntArray, NDArray[np.float64]]:
        """Return the k rows with a name or id that are nearest to a point of shape (2,).

        Returns:
            Rows and the distances to their shapes [m], both of shape (K,), nearest first, ties
            by the distance to the centroid.
        """
        if isinstance(what, str):
            rows = self._found(
                self._asked(
                    f"{_NOW} AND name = %s ORDER BY shape <-> {_POINT} "
                    "FETCH FIRST %s ROWS WITH TIES",
                    what.replace("\x00", ""),
                    *point_xy.tolist(),
                    k,
                )
            )
        else:
            rows = self.named(what)
        distances = shapely.distance(self._shapes(rows), shapely.Point(point_xy))
        centroids = np.array([self._known[row][6:8] for row in rows.tolist()]).reshape(-1, 2)
        to_centroids = np.hypot(*(centroids - point_xy).T)
        order = np.lexsort((to_centroids, distances))[:k]
        return rows[order], distances[order]

    def _in_area(self, area: BaseGeometry, more: str, *values: Any) -> IntArray:
        """Return the rows of objects that meet an area and a further condition of ours."""
        asked = as_area(area)
        if asked.is_empty:
            return np.empty(0, dtype=np.int64)
        question = f"{_NOW} AND shape && {_BOX}{more}"
        rows = self._found(self._asked(question, *asked.bounds, *values))
        shapely.prepare(asked)
        return rows[shapely.intersects(asked, self._shapes(rows))]

    # Changes

    def changed(
        self,
        gone: Mapping[int, int],
        new: Sequence[SemanticObject],
        next_id: int,  # noqa: ARG002 - the database counts itself
    ) -> StoredObjects:
        """Write a change into the store, and return the objects after it.

        Raises:
            Conflict: If another has changed one of the objects since.
        """
        if gone or new:
            self._write({number: self._known[row][-1] for number, row in gone.items()}, new)
        return StoredObjects(self._database, self._layer_id, self._write)

    def _shapes(self, rows: IntArray) -> ObjectArray:
        """Return the shapes of some rows, without all else of `take`."""
        wkb = as_objects(self._known[row][3] for row in rows.tolist())
        return as_objects(shapely.from_wkb(wkb))

    def _areas(self, rows: IntArray) -> NDArray[np.float64]:
        return np.array([self._known[row][5] for row in rows.tolist()], dtype=float)

    def _asked(self, question: str, *values: Any) -> list[Row]:
        return self._database.rows(question, self._layer_id, *values)

    def _found(self, found: Sequence[Row], *, in_order: bool = True) -> IntArray:
        """Keep rows, and return their positions."""
        positions = np.array([row[0] for row in found], dtype=np.int64)
        self._known.update(zip(positions.tolist(), found, strict=True))
        return np.sort(positions) if in_order else positions
