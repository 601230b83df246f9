"""Makes names and numbers from files and recordings safe to display."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any


def printable(text: object, longest: int = 28) -> str:
    r"""Return a text in one line, without control characters and cut at a length.

    >>> printable("a cup\n of tea")
    'a cup of tea'
    >>> printable("a very long name", longest=8)
    'a very …'
    """
    visible = "".join(c if c.isprintable() else " " for c in str(text))
    line = " ".join(visible.split())
    return line if len(line) <= longest else line[: longest - 1] + "…"


def fit_for_json(value: Any) -> Any:
    """Return a value with keys that are texts, and null for numbers that are not finite.

    >>> fit_for_json({1: float("nan"), "b": (2, 3.5)})
    {'1': None, 'b': [2, 3.5]}
    """
    if isinstance(value, Mapping):
        return {str(key): fit_for_json(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [fit_for_json(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def counted(number: int, one: str, many: str = "") -> str:
    """Return a number with its noun.

    >>> counted(1, "object"), counted(2, "class", "classes")
    ('1 object', '2 classes')
    """
    return f"{number} {one if number == 1 else many or one + 's'}"
