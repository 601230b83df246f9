"""The semantic layer: objects with names and shapes."""

from __future__ import annotations

import operator
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any, ClassVar, overload

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import ObjectArray, PointsLike, as_point_xy, as_points_xy, single_xy
from hypermap.core.embeddings import Embeddings
from hypermap.core.errors import ObjectNotFound
from hypermap.core.evidence import EvidenceTable
from hypermap.core.layer import Hits, Layer, ShapesPicture, check_count
from hypermap.core.objects import ObjectTable, Rejected, SemanticObject
from hypermap.core.pictures import ObjectPicture
from hypermap.core.store import KeptObjects, ObjectStore

__all__ = ["EMPTY", "KeptObjects", "Rejected", "SemanticLayer", "SemanticObject"]

EMPTY = "Empty"  # the label where there is no object
NO_OBJECT = -1  # the value there
_NAMED = 4  # names in a summary


class SemanticLayer(Layer):
    """Objects with names and shapes, kept as columns.

    An object keeps its id while it is in the layer. The id is not reused while the layer
    exists. If an outline crosses itself, queries use a repaired copy.

    A change makes a new snapshot and keeps the old one, so each query, also from another thread,
    sees the layer either before or after a change. Changing one object takes a few
    microseconds on average, however many there are. `table` and `names` are created again after
    each change, so get them once and not in a loop of changes.

    A layer is a collection of its objects: iterate over it, or index it by id.

    Attributes:
        rejected: entries of the layer's file that could not be read.
        kept_evidence: the evidence for the objects, if there is any: a table, or a function that
            returns it on demand. It may include objects that were removed.
        kept_pictures: pictures of the objects, by id, best first. It may include objects that were
            removed.
        kept_embeddings: what encoders made of the objects, for `find_like`; None if none did.

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
        self.kept_pictures: Mapping[int, tuple[ObjectPicture, ...]] = {}
        self.kept_embeddings: Embeddings | None = None
        self._writing = threading.Lock()
        self._now: KeptObjects = ObjectStore.of(ObjectTable.of([]), next_id=0)
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
        next_id: int = 0,
    ) -> SemanticLayer:
        """Return a layer from a table of objects, which is much faster.

        The table must pass its `check`. New objects get ids from `next_id` on, or larger ones.
        """
        layer = cls(name, frame_id, (), settings, rejected, evidence)
        free = max(next_id, int(table.ids.max(initial=-1)) + 1)
        layer._now = ObjectStore.of(table, next_id=free)
        return layer

    def copy(self) -> SemanticLayer:
        """Return an equal layer; changes to one do not affect the other."""
        settings, evidence = self.settings, self.kept_evidence
        other = SemanticLayer(self.name, self.frame_id, (), settings, self.rejected, evidence)
        other.kept_pictures = self.kept_pictures
        other.kept_embeddings = self.kept_embeddings
        other._now = self._now
        return other

    __copy__ = copy

    def with_objects(self, objects: Iterable[SemanticObject]) -> SemanticLayer:
        """Return a layer with other objects, and otherwise the contents of this one.

        Raises:
            ValueError: If two objects have the same id.
        """
        other = self.copy()
        other._now = ObjectStore.of(ObjectTable.of([]), next_id=0)
        other.add(objects)
        return other

    def __getstate__(self) -> dict[str, Any]:
        # A function may not be picklable.
        return vars(self) | {"_writing": None, "kept_evidence": self._evidence_ever()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state, _writing=threading.Lock())

    # The objects

    def __len__(self) -> int:
        return len(self._now)

    def __iter__(self) -> Iterator[SemanticObject]:
        """Yield the objects that exist when iteration begins, in the order of `objects`."""
        return iter(self.objects())

    def __getitem__(self, object_id: int) -> SemanticObject:
        """Return the object with that id; raises like `get`."""
        return self.get(object_id)

    def __contains__(self, item: object) -> bool:
        """Return whether there is an object with that id, or with the id of that object."""
        number = item.id if isinstance(item, SemanticObject) else item
        return isinstance(number, int | np.integer) and self._now.row_of_id(int(number)) >= 0

    @property
    def ids(self) -> NDArray[np.int64]:
        """The objects' ids in the order in which they were added, shape (N,)."""
        now = self._now
        return now.column("ids", now.rows)

    @property
    def next_id(self) -> int:
        """The least id that no object of this layer has had so far."""
        return self._now.next_id

    @property
    def names(self) -> ObjectArray:
        """The objects' names in the order of `ids`, shape (N,)."""
        now = self._now
        return now.names(now.rows)

    @property
    def geometries(self) -> ObjectArray:
        """Copies of the objects' footprints as they were given, in the order of `ids`, shape (N,).

        Created on each access, so that each thread can prepare its own.
        """
        return np.asarray(shapely.force_2d(self._now.table.footprints))

    @property
    def table(self) -> ObjectTable:
        """All objects as columns; later changes to the layer do not affect it."""
        return self._now.table

    @property
    def snapshot(self) -> KeptObjects:
        """The current contents of the layer; later changes to the layer do not affect it."""
        return self._now

    def objects(self) -> list[SemanticObject]:
        """Return all objects in the order in which they were added."""
        now = self._now
        return [now.object(row) for row in now.rows.tolist()]

    def get(self, object_id: int) -> SemanticObject:
        """Return the object with that id; `layer[object_id]` is the same.

        Raises:
            ObjectNotFound: If there is none.
            TypeError: If the id is not an integer.
        """
        now = self._now
        (row,) = self._rows_there(now, [object_id]).values()
        return now.object(row)

    # Their evidence

    def evidence(self) -> EvidenceTable | None:
        """Return the evidence for the current objects; None if there is none.

        Raises:
            FormatError: If it is in a file that cannot be read.
        """
        kept = self._evidence_ever()
        return None if kept is None else kept.of(self.ids)

    def evidence_of(self, object_id: int) -> EvidenceTable:
        """Return the evidence for one object; empty if there is none.

        Raises:
            ObjectNotFound: If there is no such object.
            FormatError: If the evidence is in a file that cannot be read.
        """
        self._rows_there(self._now, [object_id])
        kept = self._evidence_ever()
        return EvidenceTable.empty() if kept is None else kept.of([object_id])

    def _evidence_ever(self) -> EvidenceTable | None:
        """Return the evidence, also that for objects that were removed."""
        return self.kept_evidence() if callable(self.kept_evidence) else self.kept_evidence

    def pictures(self, object_id: int) -> tuple[ObjectPicture, ...]:
        """Return the pictures of one object, best first; may be empty.

        Raises:
            ObjectNotFound: If there is no such object.
        """
        self._rows_there(self._now, [object_id])
        return self.kept_pictures.get(object_id, ())

    def pictures_by_id(self) -> dict[int, tuple[ObjectPicture, ...]]:
        """Return the pictures of all objects that have some, in the order of the layer."""
        kept = dict(self.kept_pictures.items())  # which a store reads all at once
        return {number: kept[number] for number in self.ids.tolist() if kept.get(number)}

    # Changes

    @overload
    def add(self, objects: SemanticObject) -> int: ...

    @overload
    def add(self, objects: Iterable[SemanticObject]) -> list[int]: ...

    def add(self, objects: SemanticObject | Iterable[SemanticObject]) -> int | list[int]:
        """Add one object or several; those without an id get the next free ones.

        Returns:
            The id of one object, or those of several.

        Raises:
            ValueError: If an id is already in use, or no id is left; then nothing is added.
            TypeError: If one is not an object.
        """
        if isinstance(objects, SemanticObject):
            return self.add([objects])[0]
        new = list(objects)
        for item in new:
            _check_object(item)
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
        """Replace the objects with these ids in one change; the new ones keep the ids.

        Raises:
            ObjectNotFound: If one does not exist; then nothing is changed.
            ValueError: If a new object has another id; then nothing is changed.
            TypeError: If one is not an object; then nothing is changed.
        """
        for object_id, item in changes.items():
            _check_object(item)
            if item.id is not None and item.id != object_id:
                raise ValueError(f"an object keeps its id: {object_id} cannot become {item.id}")
        with self._writing:
            now = self._now
            gone = self._rows_there(now, changes)
            new = [changes[number].with_id(number) for number in gone]
            self._now = now.changed(gone, new, now.next_id)

    def rename(self, ids: int | Iterable[int], name: str) -> None:
        """Rename one object or several; they keep their ids, shapes and tags.

        Raises:
            ObjectNotFound: If one does not exist; then nothing is changed.
            TypeError: If an id is not an integer, or the name is not a string; nothing is changed.
        """
        self.update_many({number: replace(self[number], name=name) for number in _as_ids(ids)})

    def remove(self, ids: int | Iterable[int]) -> None:
        """Remove one object or several; the others keep their ids.

        Raises:
            ObjectNotFound: If one does not exist; then nothing is removed.
            TypeError: If one is not an integer; then nothing is removed.
        """
        with self._writing:
            now = self._now
            self._now = now.changed(self._rows_there(now, _as_ids(ids)), [], now.next_id)

    # Queries

    def label_at(self, points_xy: PointsLike) -> ObjectArray:
        """Return the name of the smallest object at each point, shape (N,), or "Empty"."""
        now, single = self._now, single_xy(points_xy)
        if single is not None:
            row = now.at(*single)
            return np.array([EMPTY if row < 0 else now.name(row)], dtype=object)
        rows = now.at_each(as_points_xy(points_xy))
        labels = np.full(len(rows), EMPTY, dtype=object)
        there = np.flatnonzero(rows >= 0)
        labels[there] = now.names(rows[there])
        return labels

    def labels_at(self, point_xy: PointsLike) -> ObjectArray:
        """Return the names of all objects at a point, the smallest first, (M,), or "Empty"."""
        now = self._now
        names = now.names(now.all_at(as_point_xy(point_xy)))
        return names if len(names) else np.array([EMPTY], dtype=object)

    def objects_at(self, point_xy: PointsLike) -> list[SemanticObject]:
        """Return all objects at a point, smallest first: a cup before its table.

        Of objects of equal size, the one added first comes first. So the first is the object of
        `label_at` and `value_at`.
        """
        now = self._now
        return [now.object(row) for row in now.all_at(as_point_xy(point_xy)).tolist()]

    def value_at(self, points_xy: PointsLike) -> NDArray[np.int64]:
        """Return the id of the smallest object at each point, shape (N,), or -1."""
        now, single = self._now, single_xy(points_xy)
        if single is not None:
            row = now.at(*single)
            return np.array([NO_OBJECT if row < 0 else now.id(row)])
        rows = now.at_each(as_points_xy(points_xy))
        values = np.full(len(rows), NO_OBJECT)
        there = np.flatnonzero(rows >= 0)
        values[there] = now.column("ids", rows[there])
        return values

    def labels_in(self, area: BaseGeometry) -> Hits:
        """Return the name and centroid of each object whose shape intersects the area."""
        now = self._now
        rows = now.in_area(area)
        return Hits(now.names(rows), now.column("centroids", rows))

    def values_in(self, area: BaseGeometry) -> Hits:
        """Return the id and centroid of each object whose shape intersects the area."""
        now = self._now
        rows = now.in_area(area)
        return Hits(now.column("ids", rows), now.column("centroids", rows))

    def find(self, what: str | float, area: BaseGeometry | None = None) -> NDArray[np.float64]:
        """Return the centroids of the objects with a name or id, shape (M, 2)."""
        now = self._now
        return now.column("centroids", now.named(what, area))

    def nearest(
        self, what: str | float, point_xy: PointsLike, k: int = 1
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the k objects with a name or id that are nearest to a point.

        Returns:
            Centroids (K, 2), and distances (K,) [m] from the point to the shapes, 0 inside;
            nearest first, ties by the distance to the centroid.

        Raises:
            ValueError: If `k` is below 1.
        """
        check_count(k)
        now = self._now
        rows, distances = now.nearest(what, as_point_xy(point_xy), k)
        return now.column("centroids", rows), distances

    def nearest_objects(
        self, what: str | float, point_xy: PointsLike, k: int = 1
    ) -> tuple[list[SemanticObject], NDArray[np.float64]]:
        """Return the same as `nearest`, with the objects instead of their centroids."""
        check_count(k)
        now = self._now
        rows, distances = now.nearest(what, as_point_xy(point_xy), k)
        return [now.object(row) for row in rows.tolist()], distances

    def summary(self) -> str:
        """Return the number of objects, and their most frequent names."""
        counts = Counter(self.names.tolist())
        named = [
            f"{count} {name if name.isprintable() else repr(name)}"
            for name, count in counts.most_common(_NAMED)
        ]
        named += ["..."] if len(counts) > _NAMED else []
        objects = f"{len(self)} object{'' if len(self) == 1 else 's'}"
        return f"{objects} ({', '.join(named)})" if counts else objects

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

    def _rows_there(self, now: KeptObjects, ids: Iterable[int]) -> dict[int, int]:
        """Return the row of each id, in ascending order of ids.

        Raises:
            ObjectNotFound: If there is no object with one of them.
            TypeError: If one is not an integer.
        """
        numbers = sorted({operator.index(number) for number in ids})
        rows = {number: now.row_of_id(number) for number in numbers}
        for number, row in rows.items():
            if row < 0:
                raise ObjectNotFound(f"layer {self.name!r} has no object with id {number}")
        return rows


def _as_ids(ids: int | Iterable[int]) -> Iterable[int]:
    return ids if isinstance(ids, Iterable) else [ids]


def _check_object(item: object) -> None:
    if not isinstance(item, SemanticObject):
        raise TypeError(f"a layer holds SemanticObjects, got {type(item).__name__}")


def _check_unused(ids: list[int], now: KeptObjects, layer: str) -> None:
    """Raise a ValueError if an id occurs twice, or the layer already has it."""
    counts = Counter(ids)
    for number in sorted(counts):
        if counts[number] > 1 or now.row_of_id(number) >= 0:
            raise ValueError(f"layer {layer!r}: two objects have the id {number}")
