"""A change that is interrupted, wherever that is, has been made as a whole or not at all."""

from __future__ import annotations

import linecache
import sys
from collections.abc import Callable
from types import FrameType
from typing import Any

import numpy as np
import pytest
import shapely

from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.core.store import object_log
from hypermap.testing import assert_same_objects, square

Change = Callable[[SemanticLayer], Any]

CHANGES: dict[str, Change] = {
    "add": lambda layer: layer.add([square("b", 3, 0), square("c", 6, 0, 40)]),
    "remove": lambda layer: layer.remove([0, 2]),
    "update": lambda layer: layer.update_many({0: square("z", 9, 9), 1: square("y", -9, 9)}),
}


class _Interrupted(Exception):
    """As Ctrl-C or a lack of memory, but nobody else raises it."""


def interrupted(work: Callable[[], Any], after: int) -> bool:
    """Do some work up to its so many lines in our code; return whether that was not all of it."""
    left = after

    def trace(frame: FrameType, event: str, _: Any) -> Any:
        nonlocal left
        file = frame.f_code.co_filename
        if "hypermap" not in file:
            return None
        # Python looks for signals after calls and jumps. The end of a `with` is neither, nor is the
        # beginning of a comprehension; from Python 3.12 on, a `with` around it would not be left.
        line = linecache.getline(file, frame.f_lineno).strip()
        if event == "line" and not line.startswith("with ") and " for " not in line:
            if left == 0:
                raise _Interrupted
            left -= 1
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        work()
    except _Interrupted:
        return True
    finally:
        sys.settrace(before)
    return False


def assert_holds(layer: SemanticLayer, objects: list[SemanticObject]) -> None:
    """Assert that all answers are those of a layer that was made of the objects just now."""
    fresh = SemanticLayer("s", "map", objects)
    assert_same_objects(layer.objects(), objects)
    assert_same_objects([layer.get(int(number)) for number in fresh.ids], objects)
    points = np.array([(-9, 0), (-9, 9), (-3, 0), (0, 0), (3, 0), (6, 6), (9, 9), (99, 9)], float)
    for asked in (np.tile(points, (3, 1)), *points[:, np.newaxis]):  # many at once, and single ones
        assert layer.value_at(asked).tolist() == fresh.value_at(asked).tolist()
    for area in (shapely.box(-10, -10, 7, 10), shapely.Point(9, 9)):
        assert layer.values_in(area).values.tolist() == fresh.values_in(area).values.tolist()
    for name in "abcdyz":
        assert layer.find(name).tolist() == fresh.find(name).tolist()


@pytest.mark.parametrize("room", [1024, 0], ids=["behind-the-table", "in-a-new-log"])
@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_an_interrupted_change_is_made_as_a_whole_or_not_at_all(
    change: Change, room: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(object_log, "_FEWEST", room)

    def layer() -> SemanticLayer:
        first = [square("a", -3, 0), square("a", 0, 0), square("a", 3, 0, 20)]
        made = SemanticLayer("s", "map", first)
        made.add([square("a", 6, 6)])
        return made

    whole, lines = layer(), 0
    untouched = whole.objects()
    change(whole)
    while True:
        asked = layer()
        before = asked.snapshot
        if not interrupted(lambda now=asked: change(now), lines):  # type: ignore[misc]
            break
        lines += 1
        changed = [item.name for item in asked.objects()] != [item.name for item in untouched]
        held = whole.objects() if changed else untouched
        assert_same_objects(asked.objects(), held)
        # What comes next is what it says, and the interrupted change may be tried again.
        (new,) = asked.add([square("d", -9, 0)])
        assert_holds(asked, [*held, square("d", -9, 0, id=new)])
        if not changed:
            change(asked)
            asked.remove([new])
            names = [item.name for item in asked.objects()]
            assert names == [item.name for item in whole.objects()]
        assert [before.object(row).name for row in before.rows.tolist()] == ["a"] * 4
    assert lines > 20
