"""A change: written behind what is there, or, when its log is full, into a new one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from hypermap.core.objects import SemanticObject
from hypermap.core.store.snapshot import NOWHERE, Snapshot


def changed(now: Snapshot, gone: Mapping[int, int], new: Sequence[SemanticObject]) -> Snapshot:
    """Return what is there after a change; the snapshot stays as it is.

    Args:
        now: what is there before.
        gone: id -> row, of objects that are there.
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
            return Snapshot(log, log.count, log.changes, now.size + len(new) - len(gone))
    return _merged(now, gone, new)


def _merged(now: Snapshot, gone: Mapping[int, int], new: Sequence[SemanticObject]) -> Snapshot:
    """Return what is there after a change, in a new log."""
    new_rows = {item.id or 0: now.count + i for i, item in enumerate(new)}
    place_of = np.empty(now.count, dtype=np.int64)
    place_of[now.rows] = np.arange(now.size)
    rows = now.rows.copy()
    for number, row in gone.items():
        rows[place_of[row]] = new_rows.pop(number, NOWHERE)
    rows = np.concatenate([rows[rows >= 0], np.array([*new_rows.values()], dtype=np.int64)])
    return Snapshot.of(now.take(rows, new))
