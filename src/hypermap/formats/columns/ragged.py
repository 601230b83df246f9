"""Lists of different lengths, stored end to end."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import TypeVar

T = TypeVar("T")


def as_tuples(items: Sequence[T], counts: Sequence[int]) -> list[tuple[T, ...]]:
    """Return the lists as tuples.

    Args:
        items: of all lists.
        counts: how many of them each list has.

    >>> as_tuples("abc", [2, 0, 1])
    [('a', 'b'), (), ('c',)]
    """
    if counts and counts[0] and counts.count(counts[0]) == len(counts):  # a few times as fast
        return list(zip(*[iter(items)] * counts[0], strict=True))
    bounds = itertools.accumulate(counts, initial=0)
    return [tuple(items[a:b]) for a, b in itertools.pairwise(bounds)]
