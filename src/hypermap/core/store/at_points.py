"""The smallest object at a point, and at each of many."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import IntArray, of_rows
from hypermap.core.shapes import have_points
from hypermap.core.store.snapshot import NOWHERE, Snapshot

_ONE_BY_ONE = 16  # up to so many points, one by one is faster


def smallest_at(now: Snapshot, x: float, y: float) -> int:
    """Return the row of the smallest object at a point; -1 if there is none."""
    log, changes = now.log, now.changes
    best = NOWHERE
    for x0, y0, x1, y1, row in log.grid.near(x, y):
        if not (x0 <= x <= x1 and y0 <= y <= y1):
            continue
        if log.rings.cover(row, x, y) and (changes == 0 or log.all_ended[row] > changes):
            best = row
            break
    return best if now.count == log.first else _or_written_at(now, best, x, y)


def _or_written_at(now: Snapshot, best: int, x: float, y: float) -> int:
    """Return the smallest of `best` and the rows written after the table at a point."""
    log, written, first = now.log, now.log.written, now.log.first
    least = (math.inf, 0) if best < 0 else (log.table.areas[best], best)
    for at in written.index.at(x, y, now.count - first):
        if log.all_ended[first + at] > now.changes:
            size = written.areas[at], written.places[at]
            if size < least and log.rings.cover(first + at, x, y):
                best, least = first + at, size
    return best


def smallest_at_each(now: Snapshot, points_xy: NDArray[np.float64]) -> IntArray:
    """Return the row of the smallest object at each point, (N, 2); -1 where there is none."""
    if len(points_xy) <= _ONE_BY_ONE:
        each = [smallest_at(now, x, y) for x, y in points_xy.tolist()]
        return np.array(each, dtype=np.int64)
    log = now.log
    places, rows = log.grid.at_all(points_xy)
    kept = np.flatnonzero(log.outlines.cover(rows, of_rows(points_xy, places)))
    places, rows = places[kept], rows[kept]
    first = log.first
    if now.count > first:
        written = log.written
        there, behind = written.index.at_all(points_xy, now.count - first)
        covered = have_points(written.shapes[behind], of_rows(points_xy, there))
        places = np.concatenate([places, there[covered]])
        rows = np.concatenate([rows, behind[covered] + first])
    if now.changes:
        is_there = now.is_there(rows)
        places, rows = places[is_there], rows[is_there]
    # The smallest comes last, so it overwrites the others.
    order = np.lexsort((now.places(rows), now.column("areas", rows)))[::-1]
    smallest = np.full(len(points_xy), NOWHERE)
    smallest[places[order]] = rows[order]
    return smallest
