"""Which objects of earlier drives a drive shows: those that were moved keep their ids."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest
import shapely

from hypermap.core.semantic import SemanticObject
from hypermap.history.differences import is_said_to_have_moved
from hypermap.mapping.by_hand import HandEdit
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.stages import EvidenceConfig
from hypermap.mapping.track_arrays import packed_tables, unpacked_tables

from .evidence_tools import DAY, DEFAULT, NOWHERE, ROOM, THESIS, only, seen, square

RIGHT = shapely.box(0, -10, 10, 10)
LEFT = shapely.box(-10, -10, 0, 10)
"""Where the chair stands first, at (-3, 0); from here it comes to (3, 0)."""


def after_a_move(
    config: EvidenceConfig = DEFAULT,
    *,
    other_area: shapely.Polygon = ROOM,
    other: shapely.Polygon | None = None,
    name: str = "chair",
    top: float = 0.9,
    edit: HandEdit | None = None,
) -> EvidenceMap:
    """Return a map of a chair that was seen at (-3, 0), and then not there but at another place.

    Args:
        config: of the map.
        other_area: what is seen while the chair is at its first place.
        other: the shape at the other place; as it was before if None.
        name: its class there.
        top: how high it is there [m]; 0.9 before.
        edit: by hand, between the two.
    """
    evidence = EvidenceMap(config)
    for second in range(6):
        evidence.update(seen(square(-3), area=other_area, stamp=second))
    if edit is not None:
        evidence.go_on_with(evidence.tracks(), {0: edit})
    for second in range(60):
        there = square(3) if other is None else other
        evidence.update(seen(there, name=name, top=top, stamp=DAY + second))
    return evidence


def test_an_object_that_was_moved_keeps_its_id_and_says_how_surely() -> None:
    chair = only(after_a_move())
    assert (chair.id, chair.first_seen, chair.last_seen) == (0, 0.0, DAY + 59)
    assert chair.footprint.intersection(square(3)).area == pytest.approx(1, abs=0.1)
    assert chair.attributes["moved"] == {"confidence": pytest.approx(1.0, abs=0.1), "since": DAY}


def test_a_second_move_that_is_as_sure_is_another_one() -> None:
    evidence = after_a_move()
    first = only(evidence)
    for second in range(80):
        evidence.update(seen(square(-3), stamp=2 * DAY + second))
    again = only(evidence)
    assert again.id == first.id
    assert again.attributes["moved"]["confidence"] == first.attributes["moved"]["confidence"]
    assert is_said_to_have_moved(first, again)
    assert not is_said_to_have_moved(again, only(evidence))


def test_since_when_an_object_is_at_its_place_is_saved_and_unknown_in_earlier_files() -> None:
    packed = packed_tables(after_a_move().settled())
    facts = [{k: v for k, v in one.items() if k != "moved_since"} for one in packed.facts]
    for saved, since in ((packed, DAY), (dataclasses.replace(packed, facts=facts), None)):
        evidence = EvidenceMap(DEFAULT)
        evidence.go_on_with(unpacked_tables(saved, DEFAULT)[0])
        moved = only(evidence).attributes["moved"]
        assert (moved["confidence"] > 0.9, moved.get("since")) == (True, since)


@pytest.mark.parametrize(
    "what",
    [
        {"other_area": LEFT},  # the other place had not been looked at: perhaps it was there
        {"other": square(3, side=2)},
        {"name": "table"},
        {"top": 0.7},
        {"top": 1.2},
        {"config": THESIS},
        {"edit": HandEdit(name="Anna's chair")},
        {"edit": HandEdit(footprint=square(-3, side=0.5))},
    ],
    ids=[
        "not looked at",
        "another size",
        "another class",
        "lower",
        "higher",
        "thesis",
        "renamed",
        "reshaped",
    ],
)
def test_otherwise_it_is_another_object(what: dict[str, Any]) -> None:
    found = {item.id: item for item in after_a_move(**what).objects()}
    (new,) = (item for number, item in found.items() if number != 0)
    assert "moved" not in new.attributes
    assert new.first_seen == DAY


def test_of_two_equal_objects_that_were_moved_neither_is_sure() -> None:
    evidence = EvidenceMap(DEFAULT)
    for second in range(6):
        evidence.update(seen(square(-3), square(-3, 2), square(0, 3), stamp=second))
    for second in range(60):
        evidence.update(seen(square(3), square(3, 2), square(0, 3), stamp=DAY + second))
    *found, third = evidence.objects()
    assert [item.id for item in (*found, third)] == [0, 1, 2]
    assert "moved" not in third.attributes
    for item in found:
        assert item.attributes["moved"]["confidence"] == pytest.approx(0.5, abs=0.1)


@pytest.mark.parametrize(("earlier", "number"), [(1, 0), (6, 1)])
def test_one_false_detection_days_ago_does_not_hide_that_an_object_was_moved_there(
    earlier: int, number: int
) -> None:
    evidence = EvidenceMap(DEFAULT)
    for second in range(6):
        there = [square(3)] if second < earlier else []
        evidence.update(seen(square(-3), *there, stamp=second))
    for second in range(60):
        evidence.update(seen(square(3), stamp=DAY + second))
    chair = only(evidence)
    assert chair.id == number
    moved = chair.attributes.get("moved")
    assert (moved is None) if number else (moved["since"] == DAY)


def test_an_object_that_comes_back_is_the_same() -> None:
    evidence = after_a_move(other=NOWHERE)
    assert evidence.objects() == []
    for second in range(3):
        evidence.update(seen(square(-3), stamp=2 * DAY + second))
    assert only(evidence).id == 0


def test_what_was_gone_before_is_not_what_was_moved_since() -> None:
    evidence = EvidenceMap(DEFAULT)
    for second in range(6):
        evidence.update(seen(square(-3), square(-3, 2), stamp=second))
    for second in range(60):  # the second chair is taken away
        evidence.update(seen(square(-3), stamp=DAY + second))
    for second in range(6):  # the first one is seen elsewhere before anyone looks at its old place
        evidence.update(seen(square(3), area=RIGHT, stamp=2 * DAY + second))
    assert 0 in (ids := [item.id for item in evidence.objects()])
    assert len(ids) == 2
    for second in range(80):
        evidence.update(seen(square(3), stamp=2 * DAY + 10 + second))
    chair = only(evidence)
    assert (chair.id, chair.footprint.centroid.x) == (0, pytest.approx(3, abs=0.1))


def test_an_object_that_moves_to_where_another_was_stays_itself() -> None:
    evidence = EvidenceMap(DEFAULT)
    for second in range(6):
        evidence.update(seen(square(0), square(1.2), stamp=second))
    for second in range(60):  # the left one is taken away
        evidence.update(seen(square(1.2), stamp=DAY + second))
    for day, x in enumerate((0.8, 0.5), 2):
        for second in range(8):
            evidence.update(seen(square(x), stamp=day * DAY + second))
    assert only(evidence).id == 1


def test_what_moves_to_the_place_of_one_that_is_gone_stays_itself() -> None:
    evidence = EvidenceMap(DEFAULT)
    for second in range(6):
        evidence.update(seen(square(-3), square(3), stamp=second))
    for second in range(60):  # the left one is taken away
        evidence.update(seen(square(3), stamp=DAY + second))
    for second in range(80):  # the right one comes to its place
        evidence.update(seen(square(-3), stamp=2 * DAY + second))
    assert only(evidence).id == 1


def test_an_id_that_has_been_known_for_a_day_stays() -> None:
    """Only the third drive sees that the chair has left its first place."""
    evidence = EvidenceMap(DEFAULT)
    for second in range(6):
        evidence.update(seen(square(-3), stamp=second))
    for second in range(6):
        evidence.update(seen(square(3), area=RIGHT, stamp=DAY + second))
    assert [item.id for item in evidence.objects()] == [0, 1]
    for second in range(60):
        evidence.update(seen(square(3), stamp=2 * DAY + second))
    assert only(evidence).id == 1


@pytest.mark.parametrize(
    ("often", "misses", "ids"), [(4, 0, [0, 1]), (4, 6, [0]), (40, 0, [0, 1]), (40, 20, [0])]
)
def test_what_a_drive_has_missed_may_have_moved_though_it_is_not_gone(
    often: int, misses: int, ids: list[int]
) -> None:
    evidence = EvidenceMap(dataclasses.replace(DEFAULT, loss=0.5))
    for second in range(often):
        evidence.update(seen(square(-3), stamp=second))
    for second in range(30):
        area = ROOM if second < misses else RIGHT
        evidence.update(seen(square(0.6), area=area, stamp=DAY + second))
    assert [item.id for item in evidence.objects()] == ids


@pytest.mark.parametrize(("bottom", "is_same"), [(0.6, True), (0.1, False)])
def test_what_a_drive_sees_of_an_object_over_a_table_may_be_all_of_it(
    bottom: float, is_same: bool
) -> None:
    evidence, back = EvidenceMap(DEFAULT), shapely.box(-3.5, -2, -3.4, -1.2)
    for second in range(6):
        evidence.update(seen(square(-3), stamp=second))
    for second in range(60):
        evidence.update(seen(back, stamp=DAY + second, bottom=bottom))
    assert (only(evidence).id == 0) == is_same


@pytest.mark.parametrize(("length", "is_same"), [(1.0, True), (0.4, False)])
def test_of_what_was_seen_from_the_front_only_another_drive_may_see_all(
    length: float, is_same: bool
) -> None:
    evidence, front = EvidenceMap(DEFAULT), shapely.box(-3.03, -length / 2, -2.97, length / 2)
    for second in range(6):
        evidence.update(seen(front, stamp=second))
    for second in range(60):
        evidence.update(seen(square(0), stamp=DAY + second))
    assert (only(evidence).id == 0) == is_same


@pytest.mark.parametrize(("whole", "is_same"), [(3, True), (0, False)])
def test_views_of_a_part_do_not_tell_how_high_an_object_is(whole: int, is_same: bool) -> None:
    evidence = EvidenceMap(DEFAULT)
    for second in range(8):
        evidence.update(seen(square(-3), stamp=second, top=0.9 if second < whole else 0.5))
    for second in range(60):
        evidence.update(seen(square(0), stamp=DAY + second, top=0.9))
    assert (only(evidence).id == 0) == is_same


def test_what_three_frames_showed_may_have_been_moved() -> None:
    evidence = EvidenceMap(DEFAULT)
    for second in range(3):
        evidence.update(seen(square(-3), stamp=second))
    assert len(evidence.objects()) == 1
    for second in range(60):
        evidence.update(seen(square(0), stamp=DAY + second))
    assert only(evidence).id == 0


@pytest.mark.parametrize(("way", "is_same"), [(4.0, True), (14.0, False)])
def test_the_farther_away_something_appears_the_more_alike_it_must_be(
    way: float, is_same: bool
) -> None:
    evidence, building = EvidenceMap(DEFAULT), shapely.box(-20, -20, 20, 20)
    for second in range(6):
        evidence.update(seen(square(-3), stamp=second, area=building))
    for second in range(60):
        narrower = shapely.box(way - 3.3, -0.5, way - 2.7, 0.5)
        evidence.update(seen(narrower, stamp=DAY + second, area=building))
    assert (only(evidence).id == 0) == is_same


@pytest.mark.parametrize(("sofas", "is_same"), [(0, False), (8, True)])
def test_what_comes_is_hardly_another_one_of_a_rare_class(sofas: int, is_same: bool) -> None:
    evidence, building = EvidenceMap(DEFAULT), shapely.box(-20, -20, 20, 20)
    others = seen(*(square(2 * n - 8, 6) for n in range(sofas)), name="sofa", top=0.8).objects

    def look(chair: shapely.Polygon, stamp: float) -> None:
        observation = seen(chair, stamp=stamp, area=building)
        objects = (*observation.objects, *others)
        evidence.update(dataclasses.replace(observation, objects=objects))

    for second in range(6):
        look(square(-3), second)
    for second in range(60):
        look(shapely.box(8.75, -0.5, 9.25, 0.5), DAY + second)
    assert ([item.id for item in evidence.objects() if item.name == "chair"] == [0]) == is_same


@pytest.mark.parametrize(("top", "is_same"), [(0.9, True), (0.5, False)])
def test_what_stands_in_a_part_of_an_empty_place_is_another_one_if_its_height_is(
    top: float, is_same: bool
) -> None:
    evidence = EvidenceMap(DEFAULT)
    for second in range(6):
        evidence.update(seen(square(-3), stamp=second))
    for second in range(60):
        evidence.update(seen(square(-2.3), top=top, stamp=DAY + second))
    assert (only(evidence).id == 0) == is_same


def test_a_drawn_object_stays_where_it_is() -> None:
    drawn = SemanticObject("chair", square(-3), id=0)
    found = after_a_move(edit=HandEdit(drawn=drawn)).objects()
    assert shapely.equals(found[0].footprint, square(-3))


def test_a_few_views_of_an_object_keep_it_where_another_one_has_come_beside_it() -> None:
    evidence = EvidenceMap(DEFAULT)
    for second in range(6):
        evidence.update(seen(square(-3), stamp=second))
    for second in range(8):
        shapes = [square(-3)] if second < 2 else [square(-1.9)]
        evidence.update(seen(*shapes, stamp=DAY + second, area=RIGHT if second > 1 else ROOM))
    known, new = evidence.objects()
    assert (known.id, known.footprint.centroid.x) == (0, pytest.approx(-3, abs=0.05))
    assert "moved" not in new.attributes


@pytest.mark.parametrize("place", [-1.9, 3.0], ids=["beside", "elsewhere"])
def test_two_objects_that_one_frame_shows_are_not_one_that_was_moved(place: float) -> None:
    evidence = EvidenceMap(DEFAULT)
    for second in range(6):
        evidence.update(seen(square(-3), stamp=second))
    for second in range(60):  # soon after, the first one is taken away
        shapes = [square(-3), square(place)] if second < 2 else [square(place)]
        evidence.update(seen(*shapes, stamp=DAY + second))
    assert only(evidence).id != 0


def test_one_frame_alone_does_not_tell_that_two_objects_are_not_one() -> None:
    """It may have taken what is next to the old place for the object that was there."""
    evidence = EvidenceMap(DEFAULT)
    for second in range(6):
        evidence.update(seen(square(-3), stamp=second))
    for second in range(60):
        shapes = [square(-3), square(0)] if second < 1 else [square(0)]
        evidence.update(seen(*shapes, stamp=DAY + second))
    assert only(evidence).id == 0


def test_what_is_moved_is_decided_by_all_objects_together() -> None:
    """One of two equal chairs is taken away, the other one moved to where the first one stood."""
    evidence = EvidenceMap(DEFAULT)
    for second in range(6):
        evidence.update(seen(square(-3), square(-1.5), stamp=second))
    for second in range(60):
        evidence.update(seen(square(-1.1), stamp=DAY + second))
    chair = only(evidence)
    assert (chair.id, "moved" in chair.attributes) == (1, True)
