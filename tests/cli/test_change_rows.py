"""How sure a change is, as tables show it."""

from __future__ import annotations

import pytest
import shapely

from hypermap.cli.change_rows import distance_of
from hypermap.core.history import ADDED, GONE, MOVED, Change
from hypermap.core.semantic import SemanticObject

CUP = SemanticObject("cup", shapely.box(0, 0, 1, 1), id=1)


@pytest.mark.parametrize(
    ("change", "shown"),
    [
        (Change(MOVED, "semantic", CUP, CUP, 0.5, 0.9), "0.50 m (90%)"),
        (Change(GONE, "semantic", CUP, None, confidence=0.33), "(33%)"),
        (Change(ADDED, "semantic", None, CUP, confidence=0.9), ""),
        (Change(GONE, "semantic", CUP, None), ""),
    ],
)
def test_doubts_are_shown(change: Change, shown: str) -> None:
    assert distance_of(change) == shown
