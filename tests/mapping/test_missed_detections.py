"""What another drive does not find is gone, or stays: by where its rays end."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import shapely

from hypermap.core.semantic import SemanticObject
from hypermap.mapping.evidence import EvidenceMap

from .evidence_tools import CHAIR, DAY, DEFAULT, level, seen, square, viewed


def test_what_stood_by_a_wall_is_gone_where_another_drive_sees_the_wall() -> None:
    evidence = EvidenceMap(DEFAULT)
    for second in range(6):
        evidence.update(viewed(seen(CHAIR, stamp=second), level(2.0)))
    for second in range(4):
        evidence.update(viewed(seen(stamp=DAY + second), level(2.4)))  # 0.1 m behind the chair
    assert evidence.objects() == []


def after_looks_of_another_drive(
    shape: shapely.Polygon, *shown: shapely.Polygon, name: str = "chair"
) -> list[SemanticObject]:
    """Return the objects left after 12 looks at one that was seen often; rays end in its place.

    Args:
        shape: of the object.
        shown: what all these looks show.
        name: its class.
    """
    evidence = EvidenceMap(DEFAULT)
    for second in range(12):
        evidence.update(viewed(seen(shape, stamp=second), level(2.0)))
    for second in range(12):
        evidence.update(viewed(seen(*shown, name=name, stamp=DAY + second), level(2.0)))
    return evidence.objects()


SMALL = square(2.05, side=0.2)


def test_an_object_that_was_seen_often_is_gone_after_a_few_looks_of_another_drive() -> None:
    assert after_looks_of_another_drive(SMALL) == []
    seen_once_more = EvidenceMap(DEFAULT)
    for stamp in (*range(12), DAY):
        seen_once_more.update(viewed(seen(SMALL, stamp=stamp), level(2.0)))
    for second in range(1, 12):
        seen_once_more.update(viewed(seen(stamp=DAY + second), level(2.0)))
    assert len(seen_once_more.objects()) == 1


def test_a_large_object_that_is_not_detected_stays_while_rays_end_in_its_place() -> None:
    assert [item.id for item in after_looks_of_another_drive(CHAIR)] == [0]


def test_a_large_object_is_gone_where_another_one_is_shown_in_its_place() -> None:
    beside = shapely.box(1.9, 0.2, 2.4, 0.7)
    left = after_looks_of_another_drive(CHAIR, beside, name="bin")
    assert [item.name for item in left] == ["bin"]
    away = shapely.box(1.9, 0.5, 2.4, 1.0)
    left = after_looks_of_another_drive(CHAIR, away, name="bin")
    assert [item.name for item in left] == ["chair", "bin"]


@pytest.mark.parametrize(("often", "is_there"), [(12, False), (6, True)])
def test_many_views_of_an_empty_part_tell_that_an_object_that_was_seen_often_has_left(
    often: int, is_there: bool
) -> None:
    evidence, wall, someone = EvidenceMap(DEFAULT), level(4.0), level(1.0)
    is_left = np.arange(wall.reach.shape[1]) < 0.47 * wall.reach.shape[1]
    left = dataclasses.replace(wall, reach=np.where(is_left, wall.reach, someone.reach))
    for second in range(often):
        evidence.update(viewed(seen(CHAIR, stamp=second), level(2.0)))
    for second in range(20):
        evidence.update(viewed(seen(stamp=DAY + second), left))
    assert bool(evidence.objects()) == is_there


def test_what_is_gone_for_long_costs_little() -> None:
    evidence = EvidenceMap(dataclasses.replace(DEFAULT, gone_loss=10.0, loss=10.0))
    for number in range(60):
        place = square(-3 + 0.1 * number, side=0.05)
        for second in range(4):
            name = f"thing {number}"
            evidence.update(seen(place, name=name, stamp=1000.0 * number + second))
        for second in range(5):
            evidence.update(seen(stamp=1000.0 * number + 10 + second))
    assert evidence.objects() == []
    assert len(evidence.tracks().objects) == 50
