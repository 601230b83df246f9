"""Of two things that look alike, a map may take each for the other."""

from __future__ import annotations

import shapely

from hypermap.core.history import GONE, MOVED, Change
from hypermap.core.semantic import SemanticObject
from hypermap.experiments.look_alikes import as_told
from hypermap.simulation.days import WorldChange, look_alike
from hypermap.simulation.world import WorldObject

Place = tuple[float, float]
A, B, C = (1.0, 1.0), (3.0, 1.0), (5.0, 1.0)


def chair(place: Place, width: float = 0.5) -> WorldObject:
    return WorldObject("chair", place, size={"width": width})


def moved(start: Place, end: Place) -> Change:
    shapes = [shapely.Point(place).buffer(0.2) for place in (start, end)]
    before, after = (SemanticObject("chair", shape, id=1) for shape in shapes)
    return Change(MOVED, "semantic", before, after)


def test_one_gone_and_one_brought_may_be_one_that_was_moved() -> None:
    true = [WorldChange("removed", 1, chair(A), None), WorldChange("added", 9, None, chair(B))]
    changes, mistaken = as_told(true, [moved(A, B)], near=0.5)
    assert changes == [WorldChange("moved", 1, chair(A), chair(B))]
    assert mistaken == {1, 9}


def test_the_new_one_may_be_either() -> None:
    true = [WorldChange("moved", 1, chair(A), chair(B)), WorldChange("added", 9, None, chair(C))]
    changes, mistaken = as_told(true, [moved(A, C)], near=0.5)
    assert changes == [
        WorldChange("moved", 1, chair(A), chair(C)),
        WorldChange("added", 9, None, chair(B)),
    ]
    assert mistaken == {1, 9}


def test_how_much_sizes_may_differ_is_given() -> None:
    larger = chair(B, width=0.6)
    true = [WorldChange("removed", 1, chair(A), None), WorldChange("added", 9, None, larger)]
    assert as_told(true, [moved(A, B)], near=0.5) == (true, set())
    changes, _ = as_told(true, [moved(A, B)], near=0.5, share=0.25)
    assert changes == [WorldChange("moved", 1, chair(A), larger)]


def test_two_that_were_moved_may_be_one_or_each_other() -> None:
    true = [
        WorldChange("moved", 1, chair(A), chair(B)),
        WorldChange("moved", 2, chair(B), chair(C)),
    ]
    changes, mistaken = as_told(true, [moved(A, C)], near=0.5)
    assert changes == [WorldChange("moved", 1, chair(A), chair(C))]
    assert mistaken == {1, 2}
    true[1] = WorldChange("moved", 2, chair((9.0, 1.0)), chair(C))
    changes, _ = as_told(true, [moved(A, C)], near=0.5)
    assert changes[1:] == [WorldChange("moved", 2, chair((9.0, 1.0)), chair(B))]


def test_where_another_one_like_it_has_come_nothing_has_changed() -> None:
    true = [
        WorldChange("moved", 1, chair(A), chair(B)),
        WorldChange("added", 9, None, chair((1.1, 1.2))),
    ]
    assert as_told(true, [], near=0.5) == ([WorldChange("added", 9, None, chair(B))], {1, 9})


def test_what_the_map_tells_as_it_is_stays() -> None:
    true = [WorldChange("moved", 1, chair(A), chair(B)), WorldChange("added", 9, None, chair(C))]
    assert as_told(true, [moved(A, B)], near=0.5) == (true, set())
    gone = Change(GONE, "semantic", moved(A, B).before, None)
    assert as_told(true, [gone], near=0.5) == (true, set())
    assert as_told(true, [moved(A, (9.0, 9.0))], near=0.5) == (true, set())


def test_things_of_other_sizes_are_not_taken_for_each_other() -> None:
    new = chair(B, width=0.6)
    true = [WorldChange("removed", 1, chair(A), None), WorldChange("added", 9, None, new)]
    assert as_told(true, [moved(A, B)], near=0.5) == (true, set())


def test_outlines_look_alike_wherever_they_lie() -> None:
    one = WorldObject("table", outline=((0, 0), (2, 0), (2, 1), (0, 1)))
    turned = WorldObject("table", outline=((5, 5), (5, 7), (4, 7), (4, 5)))
    longer = WorldObject("table", outline=((0, 0), (3, 0), (3, 1), (0, 1)))
    assert look_alike(one, turned)
    assert not look_alike(one, longer)
    assert not look_alike(one, WorldObject("table", (1.0, 0.5)))
