"""Objects that are moved while a drive goes on keep their ids."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from typing import Any

import pytest
import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.mapping.by_hand import HandEdit
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.stages import EvidenceConfig

from .evidence_tools import DEFAULT, NOWHERE, ROOM, THESIS, only, seen, square

RIGHT = shapely.box(0, -10, 10, 10)
BUILDING = shapely.box(-20, -20, 20, 20)
LEFT = shapely.box(-10, -10, 0, 10)
"""Where the chair stands first, at (-3, 0); from here it comes to (3, 0)."""


def look(
    evidence: EvidenceMap,
    stamps: Iterable[float],
    *shapes: BaseGeometry,
    area: BaseGeometry = ROOM,
    name: str = "chair",
    top: float = 0.9,
) -> None:
    """Add frames with these stamps that all show the same."""
    for stamp in stamps:
        evidence.update(seen(*shapes, area=area, name=name, top=top, stamp=stamp))


def after_a_move(
    config: EvidenceConfig = DEFAULT,
    *,
    before: int = 6,
    first_area: shapely.Polygon = ROOM,
    other: shapely.Polygon | None = None,
    name: str = "chair",
    top: float = 0.9,
    edit: HandEdit | None = None,
) -> EvidenceMap:
    """Return a map of a chair that was seen at (-3, 0), and then not there but at (3, 0).

    Args:
        config: of the map.
        before: how many frames show it at its first place.
        first_area: what these frames see.
        other: its shape at the other place; as it was before if None.
        name: its class there.
        top: how high it is there [m]; 0.9 before.
        edit: by hand, between the two.
    """
    evidence = EvidenceMap(config)
    look(evidence, range(before), square(-3), area=first_area)
    if edit is not None:
        evidence.go_on_with(evidence.tracks(), {0: edit})
    there = square(3) if other is None else other
    look(evidence, range(10, 70), there, name=name, top=top)
    return evidence


@pytest.mark.parametrize("top", [0.9, 0.8], ids=["as high", "nearly as high"])
def test_an_object_that_was_moved_keeps_its_id_and_says_how_surely(top: float) -> None:
    chair = only(after_a_move(top=top))
    assert (chair.id, chair.first_seen, chair.last_seen) == (0, 0.0, 69.0)
    assert chair.footprint.intersection(square(3)).area == pytest.approx(1, abs=0.1)
    assert chair.attributes["moved"] == {"confidence": pytest.approx(1.0, abs=0.1), "since": 10}
    assert chair.attributes["evidence"] == 60


@pytest.mark.parametrize(
    "what",
    [
        {"first_area": LEFT},  # the other place had not been looked at: perhaps it was there
        {"before": 3},  # which may have been wrong
        {"other": square(3, side=2)},
        {"other": square(18), "first_area": BUILDING},
        {"name": "table"},
        {"top": 0.7},
        {"top": 1.2},
        {"config": THESIS},
        {"edit": HandEdit(name="Anna's chair")},
    ],
    ids=[
        "not looked at",
        "seldom seen",
        "another size",
        "far away",
        "another class",
        "lower",
        "higher",
        "thesis",
        "renamed",
    ],
)
def test_otherwise_it_is_another_object(what: dict[str, Any]) -> None:
    found = {item.id: item for item in after_a_move(**what).objects()}
    (new,) = (item for number, item in found.items() if number != 0)
    assert "moved" not in new.attributes
    assert new.first_seen == 10


def test_two_objects_that_a_frame_shows_are_not_one_that_was_moved() -> None:
    evidence = EvidenceMap(DEFAULT)
    look(evidence, range(6), square(-3))
    look(evidence, [2000, 4000], area=RIGHT)
    look(evidence, [5000], square(-3), square(3))
    look(evidence, range(5001, 5060), square(3))
    assert only(evidence).id == 1


def test_an_object_is_not_one_of_another_class_that_has_left_nearer_by() -> None:
    evidence = EvidenceMap(DEFAULT)
    for second in range(6):
        chair, table = (seen(square(-3, y), name=n) for n, y in (("chair", 0), ("table", 2)))
        objects = (*chair.objects, *table.objects)
        evidence.update(dataclasses.replace(chair, stamp=second, objects=objects))
    look(evidence, range(10, 70), square(3), name="table")
    assert (only(evidence).id, only(evidence).name) == (1, "table")


def test_of_two_equal_objects_that_were_moved_neither_is_sure() -> None:
    evidence = EvidenceMap(DEFAULT)
    look(evidence, range(6), square(-3), square(-3, 2))
    look(evidence, range(10, 70), square(3), square(3, 2))
    found = evidence.objects()
    assert [item.id for item in found] == [0, 1]
    for item in found:
        assert item.attributes["moved"]["confidence"] == pytest.approx(0.5, abs=0.1)
        assert item.footprint.centroid.y == pytest.approx(2 if item.id else 0, abs=0.05)


def test_of_two_the_one_that_was_gone_an_hour_before_was_not_moved() -> None:
    evidence = EvidenceMap(DEFAULT)
    look(evidence, range(6), square(-3), square(2, 3))
    look(evidence, range(10, 70), square(-3))  # the nearer one is taken away
    look(evidence, range(2000, 8000, 2000), area=RIGHT)  # nobody looks at the other one
    look(evidence, range(8000, 8080), square(3))
    assert only(evidence).id == 0


def test_an_id_that_has_been_known_for_an_hour_stays() -> None:
    """Nobody looks at the old place before."""
    evidence = EvidenceMap(DEFAULT)
    look(evidence, range(6), square(-3))
    look(evidence, range(10, 5000, 499), square(3), area=RIGHT)
    look(evidence, range(5000, 5060), square(3))
    assert only(evidence).id == 1


def test_an_object_that_is_back_in_its_place_has_all_of_its_evidence() -> None:
    evidence = EvidenceMap(DEFAULT)
    look(evidence, range(6), square(-3))
    look(evidence, range(10, 90))
    assert evidence.objects() == []
    look(evidence, range(90, 96), square(-2.9))
    chair = only(evidence)
    assert (chair.id, chair.attributes["evidence"]) == (0, 12)
    assert "moved" not in chair.attributes
    assert chair.footprint.centroid.x == pytest.approx(-2.95, abs=0.06)


def test_a_frame_shows_a_moved_object_by_its_id() -> None:
    evidence = after_a_move(other=NOWHERE)
    for second in range(70, 75):
        look(evidence, [second], square(3))
        (number,) = (number for _, number in evidence.shown)
        assert number in {track.id for track in evidence.tracks().objects}
    assert number == 0


def test_frames_that_differ_a_little_are_no_move() -> None:
    evidence = EvidenceMap(DEFAULT)
    for second in range(16):
        evidence.update(seen(square(0.4 if second % 2 else 0.0), stamp=second))
    assert "moved" not in only(evidence).attributes
