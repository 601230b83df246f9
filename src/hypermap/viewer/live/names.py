"""Name matching: the names of objects, and which of them a user may mean."""

from __future__ import annotations

import difflib
from collections.abc import Sequence

_MOST = 20  # that are suggested


def similar_names(name: str, known: Sequence[str]) -> list[str]:
    """Return names that contain a text, those that start with it first; or else similar names."""
    part = name.casefold()
    found = [other for other in known if part in other.casefold()]
    if not found:
        found = difflib.get_close_matches(name, known, n=_MOST)
    found.sort(key=lambda other: (not other.casefold().startswith(part), len(other), other))
    return found[:_MOST]
