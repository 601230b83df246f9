"""The history of a map grows when the map is saved: by what has changed since the last time."""

from __future__ import annotations

import copy
import secrets
from collections.abc import Callable, Set
from dataclasses import replace

from hypermap.core.history import (
    ADDED,
    FIRST_SEEN,
    GONE,
    MAP_ID,
    MAP_VERSION,
    Cause,
    Change,
    History,
    Revision,
)
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.history.differences import differences

_LIKELY = 0.5


def version_of(hypermap: Hypermap) -> int:
    """Return the version of a map; 0 if it has none."""
    version = hypermap.metadata.get(MAP_VERSION)
    return version if type(version) is int else 0


def keeps_history(hypermap: Hypermap) -> bool:
    """Return whether a map has an identity, and so keeps its history."""
    return isinstance(hypermap.metadata.get(MAP_ID), str)


def begin_history(hypermap: Hypermap) -> bool:
    """Let a map keep its history from now on; return whether it did not so far.

    A map without an id gets one.
    """
    if hypermap.history is not None:
        return False
    hypermap.metadata.setdefault(MAP_ID, secrets.token_hex(8))
    hypermap.metadata.setdefault(MAP_VERSION, 1)
    hypermap.history = begun(hypermap)
    return True


def begun(hypermap: Hypermap, history: History | None = None) -> History:
    """Return a history, or a new one, with this map as its last version.

    What is changed from now on belongs to the next version.
    """
    return replace(
        history or History(),
        version=version_of(hypermap),
        layers=_semantic(hypermap),
        mapped=None,
    )


def grown(hypermap: Hypermap, now: float) -> Hypermap:
    """Return the map as it is to be saved: with a revision of what has changed, if anything has.

    Its version counts up if that has not been done already.

    Args:
        hypermap: is unchanged. If it keeps no history, it is returned.
        now: the time of edits, in seconds since 1970.
    """
    history = hypermap.history
    if history is None or not keeps_history(hypermap):
        return hypermap
    mapped = history.mapped
    cause: Cause = "edit" if mapped is None else "mapping"
    time = now if mapped is None else mapped.time
    changes = _changes(history, _semantic(hypermap), cause, now if time is None else time)
    if not changes and mapped is None:
        return hypermap
    other = copy.copy(hypermap)
    other.metadata[MAP_VERSION] = max(version_of(hypermap), history.version + 1)
    drive = "" if mapped is None else mapped.drive
    begins = mapped is not None and not (history.earlier or history.added or history.layers)
    revision = Revision(version_of(other), time, cause, drive, tuple(changes), begins=begins)
    other.history = begun(other, replace(history, added=(*history.added, revision)))
    return other


def _semantic(hypermap: Hypermap) -> dict[str, SemanticLayer]:
    return {layer.name: layer.copy() for layer in hypermap if isinstance(layer, SemanticLayer)}


def _changes(
    history: History, layers: dict[str, SemanticLayer], cause: Cause, now: float
) -> list[Change]:
    names = dict.fromkeys((*history.layers, *layers))
    pairs = ((history.layers.get(name), layers.get(name)) for name in names)
    shifts = None if history.mapped is None else history.mapped.shifts
    found = [one for pair in pairs for one in differences(*pair, cause, now, shifts)]
    if any(change.kind == FIRST_SEEN for change in found):  # otherwise it need not be read
        known = {(one.layer, one.object.id) for each in history.revisions() for one in each.changes}
        found = [_as_returned(change, known) for change in found]
    doubt = None if history.mapped is None else history.mapped.doubt
    return found if doubt is None else [_doubted(change, doubt) for change in found]


def _as_returned(change: Change, known: Set[tuple[str, int | None]]) -> Change:
    """Return a change as one that was added, if its object was on the map earlier, and gone."""
    is_back = change.kind == FIRST_SEEN and (change.layer, change.object.id) in known
    return replace(change, kind=ADDED) if is_back else change


def _doubted(change: Change, doubt: Callable[[Change], float]) -> Change:
    """Return a change as one that is doubtful, if its object probably did not come or go.

    An object that was there before is not added. One that is still there has left the map, but
    that it is gone is less likely.
    """
    if change.kind == ADDED and doubt(change) >= _LIKELY:
        return replace(change, kind=FIRST_SEEN)
    if change.kind == GONE and change.confidence is not None:
        return replace(change, confidence=change.confidence * (1 - doubt(change)))
    return change
