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
