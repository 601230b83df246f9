"""Places labels so that those of stacked objects stay readable."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

_LETTER = 0.55  # width of a letter, as a share of its height
_LINE = 1.2  # from line to line, as a share of the letters' height
_MOST = 2000  # labels that give way; it takes time that grows with their square
_TRIES = 8  # lines that a label may move; in a crowd of more, it stays where it belongs


def places_apart(
    places_xy: NDArray[np.float64], lengths: ArrayLike, height: float
) -> NDArray[np.float64]:
    """Return where labels stand: where they belong, or some lines below or above.

    A label gives way to those before it, by whole lines along y, first down and then up.

    Args:
        places_xy: where the labels' middles belong [m], the most important first, shape (N, 2).
        lengths: letters in each.
        height: of the letters [m].

    Returns:
        Their middles, shape (N, 2).

    >>> places_apart(np.zeros((3, 2)), [5, 3, 3], 0.1).round(2).tolist()
    [[0.0, 0.0], [0.0, -0.12], [0.0, 0.12]]
    """
    line = _LINE * height
    halves = np.asarray(lengths, dtype=float) * (_LETTER * height / 2)
    placed = np.array(places_xy, dtype=float)
    steps = [0.0, *(sign * n * line for n in range(1, _TRIES // 2 + 1) for sign in (-1, 1))]
    for number in range(1, min(len(placed), _MOST)):
        x, y = places_xy[number]
        before = placed[:number]
        overlaps = np.abs(before[:, 0] - x) < halves[:number] + halves[number]
        taken = before[overlaps, 1]
        for step in steps:
            if not np.any(np.abs(taken - (y + step)) < line * (1 - 1e-9)):
                placed[number, 1] = y + step
                break
    return placed
