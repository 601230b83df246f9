"""The parameters of requests, checked."""

from __future__ import annotations

import math
from collections.abc import Mapping
from datetime import timezone

from hypermap.core.errors import HypermapError
from hypermap.core.iso_times import time_from_iso
from hypermap.core.objects import MAX_ID
from hypermap.fleet.store.service.collections import Filter

LIMIT, MOST = 100, 10_000
"""How many features a page has if nothing is said, and at most."""

ITEMS = ("bbox", "datetime", "limit", "offset", "name", "tag", "f")
"""The parameters of a collection's items."""


class BadRequest(HypermapError):
    """A parameter or a body is not as it should be."""


def check_known(given: Mapping[str, str], known: tuple[str, ...]) -> None:
    """Raise a BadRequest for unknown parameters, as OGC API - Features requires.

    Nor may one hold a NUL character, which the database does not allow.
    """
    for name, value in given.items():
        if name not in known:
            raise BadRequest(f"there is no parameter {name!r}; known: {', '.join(known)}")
        if "\0" in value:
            raise BadRequest(f"{name}: contains a NUL character")


def filter_of(given: Mapping[str, str]) -> Filter:
    """Return which features the parameters of a request ask for.

    Raises:
        BadRequest: If one cannot be read.
    """
    box = given.get("bbox")
    moment = given.get("datetime")
    begin, end = (None, None) if moment is None else _times(moment)
    return Filter(
        None if box is None else _box(box), given.get("name"), given.get("tag"), begin, end
    )


def whole(given: Mapping[str, str], name: str, default: int, least: int, most: int) -> int:
    """Return a parameter that is a whole number; a larger one than `most` counts as that.

    Raises:
        BadRequest: If it is none, or below `least`.
    """
    text = given.get(name, str(default))
    if not (text.isascii() and text.isdigit() and len(text) < 16 and int(text) >= least):
        raise BadRequest(f"{name}: expected a whole number from {least} on, got {text!r}")
    return min(int(text), most)


def object_id(text: str) -> int | None:
    """Return the id of a feature; None if it is none."""
    is_number = text.isascii() and text.isdigit() and len(text) <= len(str(MAX_ID))
    return int(text) if is_number and int(text) <= MAX_ID else None


def _box(text: str) -> tuple[float, ...]:
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) == 6:  # with heights, which objects on the floor do not have
        numbers = (*numbers[:2], *numbers[3:5])
    if len(numbers) != 4 or not all(map(math.isfinite, numbers)):
        raise BadRequest(f"bbox: expected x0,y0,x1,y1 in meters, got {text!r}")
    if numbers[0] > numbers[2] or numbers[1] > numbers[3]:
        raise BadRequest(f"bbox: the lower left corner comes first, got {text!r}")
    return numbers


def _times(text: str) -> tuple[float | None, float | None]:
    """Return begin and end [s] of a moment or an interval; None for an open end."""
    parts = text.split("/")
    if len(parts) > 2:
        raise BadRequest(f"datetime: expected a time or BEGIN/END, got {text!r}")
    times = [None if part in ("", "..") else _stamp(part) for part in parts]
    if times == [None] or times == [None, None]:
        raise BadRequest(f"datetime: expected a time, got {text!r}")
    begin, end = times[0], times[-1]
    if begin is not None and end is not None and begin > end:
        raise BadRequest(f"datetime: it ends before it begins: {text!r}")
    return begin, end


def _stamp(text: str) -> float:
    try:
        moment = time_from_iso(text)
    except ValueError:
        raise BadRequest(
            f"datetime: expected a time such as 2026-11-25T10:00:00Z, got {text!r}"
        ) from None
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=timezone.utc)
    return moment.timestamp()
