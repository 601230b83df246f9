"""A map as it was."""

from __future__ import annotations

import contextlib
import math
import re
import time
from collections.abc import Callable
from dataclasses import replace
from datetime import date, datetime
from datetime import time as clock
from numbers import Real

from hypermap.core.arguments import check_kind
from hypermap.core.errors import FormatError, HypermapError
from hypermap.core.history import MAP_VERSION, Change, Revision
from hypermap.core.hypermap import Hypermap
from hypermap.core.iso_times import time_from_iso
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.core.value_layer import ValueLayer
from hypermap.history.expiry import in_force
from hypermap.history.grown import version_of
from hypermap.values.past import values_at


def as_of(hypermap: Hypermap, moment: datetime | date | str | float) -> Hypermap:
    """Return a map as it was at a time: its objects with their names and shapes.

    An object was last seen at the newest of its kept observations by then, or else at the first
    one. Measured values are of the samples that had been taken by then (`values.past`). Grids,
    notes and transforms are those of today, and layers that are not there any more are left out.
    Mapping cannot continue such a map.

    Args:
        hypermap: a map with a history.
        moment: a datetime or its ISO 8601 form, without a zone that of this computer; a date, for
            its beginning; or seconds since 1970.

    Raises:
        HypermapError: If the map keeps no history, it does not reach back so far, or is lost.
        ValueError: If the text or number is not a time.
        TypeError: If it is something else.
    """
    check_kind(hypermap, Hypermap)
    stamp = _stamp(moment)
    is_now = stamp >= time.time()
    past, _ = _before(hypermap, lambda begun, _: begun > stamp, f"at {_said(stamp)}", is_now)
    return _with_values_at(_seen_by(in_force(past, stamp), stamp), stamp)


def at_version(hypermap: Hypermap, version: int) -> Hypermap:
    """Return a map as it was in one of its versions; see `as_of`.

    Raises:
        HypermapError: If there is no such version yet, the map keeps no history, or it does not
            reach back so far.
        TypeError: If it is not a map.
    """
    check_kind(hypermap, Hypermap)
    check_version(hypermap, version)
    is_now = version == version_of(hypermap)
    when = f"in version {version}"
    past, stamp = _before(hypermap, lambda _, one: one.version > version, when, is_now, version)
    return _with_values_at(_seen_by(past, stamp), stamp)


def time_of_version(hypermap: Hypermap, version: int) -> float | None:
    """Return since when a map was as in a version, in seconds since 1970; None if unknown."""
    dated = [] if hypermap.history is None else hypermap.history.dated()
    begun = [begins for begins, revision in dated if revision.version <= version]
    return begun[-1] if begun and math.isfinite(begun[-1]) else None


def is_known_from_the_beginning(hypermap: Hypermap) -> bool:
    """Return whether a map's history goes back to when there was no object on it."""
    revisions = [] if hypermap.history is None else list(hypermap.history.revisions())
    is_whole = hypermap.history is not None and not hypermap.history.is_end_lost
    if not (revisions and is_whole) or any(revision.follows_loss for revision in revisions):
        return False
    past = _without(hypermap, revisions, 0)
    return all(len(layer) == 0 for layer in past if isinstance(layer, SemanticLayer))


def check_version(hypermap: Hypermap, version: int) -> None:
    """Refuse a version that a map does not have yet.

    Raises:
        HypermapError: If it is later than the newest.
    """
    newest = version_of(hypermap)
    if newest and version > newest:
        raise HypermapError(f"there is no version {version} of the map; the newest is {newest}")


def _with_values_at(hypermap: Hypermap, stamp: float) -> Hypermap:
    """Return a map with its measured values as they were at a time."""
    return hypermap.with_layers(
        values_at(hypermap, layer, stamp) if isinstance(layer, ValueLayer) else layer
        for layer in hypermap
    )


def _seen_by(hypermap: Hypermap, stamp: float) -> Hypermap:
    """Return a map whose objects were not seen after a time, as the history does not log this."""
    return hypermap.with_layers(
        _layer_seen_by(layer, stamp) if isinstance(layer, SemanticLayer) else layer
        for layer in hypermap
    )


def _layer_seen_by(layer: SemanticLayer, stamp: float) -> SemanticLayer:
    if not math.isfinite(stamp) or not any(_is_seen_after(stamp, item) for item in layer):
        return layer
    last: dict[int | None, float] = {}
    with contextlib.suppress(FormatError):  # evidence that cannot be read
        if (table := layer.evidence()) is not None:
            seen = table.stamps[table.views]
            by_then = seen <= stamp
            ordered = sorted(zip(seen[by_then], table.object_ids[by_then], strict=True))
            last = {int(number): float(when) for when, number in ordered}
    return layer.with_objects(
        replace(item, last_seen=last.get(item.id, item.first_seen))
        if _is_seen_after(stamp, item)
        else item
        for item in layer
    )


def _is_seen_after(stamp: float, item: SemanticObject) -> bool:
    return item.last_seen is not None and item.last_seen > stamp


def _before(
    hypermap: Hypermap,
    is_later: Callable[[float, Revision], bool],
    when: str,
    is_now: bool,
    version: int | None = None,
) -> tuple[Hypermap, float]:
    """Return a map before its later revisions, and when it began to be so; infinite for now.

    The revision that follows a version leads back to it, even if those right before are lost.
    """
    history = hypermap.history
    dated = [] if history is None else list(history.dated())
    if history is not None and history.is_end_lost and not (is_now and dated):
        raise HypermapError(
            f"{when} the map is not known: the end of its history is lost, so only the present is"
        )
    if not dated:
        raise HypermapError("the map keeps no history, so only the present is known")
    undone = [revision for begins, revision in dated if is_later(begins, revision)]
    if len(undone) == len(dated):
        began, first = dated[0]
        said = "it was begun" if first.version == 1 else "its history begins"
        raise HypermapError(
            f"{when} the map is not known: {said} with version {first.version}, "
            f"{'later that minute' if _said(began) in when else _said(began)}"
        )
    # Some of another layer may stay among those that are undone.
    since = [revision for _, revision in dated if undone and revision.version >= undone[0].version]
    leads_back = [one for one in since if one.version - 1 != version]
    if any(revision.follows_loss for revision in leads_back):
        raise HypermapError(f"{when} the map is not known: a later part of its history is lost")
    began, last = [pair for pair in dated if pair[1] not in undone][-1]
    return _without(hypermap, undone, version or last.version), began if undone else math.inf


def _without(hypermap: Hypermap, undone: list[Revision], version: int) -> Hypermap:
    """Return a map before its last revisions."""
    layers = {layer.name: layer for layer in hypermap if isinstance(layer, SemanticLayer)}
    objects = {name: {item.id: item for item in layer} for name, layer in layers.items()}
    for revision in reversed(undone):
        for change in revision.changes:
            _undo(objects.get(change.layer, {}), change)
    past = hypermap.with_layers(
        _holding(layer, objects[layer.name]) if isinstance(layer, SemanticLayer) else layer
        for layer in hypermap
    )
    past.metadata[MAP_VERSION] = version
    past.mapper_state = past.history = None
    return past


def _undo(objects: dict[int | None, SemanticObject], change: Change) -> None:
    if change.before is None:
        objects.pop(change.object.id, None)
    else:
        objects[change.object.id] = change.before


def _holding(layer: SemanticLayer, objects: dict[int | None, SemanticObject]) -> SemanticLayer:
    """Return a layer of other objects, in the order of their ids."""
    ordered = sorted(objects.values(), key=lambda item: -1 if item.id is None else item.id)
    return layer.with_objects(ordered)


def _stamp(moment: datetime | date | str | float) -> float:
    if isinstance(moment, str):
        try:
            moment = time_from_iso(moment)
        except ValueError:
            raise ValueError(_no_time(str(moment))) from None
    elif isinstance(moment, date) and not isinstance(moment, datetime):
        moment = datetime.combine(moment, clock())
    if isinstance(moment, bool) or not isinstance(moment, datetime | Real):
        raise TypeError(
            f"expected a datetime, its ISO 8601 form or seconds since 1970, got {moment!r}"
        )
    stamp = moment.timestamp() if isinstance(moment, datetime) else float(moment)
    if math.isnan(stamp):
        raise ValueError("the time is NaN")
    return stamp


def _no_time(text: str) -> str:
    """Return that a text is no time, and how to ask for a version if it is one."""
    version = re.fullmatch(r"v(\d+)", text)
    hint = f"; for a version: hypermap.history.at_version(map, {version[1]})" if version else ""
    return f"expected a time in ISO 8601, such as 2026-11-24T17:00+01:00, got {text!r}{hint}"


def _said(stamp: float) -> str:
    try:
        return datetime.fromtimestamp(stamp).astimezone().strftime("%Y-%m-%d %H:%M %Z").strip()
    except (ValueError, OverflowError, OSError):
        return "an unknown time"
