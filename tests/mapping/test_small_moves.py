"""Objects that were moved between two drives, but are still in their places, or next to them."""

from __future__ import annotations

import pytest
import shapely

from hypermap.mapping.evidence import EvidenceMap

from .evidence_tools import DAY, DEFAULT, ROOM, only, seen, square


def test_of_what_was_moved_by_less_than_its_size_the_old_evidence_is_dropped() -> None:
    evidence = EvidenceMap(DEFAULT)
    for second in range(8):
        evidence.update(seen(square(0), stamp=second))
    for second in range(4):
        evidence.update(seen(square(0.4), stamp=DAY + second))
    chair = only(evidence)
    assert chair.id == 0
    assert chair.footprint.centroid.x == pytest.approx(0.4, abs=0.02)
    assert chair.attributes["moved"]["confidence"] > 0.9


@pytest.mark.parametrize(
    ("now", "is_moved"),
    [
        (shapely.box(0.6, 0.0, 2.6, 0.9), True),
        (shapely.box(0.0, 0.0, 2.0, 0.4), False),  # seen from one side
    ],
)
def test_a_sofa_is_moved_if_it_is_where_floor_was_seen(
    now: shapely.Polygon, is_moved: bool
) -> None:
    evidence = EvidenceMap(DEFAULT)
    for second in range(8):
        evidence.update(seen(shapely.box(0.0, 0.0, 2.0, 0.9), stamp=second))
    for second in range(6):
        evidence.update(seen(now, stamp=DAY + second))
    sofa = only(evidence)
    assert ("moved" in sofa.attributes) == is_moved
    assert sofa.footprint.centroid.x == pytest.approx(1.6 if is_moved else 1.0, abs=0.02)


@pytest.mark.parametrize(
    ("before", "now"),
    [((0.0, 2.0), (0.07, 3.1)), ((0.0, 3.8), (0.0, 1.95))],
    ids=["seen as one now", "seen as one before"],
)
def test_of_two_benches_seen_as_one_the_one_that_stays_was_not_moved(
    before: tuple[float, float], now: tuple[float, float]
) -> None:
    evidence = EvidenceMap(DEFAULT)
    for start, count, (left, right) in ((0.0, 8, before), (DAY, 6, now)):
        for second in range(count):
            shape = shapely.box(left, 0.0, right, 0.9)
            evidence.update(seen(shape, stamp=start + second))
    assert "moved" not in only(evidence).attributes


def test_what_stands_in_a_part_of_its_old_place_was_moved_there() -> None:
    evidence = EvidenceMap(DEFAULT)
    for second in range(8):
        evidence.update(seen(square(0), stamp=second))
    for second in range(4):
        evidence.update(seen(square(0.8), stamp=DAY + second))
    chair = only(evidence)
    assert (chair.id, chair.first_seen) == (0, 0.0)
    assert chair.footprint.centroid.x == pytest.approx(0.8, abs=0.02)


def test_a_small_move_is_found_once_the_old_place_was_looked_at() -> None:
    evidence = EvidenceMap(DEFAULT)
    for second in range(8):
        evidence.update(seen(square(0), stamp=second))
    for second in range(6):  # at first, the frames do not reach as far as the old place
        area = shapely.box(0.2, -10, 10, 10) if second < 4 else ROOM
        evidence.update(seen(square(0.4), area=area, stamp=DAY + second))
    assert only(evidence).footprint.centroid.x == pytest.approx(0.4, abs=0.02)
    assert "moved" in only(evidence).attributes


@pytest.mark.parametrize(("left", "has_moved"), [(-2.6, True), (-2.9, False)])
def test_an_object_that_is_hardly_in_its_place_was_moved_even_if_its_shape_seems_another_one(
    left: float, has_moved: bool
) -> None:
    evidence = EvidenceMap(DEFAULT)
    for second in range(6):
        evidence.update(seen(square(-3), stamp=second))
    for second in range(60):
        narrower = shapely.box(left, -0.5, left + 0.45, 0.5)
        evidence.update(seen(narrower, stamp=DAY + second))
    chair = only(evidence)
    assert chair.id == 0
    assert ("moved" in chair.attributes) == has_moved


@pytest.mark.parametrize(("number", "x"), [(0, -2.5), (1, -2.65)])
def test_a_view_that_is_taken_for_the_object_at_its_old_place_does_not_keep_it_there(
    number: int, x: float
) -> None:
    """The first or second view at the new place nearby lies between both places."""
    evidence = EvidenceMap(DEFAULT)
    for second in range(6):
        evidence.update(seen(square(-3), stamp=second))
    for second in range(8):
        evidence.update(seen(square(x if second == number else -2.15), stamp=DAY + second))
    chair = only(evidence)
    assert chair.id == 0
    assert chair.attributes["moved"]["since"] == DAY
    assert chair.footprint.centroid.x == pytest.approx(-2.15, abs=0.02)


def test_a_first_view_that_lies_more_in_the_new_place_is_of_the_object_there() -> None:
    """So nobody has to look at the old place, which the object itself may hide."""
    evidence, beyond = EvidenceMap(DEFAULT), shapely.box(-2.6, -10, 10, 10)
    for second in range(6):
        evidence.update(seen(square(-3), stamp=second))
    for second in range(8):
        x = -2.5 if second == 0 else -2.15
        evidence.update(seen(square(x), stamp=DAY + second, area=beyond))
    chair = only(evidence)
    assert chair.id == 0
    assert chair.footprint.centroid.x == pytest.approx(-2.25, abs=0.1)


def test_a_small_object_that_poses_put_beside_its_place_was_not_moved() -> None:
    evidence = EvidenceMap(DEFAULT)
    for second in range(12):
        evidence.update(seen(square(0, side=0.1), name="cup", stamp=second))
    for second in range(4):
        evidence.update(seen(square(0.16, side=0.1), name="cup", stamp=DAY + second))
    for second in range(4, 10):
        evidence.update(seen(square(-0.02, side=0.1), name="cup", stamp=DAY + second))
    cup = only(evidence)
    assert cup.id == 0
    assert cup.attributes["evidence"] >= 18
    assert "moved" not in cup.attributes
