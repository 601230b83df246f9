"""The semantic layer: objects with names and shapes."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import IntArray, ObjectArray, as_objects, as_point_xy, as_points_xy
from hypermap.core.errors import ObjectNotFound
from hypermap.core.evidence import EvidenceTable
from hypermap.core.layer import Hits, Layer, ShapesPicture, check_count
from hypermap.core.objects import ObjectTable, SemanticObject
from hypermap.core.shape_index import ShapeIndex
from hypermap.core.shapes import as_area

__all__ = ["EMPTY", "Rejected", "SemanticLayer", "SemanticObject"]

EMPTY = "Empty"  # the label of a place without an object
NO_OBJECT = -1  # the value of such a place


@dataclass(frozen=True)
class Rejected:
    """An entry of a layer's file that could not be read; it is written back as it was.

    Attributes:
        position: its place in the file, from 0, which is the id that it would have had.
        name: its name, if it has one.
        reason: what is wrong with it.
        entry: the entry itself, as parsed.
    """

    position: int
    name: str
    reason: str
    entry: Any


@dataclass(frozen=True, eq=False)
class _State:
    """All that a layer holds at one moment."""

    table: ObjectTable
    next_id: int
    known_index: ShapeIndex | None = None

    @cached_property
    def index(self) -> ShapeIndex:
        """Where the table's shapes are; built when it is first asked for."""
        return self.known_index or ShapeIndex.over(self.table.shapes)


class SemanticLayer(Layer):
    """Objects with names and shapes, kept as columns.

    An object's id stays the same as long as it is in the layer, and is not given out again while
    the layer lives. Where outlines cross themselves, questions are answered by a repaired copy.

    A change makes a new state beside the old one, so each question, also from another thread,
    sees the layer either before a change or after it. One change costs a copy of the columns:
    add many objects in one call.

    Attributes:
        rejected: entries of the layer's file that could not be read.
        kept_evidence: what the objects were made of, where that is known: a table, or a function
            that returns it when it is asked for. It may speak of objects that are gone.

    Raises:
        ValueError: If two objects have the same id.

    >>> cup = SemanticObject("cup", shapely.box(0.4, 0.4, 0.5, 0.5))
    >>> table = SemanticObject("table", shapely.box(0, 0, 2, 1))
    >>> layer = SemanticLayer("semantic", "map", [cup, table])
    >>> layer.label_at([[0.45, 0.45], [1, 0.5], [5, 5]])
    array(['cup', 'table', 'Empty'], dtype=object)
    """

    class_name: ClassVar[str] = "SemanticLayer"

    def __init__(
        self,
        name: str,
        frame_id: str,
        objects: Iterable[SemanticObject] = (),
        settings: Mapping[str, Any] | None = None,
        rejected: Iterable[Rejected] = (),
        evidence: EvidenceTable | Callable[[], EvidenceTable] | None = None,
    ) -> None:
        super().__init__(name, frame_id, settings)
        self.rejected = tuple(rejected)
        self.kept_evidence = evidence
        self._writing = threading.Lock()
        self._state = _State(ObjectTable.of([]), next_id=0)
        self.add(objects)

    @classmethod
    def of_table(
        cls,
        name: str,
        frame_id: str,
        table: ObjectTable,
        settings: Mapping[str, Any] | None = None,
        rejected: Iterable[Rejected] = (),
        evidence: EvidenceTable | Callable[[], EvidenceTable] | None = None,
    ) -> SemanticLayer:
        """Return a layer of objects that are columns already, in a small part of the time.

        Raises:
            ValueError: If the table's `check` does not pass.
        """
        table.check()
        layer = cls(name, frame_id, (), settings, rejected, evidence)
        layer._state = _State(table, next_id=int(table.ids.max(initial=-1)) + 1)
        return layer

    def copy(self) -> SemanticLayer:
        """Return a layer that holds the same; a change of one does not change the other."""
        settings, evidence = self.settings, self.kept_evidence
        other = SemanticLayer(self.name, self.frame_id, (), settings, self.rejected, evidence)
        other._state = self._state
        return other

    # The objects

    def __len__(self) -> int:
        return len(self._state.table)

    @property
    def ids(self) -> NDArray[np.int64]:
        """The objects' ids in the order in which they were added, shape (N,)."""
        return self._state.table.ids

    @property
    def names(self) -> ObjectArray:
        """The objects' names in the order of `ids`, shape (N,)."""
        return self._state.table.names

    @property
    def geometries(self) -> ObjectArray:
        """The objects' footprints as they were given, in the order of `ids`, shape (N,)."""
        return self._state.table.footprints

    @property
    def table(self) -> ObjectTable:
        """All objects as columns; a later change of the layer does not change it."""
        return self._state.table

    @property
    def indexed(self) -> tuple[ObjectTable, ShapeIndex]:
        """All objects as columns, and the index of their shapes; both of the same moment."""
        state = self._state
        return state.table, state.index

    def objects(self) -> list[SemanticObject]:
        """Return all objects in the order in which they were added."""
        table = self._state.table
        return [table.object(row) for row in range(len(table))]

    def get(self, object_id: int) -> SemanticObject:
        """Return the object with that id.

        Raises:
            ObjectNotFound: If there is none.
        """
        table = self._state.table
        return table.object(self._rows(table, [object_id])[0])

    # The evidence behind them

    def evidence(self) -> EvidenceTable | None:
        """Return the evidence for the objects that are there; None where none was kept.

        Raises:
            FormatError: If it is kept in a file that cannot be read.
        """
        kept = self.kept_evidence() if callable(self.kept_evidence) else self.kept_evidence
        return None if kept is None else kept.of(self.ids)

    def evidence_of(self, object_id: int) -> EvidenceTable:
        """Return the evidence for one object; empty where none was kept.

        Raises:
            ObjectNotFound: If there is no such object.
            FormatError: If the evidence is kept in a file that cannot be read.
        """
        self._rows(self._state.table, [object_id])
        kept = self.kept_evidence() if callable(self.kept_evidence) else self.kept_evidence
        return EvidenceTable.empty() if kept is None else kept.of([object_id])

    # Changes

    def add(self, objects: Iterable[SemanticObject]) -> list[int]:
        """Add objects and return their ids; those without one get the next free ones.

        Raises:
            ValueError: If an id is in use already, or there are no more; nothing is added then.
        """
        new = list(objects)
        with self._writing:
            state = self._state
            given = [item.id for item in new if item.id is not None]
            _check_unused(given, state.table, self.name)
            free = max([state.next_id, *(number + 1 for number in given)])
            numbered = []
            for item in new:
                if item.id is None:
                    item, free = replace(item, id=free), free + 1
                numbered.append(item)
            added = ObjectTable.of(numbered, state.table.vocabulary)
            old, table = len(state.table), state.table.followed_by(added)
            rows = np.arange(len(table))
            index = state.index.after(table.shapes, rows[:old], rows[old:])
            self._state = _State(table, free, index)
        return [int(number) for number in added.ids]

    def update(self, object_id: int, item: SemanticObject) -> None:
        """Replace the object with that id; the new one keeps the id.

        Raises:
            ObjectNotFound: If there is none.
            ValueError: If the new object has another id.
        """
        self.update_many({object_id: item})

    def update_many(self, changes: Mapping[int, SemanticObject]) -> None:
        """Replace the objects with these ids; the new ones keep the ids.

        It takes hardly longer than one `update`.

        Raises:
            ObjectNotFound: If one is not there; nothing is changed then.
            ValueError: If a new object has another id; nothing is changed then.
        """
        for object_id, item in changes.items():
            if item.id is not None and item.id != object_id:
                raise ValueError(f"an object keeps its id: {object_id} cannot become {item.id}")
        with self._writing:
            state = self._state
            rows = self._rows(state.table, changes)
            changed = ObjectTable.of(
                [replace(changes[int(i)], id=int(i)) for i in state.table.ids[rows]],
                state.table.vocabulary,
            )
            table = state.table.with_rows(rows, changed)
            moved_to = np.arange(len(table))
            moved_to[rows] = -1
            index = state.index.after(table.shapes, moved_to, rows)
            self._state = replace(state, table=table, known_index=index)

    def remove(self, ids: Iterable[int]) -> None:
        """Remove objects; the others keep their ids.

        Raises:
            ObjectNotFound: If one is not there; nothing is removed then.
        """
        with self._writing:
            state = self._state
            gone = self._rows(state.table, ids)
            keep = np.ones(len(state.table), dtype=bool)
            keep[gone] = False
            table = state.table.without(gone)
            moved_to = np.where(keep, np.cumsum(keep) - 1, -1)
            index = state.index.after(table.shapes, moved_to, np.empty(0, dtype=np.int64))
            self._state = replace(state, table=table, known_index=index)

    # Questions

    def label_at(self, points_xy: ArrayLike) -> ObjectArray:
        """Return the name of the smallest object at each point, shape (N,), or "Empty"."""
        state = self._state
        rows = _smallest_at(state, points_xy)
        labels = np.full(len(rows), EMPTY, dtype=object)
        labels[rows >= 0] = state.table.names[rows[rows >= 0]]
        return labels

    def value_at(self, points_xy: ArrayLike) -> NDArray[np.int64]:
        """Return the id of the smallest object at each point, shape (N,), or -1."""
        state = self._state
        rows = _smallest_at(state, points_xy)
        return np.append(state.table.ids, NO_OBJECT)[rows]

    def labels_in(self, area: BaseGeometry) -> Hits:
        """Return the name and centroid of each object whose shape meets the area."""
        state = self._state
        rows = _meeting(state, area)
        return Hits(state.table.names[rows], state.table.centroids[rows])

    def values_in(self, area: BaseGeometry) -> Hits:
        """Return the id and centroid of each object whose shape meets the area."""
        state = self._state
        rows = _meeting(state, area)
        return Hits(state.table.ids[rows], state.table.centroids[rows])

    def find(self, what: str | float, area: BaseGeometry | None = None) -> NDArray[np.float64]:
        """Return the centroids of the objects with a name or id, shape (M, 2)."""
        state = self._state
        rows = state.table.rows_of(what)
        if area is not None:
            rows = np.intersect1d(rows, _meeting(state, area))
        return state.table.centroids[rows]

    def nearest(
        self, what: str | float, point_xy: ArrayLike, k: int = 1
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the k objects with a name or id that are nearest to a point.

        Returns:
            Centroids (K, 2), and distances (K,) [m] from the point to the shapes, 0 inside;
            nearest first, and of equally near ones that with the nearer centroid first.

        Raises:
            ValueError: If `k` is below 1.
        """
        check_count(k)
        table = self._state.table
        rows, distances = table.nearest(what, as_point_xy(point_xy), k)
        return table.centroids[rows], distances

    def nearest_objects(
        self, what: str | float, point_xy: ArrayLike, k: int = 1
    ) -> tuple[list[SemanticObject], NDArray[np.float64]]:
        """Return what `nearest` returns, with the objects in place of their centroids."""
        check_count(k)
        table = self._state.table
        rows, distances = table.nearest(what, as_point_xy(point_xy), k)
        return [table.object(row) for row in rows], distances

    def extent(self) -> BaseGeometry:
        """Return the rectangle around all objects."""
        table = self._state.table
        if len(table) == 0:
            return shapely.Polygon()
        box: BaseGeometry = shapely.box(*shapely.total_bounds(table.footprints))
        return box

    def picture(self) -> ShapesPicture:
        """Return the footprints, one color per name."""
        table = self._state.table
        return ShapesPicture(table.names, table.footprints)

    def _rows(self, table: ObjectTable, ids: Iterable[int]) -> IntArray:
        """Return the rows of objects in ascending order."""
        wanted = np.array(sorted({int(number) for number in ids}), dtype=np.int64)
        rows = table.rows_of_ids(wanted)
        if (rows < 0).any():
            missing = wanted[rows < 0][0]
            raise ObjectNotFound(f"layer {self.name!r} has no object with id {missing}")
        return np.sort(rows)


def _check_unused(ids: list[int], table: ObjectTable, layer: str) -> None:
    """Raise a ValueError if an id is given twice, or to an object of a layer that has it."""
    numbers, counts = np.unique(np.array(ids, dtype=np.int64), return_counts=True)
    twice = numbers[counts > 1] if (counts > 1).any() else numbers[table.rows_of_ids(numbers) >= 0]
    if len(twice):
        raise ValueError(f"layer {layer!r}: two objects have the id {twice[0]}")


def _smallest_at(state: _State, points_xy: ArrayLike) -> IntArray:
    """Return the row of the smallest object at each point, shape (N,); -1 where there is none."""
    points = as_points_xy(points_xy)
    queries, rows = state.index.hits(np.asarray(shapely.points(points)))
    order = np.lexsort((rows, state.table.areas[rows], queries))
    covered, first = np.unique(queries[order], return_index=True)
    smallest = np.full(len(points), -1, dtype=np.int64)
    smallest[covered] = rows[order][first]
    return smallest


def _meeting(state: _State, area: BaseGeometry) -> IntArray:
    """Return the rows of the objects whose shape meets the area."""
    return state.index.hits(as_objects([as_area(area)]))[1]
