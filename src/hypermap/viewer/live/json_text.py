"""Responses as JSON, whatever attributes a map's objects have."""

from __future__ import annotations

import json
from typing import Any

from hypermap.text import fit_for_json


def json_bytes(value: Any) -> bytes:
    """Return JSON; what it does not know becomes text, and a number that is not finite null.

    >>> json_bytes({"a": float("nan"), "b": 1 + 2j})
    b'{"a":null,"b":"(1+2j)"}'
    """
    try:
        text = _dumped(value)
    except (TypeError, ValueError):  # seldom: shapes have many numbers, which are all fine
        text = _dumped(fit_for_json(value))
    return text.encode(errors="replace")


def _dumped(value: Any) -> str:
    return json.dumps(
        value, ensure_ascii=False, allow_nan=False, separators=(",", ":"), default=str
    )
