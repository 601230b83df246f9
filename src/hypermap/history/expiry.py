"""Zones and objects that expire: cleaning times, roadworks."""

from __future__ import annotations

import logging
import math
from datetime import date, datetime, time

from hypermap.core.hypermap import Hypermap
from hypermap.core.iso_times import time_from_iso
from hypermap.core.semantic import SemanticLayer, SemanticObject

_log = logging.getLogger(__name__)

EXPIRES = "expires"
"""The attribute of an object that says until when it is in force: a time in ISO 8601, with its
zone (that of this computer if it has none), or seconds since 1970."""


def expiry_of(item: SemanticObject) -> float | None:
    """Return when an object expires, in seconds since 1970; None for never.

    >>> import shapely
    >>> wet = {"expires": "2026-11-25T18:00:00+00:00"}
    >>> expiry_of(SemanticObject("wet floor", shapely.box(0, 0, 1, 1), attributes=wet))
    1795629600.0
    """
    value = item.attributes.get(EXPIRES)
    if value is None:
        return None
    try:
        moment = _seconds(value)
    except (ValueError, TypeError, OverflowError, OSError):
        moment = math.nan
    if math.isnan(moment):
        _log.warning("%s %s: %.50r is no time, so it never expires", item.name, item.id, value)
        return None
    return moment


def _seconds(value: object) -> float:
    """Return a time as seconds since 1970, NaN if it is none.

    Raises:
        ValueError, TypeError, OverflowError, OSError: If it cannot be read as a time.
    """
    if isinstance(value, str):
        value = time_from_iso(value)
    elif isinstance(value, date) and not isinstance(value, datetime):
        value = datetime.combine(value, time())
    if isinstance(value, datetime):
        return value.timestamp()  # without a zone, of this computer's
    if isinstance(value, bool) or not isinstance(value, int | float):
        return math.nan
    return float(value)


def next_expiry(hypermap: Hypermap) -> float | None:
    """Return when the first object of a map expires, in seconds since 1970; None for never."""
    times = [expiry_of(item) for layer in hypermap for item in _limited(layer)]
    return min((moment for moment in times if moment is not None), default=None)


def in_force(hypermap: Hypermap, now: float) -> Hypermap:
    """Return a map without the objects that have expired; the same map if there are none.

    Args:
        hypermap: is unchanged.
        now: in seconds since 1970.
    """
    for layer in hypermap:
        gone = [item.id for item in _limited(layer) if _is_over(item, now)]
        if gone and isinstance(layer, SemanticLayer):
            left = layer.copy()
            left.remove([number for number in gone if number is not None])
            hypermap = hypermap.with_layer(left)
    return hypermap


def _limited(layer: object) -> list[SemanticObject]:
    """Return the objects of a layer that say when they expire."""
    if not isinstance(layer, SemanticLayer):
        return []
    table = layer.table
    if EXPIRES not in table.attribute_keys:  # found out once, as every question asks it
        return []
    rows = (row for row, given in enumerate(table.attributes.tolist()) if EXPIRES in given)
    return [table.object(row) for row in rows]


def _is_over(item: SemanticObject, now: float) -> bool:
    moment = expiry_of(item)
    return moment is not None and moment <= now
