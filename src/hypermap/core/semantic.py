"""The semantic layer: objects with names and shapes."""

from __future__ import annotations

import operator
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import ObjectArray, as_point_xy, as_points_xy, single_xy
from hypermap.core.errors import ObjectNotFound
from hypermap.core.evidence import EvidenceTable
from hypermap.core.layer import Hits, Layer, ShapesPicture, check_count
from hypermap.core.objects import ObjectTable, SemanticObject
from hypermap.core.snapshot import Snapshot

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


class SemanticLayer(Layer):
    """Objects with names and shapes, kept as columns.

    An object's id stays the same as long as it is in the layer, and is not given out again while
    the layer lives. Where outlines cross themselves, questions are answered by a repaired copy.

    A change makes a new snapshot beside the old one, so each question, also from another thread,
    sees the layer either before a change or after it. A change of one object takes some
    microseconds on the average, however many there are; `table` and `names` are made anew after
    each, so ask for them once and not in a loop of changes.

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
        self._now = Snapshot.of(ObjectTable.of([]), next_id=0)
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

        The table must pass its `check`.
        """
        layer = cls(name, frame_id, (), settings, rejected, evidence)
        layer._now = Snapshot.of(table, next_id=int(table.ids.max(initial=-1)) + 1)
        return layer

    def copy(self) -> SemanticLayer:
        """Return a layer that holds the same; a change of one does not change the other."""
        settings, evidence = self.settings, self.kept_evidence
        other = SemanticLayer(self.name, self.frame_id, (), settings, self.rejected, evidence)
        other._now = self._now
        return other

    # The objects

    def __len__(self) -> int:
        return len(self._now)

    @property
    def ids(self) -> NDArray[np.int64]:
        """The objects' ids in the order in which they were added, shape (N,)."""
        now = self._now
        return now.column("ids", now.rows)

    @property
    def names(self) -> ObjectArray:
        """The objects' names in the order of `ids`, shape (N,)."""
        now = self._now
        return now.names(now.rows)

    @property
    def geometries(self) -> ObjectArray:
        """Copies of the objects' footprints as they were given, in the order of `ids`, shape (N,).

        Made anew each time, so that each thread may prepare its own.
        """
        return np.asarray(shapely.force_2d(self._now.table.footprints))

    @property
    def table(self) -> ObjectTable:
        """All objects as columns; a later change of the layer does not change it."""
        return self._now.table

    @property
    def snapshot(self) -> Snapshot:
        """All that the layer holds now; a later change of the layer does not change it."""
        return self._now

    def objects(self) -> list[SemanticObject]:
        """Return all objects in the order in which they were added."""
        now = self._now
        return [now.object(row) for row in now.rows.tolist()]

    def get(self, object_id: int) -> SemanticObject:
        """Return the object with that id.

        Raises:
            ObjectNotFound: If there is none.
            TypeError: If the id is no integer.
        """
        now = self._now
        (row,) = self._rows_there(now, [object_id]).values()
        return now.object(row)

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
        self._rows_there(self._now, [object_id])
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
            now = self._now
            given = [item.id for item in new if item.id is not None]
            if given:
                _check_unused(given, now, self.name)
            free = max([now.next_id, *(number + 1 for number in given)])
            numbered = []
            for item in new:
                if item.id is None:
                    item, free = item.with_id(free), free + 1
                numbered.append(item)
            self._now = now.changed({}, numbered, free)
        return [int(item.id) for item in numbered if item.id is not None]

    def update(self, object_id: int, item: SemanticObject) -> None:
        """Replace the object with that id; the new one keeps the id.

        Raises:
            ObjectNotFound: If there is none.
            ValueError: If the new object has another id.
        """
        self.update_many({object_id: item})

    def update_many(self, changes: Mapping[int, SemanticObject]) -> None:
        """Replace the objects with these ids, as one change; the new ones keep the ids.

        Raises:
            ObjectNotFound: If one is not there; nothing is changed then.
            ValueError: If a new object has another id; nothing is changed then.
        """
        for object_id, item in changes.items():
            if item.id is not None and item.id != object_id:
                raise ValueError(f"an object keeps its id: {object_id} cannot become {item.id}")
        with self._writing:
            now = self._now
            gone = self._rows_there(now, changes)
            new = [changes[number].with_id(number) for number in gone]
            self._now = now.changed(gone, new, now.next_id)

    def remove(self, ids: Iterable[int]) -> None:
        """Remove objects; the others keep their ids.

        Raises:
            ObjectNotFound: If one is not there; nothing is removed then.
            TypeError: If one is no integer; nothing is removed then.
        """
        with self._writing:
            now = self._now
            self._now = now.changed(self._rows_there(now, ids), [], now.next_id)

    # Questions

    def label_at(self, points_xy: ArrayLike) -> ObjectArray:
        """Return the name of the smallest object at each point, shape (N,), or "Empty"."""
        now, single = self._now, single_xy(points_xy)
        if single is not None:
            row = now.row_at(*single)
            return np.array([EMPTY if row < 0 else now.name(row)], dtype=object)
        rows = now.rows_at(as_points_xy(points_xy))
        labels = np.full(len(rows), EMPTY, dtype=object)
        there = np.flatnonzero(rows >= 0)
        labels[there] = now.names(rows[there])
        return labels

    def labels_at(self, point_xy: ArrayLike) -> ObjectArray:
        """Return the names of all objects at a point, the smallest first, (M,), or "Empty"."""
        now = self._now
        names = now.names(now.all_rows_at(as_point_xy(point_xy)))
        return names if len(names) else np.array([EMPTY], dtype=object)

    def objects_at(self, point_xy: ArrayLike) -> list[SemanticObject]:
        """Return all objects at a point, the smallest first, as a cup before its table.

        Of equally large ones, the one that was added first comes first; so the first of all is the
        one that `label_at` and `value_at` tell of.
        """
        now = self._now
        return [now.object(row) for row in now.all_rows_at(as_point_xy(point_xy)).tolist()]

    def value_at(self, points_xy: ArrayLike) -> NDArray[np.int64]:
        """Return the id of the smallest object at each point, shape (N,), or -1."""
        now, single = self._now, single_xy(points_xy)
        if single is not None:
            row = now.row_at(*single)
            return np.array([NO_OBJECT if row < 0 else now.id(row)])
        rows = now.rows_at(as_points_xy(points_xy))
        values = np.full(len(rows), NO_OBJECT)
        there = np.flatnonzero(rows >= 0)
        values[there] = now.column("ids", rows[there])
        return values

    def labels_in(self, area: BaseGeometry) -> Hits:
        """Return the name and centroid of each object whose shape meets the area."""
        now = self._now
        rows = now.rows_in(area)
        return Hits(now.names(rows), now.column("centroids", rows))

    def values_in(self, area: BaseGeometry) -> Hits:
        """Return the id and centroid of each object whose shape meets the area."""
        now = self._now
        rows = now.rows_in(area)
        return Hits(now.column("ids", rows), now.column("centroids", rows))

    def find(self, what: str | float, area: BaseGeometry | None = None) -> NDArray[np.float64]:
        """Return the centroids of the objects with a name or id, shape (M, 2)."""
        now = self._now
        return now.column("centroids", now.rows_of(what, area))

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
        now = self._now
        rows, distances = now.nearest(what, as_point_xy(point_xy), k)
        return now.column("centroids", rows), distances

    def nearest_objects(
        self, what: str | float, point_xy: ArrayLike, k: int = 1
    ) -> tuple[list[SemanticObject], NDArray[np.float64]]:
        """Return what `nearest` returns, with the objects in place of their centroids."""
        check_count(k)
        now = self._now
        rows, distances = now.nearest(what, as_point_xy(point_xy), k)
        return [now.object(row) for row in rows.tolist()], distances

    def extent(self) -> BaseGeometry:
        """Return the rectangle around all objects."""
        table = self._now.table
        if len(table) == 0:
            return shapely.Polygon()
        box: BaseGeometry = shapely.box(*shapely.total_bounds(table.footprints))
        return box

    def picture(self) -> ShapesPicture:
        """Return the footprints, one color per name."""
        table = self._now.table
        return ShapesPicture(table.names, np.asarray(shapely.force_2d(table.footprints)))

    def _rows_there(self, now: Snapshot, ids: Iterable[int]) -> dict[int, int]:
        """Return the row of each id, by ascending ids.

        Raises:
            ObjectNotFound: If there is no object with one of them.
            TypeError: If one is no integer.
        """
        numbers = sorted({operator.index(number) for number in ids})
        rows = {number: now.row_of_id(number) for number in numbers}
        for number, row in rows.items():
            if row < 0:
                raise ObjectNotFound(f"layer {self.name!r} has no object with id {number}")
        return rows


def _check_unused(ids: list[int], now: Snapshot, layer: str) -> None:
    """Raise a ValueError if an id is given twice, or to an object of a layer that has it."""
    counts = Counter(ids)
    for number in sorted(counts):
        if counts[number] > 1 or now.row_of_id(number) >= 0:
            raise ValueError(f"layer {layer!r}: two objects have the id {number}")
