"""The objects that an evidence map knows: one row each, in the order of their ids."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Callable, Collection

import numpy as np
from numpy.typing import NDArray

from hypermap.mapping.association import KnownShapes, Rows
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


class KnownObjects:
    """A table of objects: a list of what is unlike, and columns for what is computed with.

    Attributes:
        objects: one per row.
        shapes: their shapes, classes and heights.
        existence: how surely each of them exists, float64, shape (N,).
    """

    def __init__(self, max_existence: float) -> None:
        """Prepare an empty table whose objects' existence never grows above a limit."""
        self.objects: list[KnownObject] = []
        self.shapes = KnownShapes()
        self.existence = np.empty(0)
        self._max_existence = max_existence
        self._next_id = 0

    def append(self, name: str, class_: int, evidence: Evidence, max_evidence: int) -> int:
        """Add an object in the place of some evidence, but without evidence; return its row."""
        self.objects.append(KnownObject(self._next_id, name, Pile(max_evidence)))
        self.existence = np.append(self.existence, 0.0)
        self._next_id += 1
        return self.shapes.append(class_, evidence.footprint, (evidence.z_min, evidence.z_max))

    def remove(self, rows: Rows) -> None:
        """Remove some objects; those behind them move up."""
        for row in sorted(rows, reverse=True):
            del self.objects[row]
        self.shapes.remove(rows)
        self.existence = np.delete(self.existence, rows)

    def set_existence(self, rows: int | Rows, existence: float | NDArray[np.float64]) -> None:
        """Change existence, capped; rounded, so that five times 0.2 is 1 to the last digit."""
        self.existence[rows] = np.round(np.minimum(existence, self._max_existence), 9)

    def rows_of(self, ids: Collection[int]) -> list[int]:
        """Return the rows of the objects with some ids."""
        return [row for row, known in enumerate(self.objects) if known.id in ids]

    def filter(self, rows: Rows, keep: Callable[[KnownObject], bool]) -> Rows:
        """Return those of some rows whose objects are to be kept."""
        kept = [keep(self.objects[row]) for row in rows]
        return np.asarray(rows[np.array(kept, dtype=bool)])

    def without(self, rows: Rows, ids: Collection[int]) -> Rows:
        """Return those of some rows whose objects have none of some ids."""
        return self.filter(rows, lambda known: known.id not in ids)
