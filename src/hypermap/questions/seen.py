"""Which objects were seen at a time, not seen since, or new then."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import FoundObject
from hypermap.questions.query import When
from hypermap.questions.times import are_calendar


def seen_in(when: When, found: Sequence[FoundObject]) -> tuple[list[FoundObject], int]:
    """Return the objects for which a condition on time holds.

    Returns:
        The objects, and how many more were seen before and after that time, and may have been
        seen in it.

    Raises:
        HypermapError: If the stamps of the objects count from the start of a recording.
    """
    if found and not are_calendar(item.object.last_seen for item in found):
        raise HypermapError("the map does not know on which day or at what time objects were seen")
    begin = -math.inf if when.since is None else when.since.timestamp()
    end = math.inf if when.until is None else when.until.timestamp()
    first = np.array([_or_nan(item.object.first_seen) for item in found])
    last = np.array([_or_nan(item.object.last_seen) for item in found])
    is_new = (first >= begin) & (first < end)
    is_so = is_new | ((last >= begin) & (last < end))
    unsure = 0
    if when.seen == "new":
        is_so = is_new
    elif when.seen == "not seen":
        is_so = last < begin
    else:
        unsure = int(np.count_nonzero((first < begin) & (last >= end)))
    return [item for item, holds in zip(found, is_so.tolist(), strict=True) if holds], unsure


def _or_nan(stamp: float | None) -> float:
    return math.nan if stamp is None else stamp
