"""Which tracks are of one object although frames have shown both."""

from __future__ import annotations

import dataclasses

import pytest
import shapely

from hypermap.mapping.merge_rules import MergeRules
from hypermap.mapping.published import PublishedTracks

from .evidence_tools import DEFAULT, square, tracks_of

CHAIR = square(0)
PART = shapely.box(-0.3, -0.5, 0.5, 0.5)


def are_one(part: shapely.Polygon, often: int, both: int, seldom: int = 6) -> bool:
    """Return whether a chair that was seen `often` and what was seen `seldom` may be one."""
    table = tracks_of((CHAIR, often), (part, seldom))
    one, other = table.objects
    one.co_occurrences[other.id] = other.co_occurrences[one.id] = both
    config = dataclasses.replace(DEFAULT, completion="none")
    rules = MergeRules(PublishedTracks(table, config, None, is_edited=False), observed=())
    return rules.are_one(0, 1)


@pytest.mark.parametrize(("often", "is_one"), [(20, True), (19, False)])
def test_a_part_that_few_of_the_frames_show_beside_the_rest_is_no_object(
    often: int, is_one: bool
) -> None:
    assert are_one(PART, often, both=6) == is_one
    assert are_one(PART, often, both=3)  # so few frames do not count
    assert are_one(PART, often, both=0)


def test_what_is_mostly_beside_is_another_object_however_seldom_it_is_seen() -> None:
    assert not are_one(shapely.box(0, -0.5, 1, 0.5), 60, both=6)


def in_a_row(first: shapely.Polygon, *others: shapely.Polygon, views: int = 6) -> bool:
    """Return whether a bench and the next one may be one that no frame has shown together."""
    table = tracks_of(*((shape, views) for shape in (first, *others)))
    config = dataclasses.replace(DEFAULT, completion="none")
    return MergeRules(PublishedTracks(table, config, None, is_edited=False), ()).are_one(0, 1)


def test_benches_in_a_row_are_not_one_that_is_longer_than_any_view() -> None:
    bench, next_one = shapely.box(0, 0, 0.5, 1.9), shapely.box(0, 1.5, 0.5, 3.8)
    assert not in_a_row(bench, next_one)
    assert in_a_row(bench, next_one, shapely.box(5, 0, 5.5, 3.8))  # others are as long


def test_what_poses_have_put_to_two_places_is_one() -> None:
    assert in_a_row(square(0, side=0.06), square(0.05, side=0.06))
    assert in_a_row(shapely.box(0, 0, 0.65, 0.85), shapely.box(0, 0.14, 0.77, 0.95))
