"""A change: appended to the log, or written to a new log when the old one is full."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from hypermap.core.objects import SemanticObject
from hypermap.core.store.object_log import ObjectLog
from hypermap.core.store.snapshot import NOWHERE, Snapshot


def written(
    now: Snapshot, gone: Mapping[int, int], new: Sequence[SemanticObject]
) -> tuple[ObjectLog, int, int]:
    """Write a change to a log; return it, and the number of rows and changes of the new snapshot.

    Args:
        now: the snapshot before; it does not change.
        gone: id -> row, of current objects.
        new: objects with ids. One with an id that is gone takes that object's place; the others
            come last.
    """
    log = now.log
    with log.writing:
        is_newest = (now.count, now.changes) == (log.count, log.changes)
        if is_newest and log.has_room(len(gone) + len(new)):
            place_of = {number: now.place(row) for number, row in gone.items()}
            places = [place_of.get(x.id or 0, now.count + i) for i, x in enumerate(new)]
            log.write(gone.values(), new, places)
            return log, log.count, log.changes
    merged = _merged(now, gone, new)
    return merged, merged.count, 0


def _merged(now: Snapshot, gone: Mapping[int, int], new: Sequence[SemanticObject]) -> ObjectLog:
    """Return a new log with the objects after a change."""
    new_rows = {item.id or 0: now.count + i for i, item in enumerate(new)}
    place_of = np.empty(now.count, dtype=np.int64)
    place_of[now.rows] = np.arange(now.size)
    rows = now.rows.copy()
    for number, row in gone.items():
        rows[place_of[row]] = new_rows.pop(number, NOWHERE)
    rows = np.concatenate([rows[rows >= 0], np.array([*new_rows.values()], dtype=np.int64)])
    return ObjectLog(now.take(rows, new))
