"""Stamps as seconds, whatever unit a file counts in."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hypermap.core.history import EARLIEST

_TICKS = (1e9, 1e6, 1e3)  # per second


def ticks_per_second(number: float) -> float | None:
    """Return in how many parts of a second a number counts from 1970; None if it does not.

    >>> ticks_per_second(1_700_000_000_250), ticks_per_second(1_700_000_000.25)
    (1000.0, None)
    """
    return next((ticks for ticks in _TICKS if number > EARLIEST * ticks), None)


def in_seconds(stamps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return stamps in seconds; those that count ms, µs or ns from 1970 are, to a microsecond.

    >>> in_seconds(np.array([2.5, 1_700_000_000.25, 1_700_000_000_250_000_000])).round(6).tolist()
    [2.5, 1700000000.25, 1700000000.25]
    """
    is_counted = [stamps > EARLIEST * ticks for ticks in _TICKS]
    ticks: NDArray[np.float64] = np.select(is_counted, _TICKS, 1.0)
    return stamps / ticks
