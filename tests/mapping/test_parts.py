"""Parts of one object that together are as large as others of its class become one."""

from __future__ import annotations

import dataclasses
import math

import pytest
import shapely
from tests.mapping.evidence_tools import DEFAULT, published_all, seen

from hypermap.core.semantic import SemanticObject
from hypermap.mapping.config import profile
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.mapper import Mapper
from hypermap.mapping.parts import joined_parts
from hypermap.mapping.perceived import no_detections


def shelf(number: int, begin: float, end: float, row: float = 0.0) -> SemanticObject:
    measured = {"evidence": number, "z_min": 0.1 * number, "z_max": 1.0 + number}
    shape = shapely.box(begin, row, end, row + 0.6)
    return SemanticObject("shelf", shape, id=number, attributes=measured)


OTHERS = [shelf(number, 0, 2, row=2.0 * number) for number in (1, 2, 3, 4)]


def joined(*parts: SemanticObject, are_one: bool = True, fixed: tuple[int, ...] = ()) -> list[int]:
    found = joined_parts([*OTHERS, *parts], lambda *_: are_one, 1.3, fixed)
    return [item.id or 0 for item in found[len(OTHERS) :]]


def test_two_ends_of_a_shelf_become_one_of_usual_size() -> None:
    *_, whole = joined_parts([*OTHERS, shelf(5, 0, 0.9), shelf(6, 1, 2)], lambda *_: True, 1.3)
    assert whole.id == 5
    assert whole.footprint.equals(shapely.box(0, 0, 2, 0.6))
    assert whole.attributes == {"evidence": 11, "z_min": 0.5, "z_max": 7.0}


def test_what_is_joined_was_seen_when_its_newer_part_was() -> None:
    parts = shelf(5, 0, 0.9), dataclasses.replace(shelf(6, 1, 2), last_seen=7.0)
    *_, whole = joined_parts([*OTHERS, *parts], lambda *_: True, 1.3)
    assert whole.last_seen == 7


def add_shelf_in_two_parts(evidence: EvidenceMap) -> None:
    others = [shapely.box(0, row, 2, row + 0.6) for row in (2, 4, 6, 8)]
    for part in (shapely.box(0, 0, 0.9, 0.6), shapely.box(1, 0, 2, 0.6)):
        for _ in range(3):
            evidence.update(seen(part, *others, area=shapely.union_all([part, *others])))


def test_a_layer_before_the_final_one_and_after_it_has_the_whole_object() -> None:
    evidence = EvidenceMap(published_all(DEFAULT))
    add_shelf_in_two_parts(evidence)

    def areas(is_final: bool) -> list[float]:
        return [round(item.footprint.area, 1) for item in evidence.layer(is_final=is_final)]

    assert areas(False) == areas(True) == areas(False) == [1.2] * 5


@pytest.mark.parametrize(
    ("edit", "expected"),
    [
        (lambda layer: layer.remove([0]), []),
        (lambda layer: layer.rename(0, "couch"), [("couch", 1.2)]),
        (lambda layer: layer.rename(1, "couch"), [("chair", 1.2)]),
        (
            lambda layer: layer.update(
                0, dataclasses.replace(layer.get(0), footprint=shapely.box(0, 0, 2.1, 0.6))
            ),
            [("chair", 1.26)],
        ),
    ],
)
def test_an_edit_of_the_whole_is_one_of_its_parts(edit, expected: list[object]) -> None:
    config = dataclasses.replace(profile("default"), evidence=published_all(DEFAULT))
    mapper = Mapper(config, no_detections)
    add_shelf_in_two_parts(mapper.evidence)
    for _ in range(2):  # the second time, the edit is in the state of the mapper
        hypermap = mapper.hypermap()
        edit(hypermap.semantic())
        mapper = Mapper.onto(hypermap, no_detections)
        edit = len
    found = [item for item in mapper.hypermap().semantic() if item.footprint.bounds[1] < 1]
    assert [(item.name, round(item.footprint.area, 2)) for item in found] == expected


def test_three_parts_become_one() -> None:
    assert joined(shelf(5, 0, 0.6), shelf(6, 0.7, 1.3), shelf(7, 1.4, 2)) == [5]


def test_what_would_be_too_large_or_is_too_far_or_of_usual_size_stays() -> None:
    assert joined(shelf(5, 0, 1.4), shelf(6, 1.5, 2.9)) == [5, 6]
    assert joined(shelf(5, 0, 0.7), shelf(6, 0.9, 1.6)) == [5, 6]
    assert joined(shelf(5, 0, 1.8), shelf(6, 0.1, 1.9)) == [5, 6]


def test_what_frames_show_together_or_people_have_edited_stays() -> None:
    parts = shelf(5, 0, 0.9), shelf(6, 1, 2)
    assert joined(*parts) == [5]
    assert joined(*parts, are_one=False) == [5, 6]
    assert joined(*parts, fixed=(6,)) == [5, 6]


def test_the_usual_size_of_a_class_is_known_from_four_objects_on() -> None:
    parts = [shelf(5, 0, 0.9), shelf(6, 1, 2)]
    assert len(joined_parts([OTHERS[0], *parts], lambda *_: True, math.inf)) == 3
    assert joined_parts([], lambda *_: True, 1.3) == []
