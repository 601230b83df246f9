"""Which worlds and seeds are for looking and tuning, and which for measuring alone.

A method that is tuned on a world does well in that world. So nobody looks at what is mapped in the
worlds `test`, nor at seeds from `FIRST_TEST_SEED` on, but for the table of results.
"""

from __future__ import annotations

from collections.abc import Sequence

DEV = ("lab", "floor", "office", "kitchen", "warehouse", "corridor")
TEST = ("apartment", "open_office", "building")
SETS = {"dev": DEV, "test": TEST}
FIRST_DEV_SEED = 1000
FIRST_TEST_SEED = 5000


def worlds_named(words: str) -> list[str]:
    """Return the worlds that a user names: "dev", "test", or names and files with commas.

    >>> worlds_named("test")
    ['apartment', 'open_office', 'building']
    >>> worlds_named("lab,mine.yaml")
    ['lab', 'mine.yaml']
    """
    return [world for word in words.split(",") for world in SETS.get(word, (word,))]


def first_seed_of(worlds: Sequence[str]) -> int:
    """Return the first seed for worlds: one of `test` where one of the worlds is."""
    return FIRST_TEST_SEED if set(worlds) & set(TEST) else FIRST_DEV_SEED
