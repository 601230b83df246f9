"""Stamps as seconds, whatever unit a file counts in."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hypermap.core.history import EARLIEST

_TICKS = (1e9, 1e6, 1e3)  # per second


def ticks_per_second(stamps: ArrayLike) -> float | None:
    """Return in how many parts of a second stamps count from 1970; None if they do not.

    All of a file count in one unit. So the least finite one decides: counts of ns since the
    start of a computer, which soon reach those of ms since 1970, stay together.

    >>> ticks_per_second([1_700_000_000_250, 1_700_000_001_000]), ticks_per_second([2e9, 2e11])
    (1000.0, None)
    """
    known = np.asarray(stamps, float)
    least = known[np.isfinite(known)].min(initial=np.inf)
    if least == np.inf:
        return None
    return next((ticks for ticks in _TICKS if least > EARLIEST * ticks), None)


def in_seconds(stamps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the stamps of a file in seconds, to a microsecond if they count parts of one.

    >>> in_seconds(np.array([1_700_000_000_250_000_000, np.nan])).round(6).tolist()
    [1700000000.25, nan]
    """
    return stamps / (ticks_per_second(stamps) or 1.0)
