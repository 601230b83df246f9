"""How time grows with the amount of work."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def exponent(sizes: Sequence[float], seconds: Sequence[float]) -> float:
    """Return the p of the law `seconds = c * sizes**p` that fits best.

    The fit is a straight line through the logarithms by least squares: 1 is linear growth, 0 is
    none at all.

    Args:
        sizes: amounts of work, two different ones at least, above zero.
        seconds: what each took, above zero.

    Raises:
        ValueError: If the numbers do not fit together or no law follows from them.

    >>> exponent([10, 100, 1000], [0.3, 3.0, 30.0])
    1.0
    """
    if len(sizes) != len(seconds):
        raise ValueError(f"{len(sizes)} sizes do not go with {len(seconds)} times")
    if len(set(sizes)) < 2 or min(*sizes, *seconds) <= 0:
        raise ValueError("sizes and times must be above zero, with two different sizes at least")
    slope, _ = np.polyfit(np.log(sizes), np.log(seconds), deg=1)
    return round(float(slope), 3)
