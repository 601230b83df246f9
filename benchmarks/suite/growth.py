"""How time and memory grow with the amount of work.

Only the largest three sizes count: in small ones, constant costs hide how the rest grows.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

LAST = 3  # sizes that an exponent is of


def exponent(sizes: Sequence[float], amounts: Sequence[float]) -> float:
    """Return the p of the law `amounts = c * sizes**p` that fits the largest three sizes best.

    The fit is a straight line through the logarithms by least squares: 1 is linear growth, 0 is
    none at all.

    Args:
        sizes: of the work, ascending, two at least, above zero.
        amounts: what each took, as seconds or bytes, above zero.

    Raises:
        ValueError: If the numbers do not fit together or no law follows from them.

    >>> exponent([10, 100, 1000], [0.3, 3.0, 30.0])
    1.0
    """
    if len(sizes) != len(amounts):
        raise ValueError(f"{len(sizes)} sizes do not go with {len(amounts)} amounts")
    if len(sizes) < 2 or min(*sizes, *amounts) <= 0 or (np.diff(sizes) <= 0).any():
        raise ValueError("two sizes or more must ascend, and they and all amounts be above zero")
    slope, _ = np.polyfit(np.log(sizes[-LAST:]), np.log(amounts[-LAST:]), deg=1)
    return round(float(slope), 3)


def n_log_n(sizes: Sequence[float]) -> float:
    """Return the exponent that n log n has between the same sizes, the largest of which count.

    >>> n_log_n([100, 1000, 10_000])
    1.151
    """
    last = sizes[-LAST:]
    return exponent(last, [size * np.log(size) for size in last])
