"""The views of one object as arrays, one behind the other, for compiled loops."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hypermap._loops import loop
from hypermap.core.arrays import IntArray
from hypermap.mapping.columns import Column

if TYPE_CHECKING:
    from hypermap.mapping.evidence_buffer import Evidence

NEAR = 0.5
"""How far the voting grid of an object usually is beyond each of its footprints, at most [m]."""


class JoinedViews:
    """Arrays that grow by one piece of evidence at a time, and lose the oldest one.

    Whether a cell is in a visible area is decided by edges that cross its row, to its left. Of
    each area, those edges are left out that do so for no cell within `NEAR` of the footprint's box.
    """

    def __init__(self, items: Iterable[Evidence]) -> None:
        self._seen = Column(np.empty((0, 7)))
        self._edges = Column(np.empty((0, 5)))
        self._near = Column(np.empty((0, 5)))
        self._counts = Column(np.empty((0, 2), np.int64))
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
        """The edges of all visible areas that matter near the footprints, shape (A, 5)."""
        return self._near.values

    @property
    def counts(self) -> IntArray:
        """How many of `edges` and of `near` are of each piece, shape (N, 2).

        The second is -1 if its visible area is empty: it has seen everything.
        """
        return self._counts.values

    def add(self, item: Evidence) -> None:
        """Add one piece of evidence."""
        footprint, area = item.prepared, item.prepared_area.edges
        near = self._near.room_for(len(area))
        count = _choose_near(area, footprint.box, near)
        self._near.extend(count)
        self._edges.room_for(len(footprint.edges))[:] = footprint.edges
        self._edges.extend(len(footprint.edges))
        self._counts.append((len(footprint.edges), count if len(area) else -1))
        self._seen.append(item.seen)

    def remove_first(self) -> None:
        """Remove the oldest piece."""
        of_footprint, of_area = self.counts[0].tolist()
        self._edges.remove_first(of_footprint)
        self._near.remove_first(max(of_area, 0))
        self._counts.remove_first()
        self._seen.remove_first()


@loop()
def _choose_near(
    edges: NDArray[np.float64],
    box: tuple[float, float, float, float],
    chosen: NDArray[np.float64],
) -> int:
    """Choose the edges of an area that matter near a footprint, and return how many there are.

    Args:
        edges: of the area, as `PreparedPolygon.edges`.
        box: of the footprint, xmin, ymin, xmax, ymax [m].
        chosen: filled with them, shape (E, 5).
    """
    bottom, right, top = box[1] - NEAR, box[2] + NEAR, box[3] + NEAR
    count = 0
    for e in range(len(edges)):
        x0, y0, x1, y1 = edges[e, 0], edges[e, 1], edges[e, 2], edges[e, 3]
        if min(y0, y1) <= top and max(y0, y1) >= bottom and min(x0, x1) <= right:
            for k in range(5):
                chosen[count, k] = edges[e, k]
            count += 1
    return count
