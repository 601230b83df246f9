"""Which shapes are where: a tree over those that have settled, and a small one for the rest."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.core.arrays import IntArray, ObjectArray


@dataclass(frozen=True, eq=False)
class _Part:
    """A tree, and for each of its shapes the row that it stands for; -1 where it is gone."""

    tree: shapely.STRtree
    rows: IntArray

    @classmethod
    def of(cls, shapes: ObjectArray, rows: IntArray) -> _Part:
        return cls(shapely.STRtree(shapes[rows]), rows)


class ShapeIndex:
    """Finds the rows of a column of shapes by place.

    It is never changed: `after` returns the index of the changed column. A change rebuilds only
    the small tree of what was added since the large one was built, until that has grown.
    """

    def __init__(self, settled: _Part, recent: _Part) -> None:
        self._settled = settled
        self._recent = recent

    @classmethod
    def over(cls, shapes: ObjectArray) -> ShapeIndex:
        """Return an index in which all shapes, shape (N,), have settled."""
        rows = np.arange(len(shapes))
        return cls(_Part.of(shapes, rows), _Part.of(shapes, rows[:0]))

    def hits(self, geometries: ObjectArray) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return which of the geometries, shape (N,), meets which row, sorted by both.

        Touching is meeting.

        Returns:
            Positions among the geometries and rows, both of shape (M,).
        """
        first, *others = [part for part in (self._settled, self._recent) if len(part.rows)] or [
            self._settled
        ]
        queries, rows = self._hits_in(first, geometries)
        for part in others:  # a point is asked for so often that copies would show
            more = self._hits_in(part, geometries)
            queries, rows = np.append(queries, more[0]), np.append(rows, more[1])
        order = np.lexsort((rows, queries))
        return queries[order], rows[order]

    def after(self, shapes: ObjectArray, moved_to: IntArray, fresh: IntArray) -> ShapeIndex:
        """Return the index of the column as it is after a change.

        Args:
            shapes: the changed column.
            moved_to: for each row of the column before, its row now; -1 if it is gone.
            fresh: rows of the changed column that were not in it before.
        """
        settled = _moved(self._settled.rows, moved_to)
        recent = _moved(self._recent.rows, moved_to)
        recent = np.concatenate([recent[recent >= 0], fresh])
        unsettled = len(recent) + np.count_nonzero(settled < 0)
        if unsettled > max(64, 4 * math.isqrt(len(shapes))):
            return ShapeIndex.over(shapes)
        return ShapeIndex(_Part(self._settled.tree, settled), _Part.of(shapes, recent))

    @staticmethod
    def _hits_in(
        part: _Part, geometries: ObjectArray
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        queries, items = part.tree.query(geometries, predicate="intersects")
        rows = part.rows[items]
        here = rows >= 0
        return queries[here], rows[here]


def _moved(rows: IntArray, moved_to: IntArray) -> IntArray:
    """Return where rows went; -1 for those that are gone."""
    return np.append(moved_to, -1)[rows]
