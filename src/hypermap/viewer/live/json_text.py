"""Answers as JSON, whatever attributes a map's objects have."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any


def json_bytes(value: Any) -> bytes:
    """Return JSON; what it does not know becomes text, and a number that is not finite null.

    >>> json_bytes({"a": float("nan"), "b": 1 + 2j})
    b'{"a":null,"b":"(1+2j)"}'
    """
    try:
        text = _dumped(value)
    except (TypeError, ValueError):  # seldom: shapes have many numbers, which are all fine
        text = _dumped(_plain(value))
    return text.encode(errors="replace")


def _dumped(value: Any) -> str:
    return json.dumps(
        value, ensure_ascii=False, allow_nan=False, separators=(",", ":"), default=str
    )


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
