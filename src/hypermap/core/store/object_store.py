"""The interface of the store: the objects of a layer at one moment, and all queries to them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import IntArray
from hypermap.core.objects import ObjectTable, SemanticObject
from hypermap.core.store import at_points, changes, in_areas, named
from hypermap.core.store.object_log import ObjectLog
from hypermap.core.store.snapshot import Snapshot


@dataclass(frozen=True, eq=False)
class ObjectStore(Snapshot):
    """The objects of a semantic layer at one moment: a `Snapshot` of their change log with queries.

    Immutable: a change makes a new one.

    Queries return rows, shape (M,), or -1 for none; `column` and `object` return what they contain.
    A row is valid for one store only.

    Attributes:
        next_id: above all ids so far.
    """

    next_id: int

    @classmethod
    def of(cls, table: ObjectTable, next_id: int) -> ObjectStore:
        """Return the store of a layer with these objects."""
        return cls(ObjectLog(table), len(table), 0, len(table), next_id)

    def __reduce__(self) -> tuple[Any, ...]:
        return ObjectStore.of, (self.table, self.next_id)  # without the indexes

    # Queries

    at = at_points.smallest_at  # without one more call: the most frequent query

    def at_each(self, points_xy: NDArray[np.float64]) -> IntArray:
        """Return the row of the smallest object at each point, (N, 2); -1 if there is none."""
        return at_points.smallest_at_each(self, points_xy)

    def all_at(self, point_xy: NDArray[np.float64]) -> IntArray:
        """Return the rows of all objects at a point of shape (2,), the smallest first.

        The first is that of `at`; of objects of equal size, the first in the layer.
        """
        return in_areas.all_at(self, point_xy)

    def in_area(self, area: BaseGeometry) -> IntArray:
        """Return the rows of the objects that meet an area, in the order of the layer."""
        return in_areas.meeting(self, area)

    def named(self, what: str | float, area: BaseGeometry | None = None) -> IntArray:
        """Return the rows of the objects with a name or id, in an area or anywhere, in order."""
        return named.having(self, what, area)

    def with_names(self, names: Iterable[str], area: BaseGeometry | None = None) -> IntArray:
        """Return the rows of objects with one of some names, in an area or anywhere, in order."""
        return named.having_any(self, names, area)

    def nearest(
        self, what: str | float, point_xy: NDArray[np.float64], k: int
    ) -> tuple[IntArray, NDArray[np.float64]]:
        """Return the k rows with a name or id that are nearest to a point of shape (2,).

        Returns:
            Rows and the distances to their shapes [m], both of shape (K,), nearest first, ties
            by the distance to the centroid.
        """
        return named.nearest(self, what, point_xy, k)

    # Changes

    def changed(
        self, gone: Mapping[int, int], new: Sequence[SemanticObject], next_id: int
    ) -> ObjectStore:
        """Return the store after a change; this one does not change.

        Args:
            gone: id -> row, of objects that exist.
            new: objects with ids. One with an id that is gone takes that object's place;
                the others come last.
            next_id: of the new store.
        """
        if not (gone or new):
            return self
        size = self.size + len(new) - len(gone)
        return ObjectStore(*changes.written(self, gone, new), size, next_id)
