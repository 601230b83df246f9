"""The objects that an evidence map knows: one row each, in the order of their ids."""

from __future__ import annotations

import dataclasses
from bisect import bisect_left
from collections import Counter
from collections.abc import Collection, Sequence
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray
from hypermap.mapping.columns import Column
from hypermap.mapping.known_shapes import KnownShapes, Rows
from hypermap.mapping.pile import Evidence, Pile


@dataclasses.dataclass(eq=False)
class KnownObject:
    """What belongs to one object beside the columns of the table.

    Attributes:
        id: unique among all objects that the table ever held.
        name: its class.
        pile: the evidence for it.
        beside: how many frames showed another object of its class beside it, by that one's id.
        unfused: pieces of evidence that its shape does not know yet.
    """

    id: int
    name: str
    pile: Pile
    beside: Counter[int] = dataclasses.field(default_factory=Counter)
    unfused: int = 0

    def copy(self) -> KnownObject:
        """Return the same; a change of one does not change the other."""
        return KnownObject(self.id, self.name, self.pile.copy(), self.beside.copy(), self.unfused)

    def become(self, other: KnownObject) -> None:
        """Take over all that another one is."""
        vars(self).update(vars(other))


class KnownObjects:
    """A table of objects: a list of what is unlike, and columns for what is computed with.

    Attributes:
        objects: one per row.
        shapes: their shapes, classes and heights.
    """

    def __init__(self, max_existence: float) -> None:
        """Prepare an empty table whose objects' existence never grows above a limit."""
        self.objects: list[KnownObject] = []
        self.shapes = KnownShapes()
        self._existence = Column(np.empty(0))
        self._max_existence = max_existence
        self._next_id = 0

    def copy(self) -> KnownObjects:
        """Return another table of the very same objects; what is in columns is copied."""
        other = KnownObjects(self._max_existence)
        other.objects = list(self.objects)
        other.shapes = self.shapes.copy()
        other._existence = self._existence.copy()
        other._next_id = self._next_id
        return other

    @property
    def existence(self) -> NDArray[np.float64]:
        """How surely each object exists, float64, shape (N,)."""
        return self._existence.values

    def append(self, name: str, class_: int, evidence: Evidence, max_evidence: int) -> int:
        """Add an object in the place of some evidence, but without evidence; return its row."""
        self.objects.append(KnownObject(self._next_id, name, Pile(max_evidence)))
        self._existence.append(0.0)
        self._next_id += 1
        return self.shapes.append(class_, evidence.outline, (evidence.z_min, evidence.z_max))

    def remove(self, rows: Sequence[int]) -> None:
        """Remove some objects; those behind them move up."""
        wanted: BoolArray = np.ones(len(self.objects), dtype=bool)
        wanted[np.asarray(rows)] = False
        for row in sorted(rows, reverse=True):
            del self.objects[row]
        self.shapes.keep(wanted)
        self._existence.keep(wanted)

    def change_existence(self, row: int, by: float) -> None:
        """Change an object's existence, capped; rounded, so that five times 0.2 is 1 exactly."""
        column = self._existence.values
        column[row] = round(min(column.item(row) + by, self._max_existence) * 1e9) / 1e9

    def rows_of(self, ids: Collection[int]) -> Rows:
        """Return the rows of the objects that have some ids, in rising order."""
        rows = []
        for number in sorted(ids):
            row = bisect_left(self.objects, number, key=attrgetter("id"))
            if row < len(self.objects) and self.objects[row].id == number:
                rows.append(row)
        return rows

    def without(self, rows: Rows, ids: Collection[int]) -> Rows:
        """Return those of some rows whose objects have none of some ids."""
        return [row for row in rows if self.objects[row].id not in ids]
