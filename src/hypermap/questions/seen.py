"""Which objects were seen at a time, not seen since, or new then."""

from __future__ import annotations

import math

import numpy as np

from hypermap.core.arrays import BoolArray
from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Matches
from hypermap.questions.query import When
from hypermap.questions.times import are_calendar


def seen_in(when: When, found: Matches) -> tuple[BoolArray, int]:
    """Return for which objects a condition on time holds.

    Returns:
        Which, shape (N,), and how many more were seen before and after that time, and may have been
        seen in it.

    Raises:
        HypermapError: If the stamps of the objects count from the start of a recording.
    """
    first, last = found.column("first_seen"), found.column("last_seen")
    if len(found) and not are_calendar(last[~np.isnan(last)]):
        raise HypermapError("the map does not know the dates at which objects were seen")
    begin = -math.inf if when.since is None else when.since.timestamp()
    end = math.inf if when.until is None else when.until.timestamp()
    is_new = (first >= begin) & (first < end)
    is_so = is_new | ((last >= begin) & (last < end))
    unsure = 0
    if when.seen == "new":
        is_so = is_new
    elif when.seen == "not seen":
        is_so = last < begin
    else:
        unsure = int(np.count_nonzero((first < begin) & (last >= end)))
    return is_so, unsure
