"""How sure a change is, as tables show it."""

from __future__ import annotations

import pytest
import shapely

from hypermap.cli.change_rows import counts_of, distance_of
from hypermap.core.history import ADDED, CORRECTED, GONE, MOVED, Change
from hypermap.core.semantic import SemanticObject

CUP = SemanticObject("cup", shapely.box(0, 0, 1, 1), id=1)


@pytest.mark.parametrize(
    ("change", "shown"),
    [
        (Change(MOVED, "semantic", CUP, CUP, 0.5, 0.9), "0.50 m (90%)"),
        (Change(CORRECTED, "semantic", CUP, CUP, 0.5), "0.50 m"),
        (Change(GONE, "semantic", CUP, None, confidence=0.33), "(33%)"),
        (Change(ADDED, "semantic", None, CUP, confidence=0.9), ""),
        (Change(GONE, "semantic", CUP, None), ""),
    ],
)
def test_doubts_are_shown(change: Change, shown: str) -> None:
    assert distance_of(change) == shown


def test_only_what_came_or_went_is_doubtful_and_only_below_one_half() -> None:
    assert Change(GONE, "semantic", CUP, None, confidence=0.49).is_doubtful
    assert not Change(GONE, "semantic", CUP, None, confidence=0.5).is_doubtful
    assert not Change(MOVED, "semantic", CUP, CUP, 0.5, 0.1).is_doubtful
    assert not Change(ADDED, "semantic", None, CUP).is_doubtful


def test_changes_are_counted_by_kind() -> None:
    gone = Change(GONE, "semantic", CUP, None)
    assert counts_of([gone, Change(ADDED, "semantic", None, CUP), gone]) == "2 gone, 1 added"
    assert counts_of([]) == ""


def test_what_corrected_poses_put_elsewhere_is_told_with_how_far() -> None:
    changes = [Change(CORRECTED, "semantic", CUP, CUP, by) for by in (0.5, 0.6)]
    changes.insert(1, Change(MOVED, "semantic", CUP, CUP, 2.0, 0.9))
    assert counts_of(changes) == "2 corrected by 0.55 m, 1 moved"
