"""The interface of the store: the objects of a layer at one moment, and all queries for them."""

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
    """The objects of a semantic layer at one moment; never changes, a change makes another one.

    Questions answer with rows, -1 for none, which `column` and `object` turn into what is known of
    them. Rows are of one store alone.

    Attributes:
        next_id: above all ids given so far.
    """

    next_id: int

    @classmethod
    def of(cls, table: ObjectTable, next_id: int) -> ObjectStore:
        """Return what a layer with these objects holds."""
        return cls(ObjectLog(table), len(table), 0, len(table), next_id)

    def __reduce__(self) -> tuple[Any, ...]:
        return ObjectStore.of, (self.table, self.next_id)  # without what a log has computed

    # Questions

    at = at_points.smallest_at  # as it is, without one more call: this is asked most

    def at_each(self, points_xy: NDArray[np.float64]) -> IntArray:
        """Return the row of the smallest object at each point, (N, 2); -1 where there is none."""
        return at_points.smallest_at_each(self, points_xy)

    def all_at(self, point_xy: NDArray[np.float64]) -> IntArray:
        """Return the rows of all objects at a point of shape (2,), the smallest first.

        The first is that of `at`: of equally large ones, that which comes first in the layer.
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
            Rows and the distances to their shapes [m], both of shape (K,), nearest first; of
            equally near ones, that with the nearer centroid first.
        """
        return named.nearest(self, what, point_xy, k)

    # Changes

    def changed(
        self, gone: Mapping[int, int], new: Sequence[SemanticObject], next_id: int
    ) -> ObjectStore:
        """Return what is there after a change; this store stays as it is.

        Args:
            gone: id -> row, of objects that are there.
            new: objects with ids. One with an id that is gone takes that object's place;
                the others come last.
            next_id: as of the store afterwards.
        """
        if not (gone or new):
            return self
        size = self.size + len(new) - len(gone)
        return ObjectStore(*changes.written(self, gone, new), size, next_id)
