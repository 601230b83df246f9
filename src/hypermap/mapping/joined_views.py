"""The views of one object as arrays, one behind the other, for compiled loops."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hypermap._loops import loop
from hypermap.core.arrays import IntArray
from hypermap.mapping.columns import Column
from hypermap.mapping.prepared_polygon import Box

if TYPE_CHECKING:
    from hypermap.mapping.evidence_buffer import Evidence

_MARGIN = 0.25  # [m] around a voting grid, so that it may grow a little


class JoinedViews:
    """Arrays that grow by one piece of evidence at a time, and lose the oldest one.

    Whether a cell is in a visible area is decided by edges that cross its row, to its left. Of
    each area, only edges are kept that do so in a box around the object; where consecutive ones
    pass the box on its left, the straight line from the first to the last point does the same.

    Attributes:
        box: the one around the object, in which `near` holds: xmin, ymin, xmax, ymax [m].
    """

    def __init__(self, items: Iterable[Evidence]) -> None:
        self._seen = Column(np.empty((0, 7)))
        self._edges = Column(np.empty((0, 5)))
        self._near = Column(np.empty((0, 5)))
        self._counts = Column(np.empty((0, 2), np.int64))
        items = list(items)
        self.box = _around(items)
        for item in items:
            self.add(item)

    @property
    def seen(self) -> NDArray[np.float64]:
        """`Evidence.seen` of each piece, shape (N, 7)."""
        return self._seen.values

    @property
    def edges(self) -> NDArray[np.float64]:
        """The edges of all footprints, as `PreparedPolygon.edges`, shape (E, 5)."""
        return self._edges.values

    @property
    def near(self) -> NDArray[np.float64]:
        """The edges of all visible areas that matter in `box`, shape (A, 5)."""
        return self._near.values

    @property
    def counts(self) -> IntArray:
        """How many of `edges` and of `near` are of each piece, shape (N, 2).

        The second is -1 if its visible area is empty: it has seen everything.
        """
        return self._counts.values

    def look_at(self, box: Box, items: Iterable[Evidence]) -> None:
        """Let `near` and `counts` hold for another box, and a little around it.

        Args:
            box: xmin, ymin, xmax, ymax [m].
            items: the pieces of evidence that were added and not removed.
        """
        self.box = _with_margin(box)
        self._near = Column(np.empty((0, 5)))
        for row, item in enumerate(items):
            self.counts[row, 1] = self._add_near(item)

    def add(self, item: Evidence) -> None:
        """Add one piece of evidence."""
        edges = item.prepared.edges
        self._edges.room_for(len(edges))[:] = edges
        self._edges.extend(len(edges))
        self._counts.append((len(edges), self._add_near(item)))
        self._seen.append(item.seen)

    def remove_first(self) -> None:
        """Remove the oldest piece."""
        of_footprint, of_area = self.counts[0].tolist()
        self._edges.remove_first(of_footprint)
        self._near.remove_first(max(of_area, 0))
        self._counts.remove_first()
        self._seen.remove_first()

    def _add_near(self, item: Evidence) -> int:
        """Add to `near`, and return the number for `counts`."""
        area = item.prepared_area.edges
        if len(area) == 0:
            return -1
        count = int(_choose_near(area, self.box, self._near.room_for(len(area))))
        self._near.extend(count)
        return count


def _around(items: Sequence[Evidence]) -> Box:
    """Return a box around the footprints of some pieces of evidence, with a margin."""
    if not items:
        return np.inf, np.inf, -np.inf, -np.inf
    left, bottom, right, top = zip(*(item.prepared.box for item in items), strict=True)
    return _with_margin((min(left), min(bottom), max(right), max(top)))


def _with_margin(box: Box) -> Box:
    return box[0] - _MARGIN, box[1] - _MARGIN, box[2] + _MARGIN, box[3] + _MARGIN


@loop()
def _choose_near(edges: NDArray[np.float64], box: Box, chosen: NDArray[np.float64]) -> int:
    """Choose the edges of an area that matter in a box, and return how many there are.

    Args:
        edges: of the area, as `PreparedPolygon.edges`.
        box: xmin, ymin, xmax, ymax [m].
        chosen: filled with them, shape (E, 5).
    """
    count, passes = 0, False  # whether the last one passes on the left
    for e in range(len(edges)):
        x0, y0, x1, y1 = edges[e, 0], edges[e, 1], edges[e, 2], edges[e, 3]
        if min(y0, y1) > box[3] or max(y0, y1) < box[1] or min(x0, x1) > box[2]:
            continue
        passed, passes = passes, max(x0, x1) < box[0]
        goes_on = passed and passes and chosen[count - 1, 4] == edges[e, 4]
        if goes_on and chosen[count - 1, 2] == x0 and chosen[count - 1, 3] == y0:
            chosen[count - 1, 2], chosen[count - 1, 3] = x1, y1
            continue
        for k in range(5):
            chosen[count, k] = edges[e, k]
        count += 1
    return count
