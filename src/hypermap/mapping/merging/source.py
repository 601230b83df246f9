"""What the history of a merged map says its changes come from: drives, times, and doubts."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from hypermap.core.history import ADDED, Change, Mapped
from hypermap.core.hypermap import Hypermap
from hypermap.mapping.config import MappingConfig
from hypermap.mapping.drives import Drive
from hypermap.mapping.going_on import layer_of_objects
from hypermap.mapping.mapper_state import MapperState
from hypermap.mapping.second_look import doubt_about_changes


def merged_source(
    first: Hypermap,
    drives: Sequence[Drive],
    state: MapperState,
    config: MappingConfig,
    merged: Hypermap,
) -> Mapped:
    """Return what the changes come from, by the names and the last time of the second map's drives.

    What was merged with the first map, and not saved since, counts, too, as do corrected poses.

    Args:
        first: the first map.
        drives: of the second map.
        state: of the mapper of the merged map, with the log of all frames that were mapped again.
        config: of both maps.
        merged: the merged map.
    """
    before = None if first.history is None else first.history.mapped
    sources = [] if before is None else [(before.drive, before.time)]
    sources += [(drive.name, drive.time) for drive in drives]
    times = [time for _, time in sources if time is not None]
    names = ", ".join(name for name, _ in sources if name)
    doubt = None
    if _are_last(drives, state.drives):
        own, made = layer_of_objects(first), layer_of_objects(merged)
        objects = [] if made is None else made.objects()
        doubt = doubt_about_changes(
            state.log, state.drives, config, own, objects, state.tracks, present=len(drives)
        )
    shifts = None if before is None else before.shifts
    return Mapped(names, max(times, default=None), _doubt_of_both(first, doubt), shifts)


def _are_last(some: Sequence[Drive], drives: Sequence[Drive]) -> bool:
    """Return whether some drives, of which there is one at least, are the last ones of others."""
    last = [drive.keys for drive in drives[-len(some) :]]
    return len(some) > 0 and last == [drive.keys for drive in some]


def _doubt_of_both(
    first: Hypermap, doubt: Callable[[Change], float] | None
) -> Callable[[Change], float] | None:
    """Return the doubt about changes by drives merged with a map, and by those before, unsaved."""
    if first.history is None or first.history.mapped is None:
        return doubt
    before, layer = first.history.mapped.doubt, layer_of_objects(first)
    there = set() if layer is None else {item.id for item in layer}

    def of_both(change: Change) -> float:
        is_of_first = (change.object.id in there) == (change.kind == ADDED)
        own = before if is_of_first else doubt
        return 0.0 if own is None else own(change)

    return of_both
