"""Which known objects an observed shape belongs to."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import shapely

from hypermap.mapping.association import KnownShapes, jaccard, overlap, radius
from hypermap.mapping.stages import EvidenceConfig

CHAIR, TABLE = 0, 1
CONFIG = EvidenceConfig()


def known(*boxes: tuple[float, float, float, float], class_: int = CHAIR) -> KnownShapes:
    shapes = KnownShapes()
    for box in boxes:
        shapes.append(class_, shapely.box(*box))
    return shapes


@pytest.mark.parametrize(
    ("shift", "expected"),
    [
        # Two 3 x 1 boxes; shifted by s they share 3 - s of 3 + s. A fifth exactly at s = 2.
        (2.0, [0]),
        (2.001, []),
        (0.0, [0]),
        (3.0, []),  # they only touch
    ],
)
def test_jaccard_matches_from_a_fifth_on(shift: float, expected: list[int]) -> None:
    shape = shapely.box(shift, 0, shift + 3, 1)
    assert jaccard(shape, CHAIR, known((0, 0, 3, 1)), CONFIG).tolist() == expected


def test_jaccard_misses_the_corner_of_a_table_that_overlap_finds() -> None:
    table = known((0, 0, 2, 1))  # the corner is an eighth of it
    corner = shapely.box(0, 0, 0.5, 0.5)
    assert jaccard(corner, CHAIR, table, CONFIG).tolist() == []
    assert overlap(corner, CHAIR, table, CONFIG).tolist() == [0]


@pytest.mark.parametrize(
    ("shared", "expected"), [(0.35, [0]), (0.349, [])], ids=["just enough", "too little"]
)
def test_overlap_asks_for_a_third_of_the_smaller_one(shared: float, expected: list[int]) -> None:
    shape = shapely.box(-1 + shared, 0, shared, 1)
    config = dataclasses.replace(CONFIG, slack=0.0)
    assert overlap(shape, CHAIR, known((0, 0, 5, 5)), config).tolist() == expected


@pytest.mark.parametrize(
    ("gap", "expected"), [(0.01, [0]), (0.04, [])], ids=["a little off", "too far off"]
)
def test_slack_finds_a_thin_thing_beside_itself(gap: float, expected: list[int]) -> None:
    monitor = known((0, 0, 0.06, 0.5))
    again = shapely.box(0.06 + gap, 0, 0.12 + gap, 0.49)
    assert overlap(again, CHAIR, monitor, dataclasses.replace(CONFIG, slack=0)).tolist() == []
    assert overlap(again, CHAIR, monitor, CONFIG).tolist() == expected


def test_slack_does_not_join_neighbours() -> None:
    cups = known((0, 0, 0.09, 0.09))
    assert overlap(shapely.box(0.09, 0, 0.18, 0.09), CHAIR, cups, CONFIG).tolist() == []


@pytest.mark.parametrize(
    ("near_edge", "expected"),
    [(0.49, [0]), (0.5, [0]), (0.51, [])],
    ids=["inside the box", "at its edge", "outside"],
)
def test_radius_matches_what_reaches_into_the_box(near_edge: float, expected: list[int]) -> None:
    shape = shapely.box(-0.1, -0.1, 0.1, 0.1)
    shapes = known((near_edge, -0.1, near_edge + 5, 0.1))
    assert radius(shape, CHAIR, shapes, CONFIG).tolist() == expected


def test_radius_takes_a_box_and_not_a_circle() -> None:
    shape = shapely.box(-0.1, -0.1, 0.1, 0.1)
    in_the_corner = known((0.45, 0.45, 1, 1))  # 0.64 m away
    assert radius(shape, CHAIR, in_the_corner, CONFIG).tolist() == [0]


@pytest.mark.parametrize("associate", [jaccard, overlap, radius])
def test_only_objects_of_the_same_class_match(associate: object) -> None:
    shapes = known((0, 0, 1, 1), class_=TABLE)
    assert len(associate(shapely.box(0, 0, 1, 1), CHAIR, shapes, CONFIG)) == 0


@pytest.mark.parametrize("associate", [jaccard, overlap, radius])
def test_nothing_matches_in_an_empty_map(associate: object) -> None:
    assert len(associate(shapely.box(0, 0, 1, 1), CHAIR, KnownShapes(), CONFIG)) == 0


def test_the_best_match_comes_first_and_of_equal_ones_the_oldest() -> None:
    shape = shapely.box(0, 0, 1, 1)
    shapes = known((0, 0, 1, 2), (0, 0, 1, 1.25), (0, 0, 1, 2))
    assert jaccard(shape, CHAIR, shapes, CONFIG).tolist() == [1, 0, 2]


def test_the_nearest_comes_first_for_radius() -> None:
    shape = shapely.box(-0.1, -0.1, 0.1, 0.1)
    assert radius(shape, CHAIR, known((0.4, 0, 1, 1), (0.2, 0, 1, 1)), CONFIG).tolist() == [1, 0]


def test_a_threshold_of_zero_still_asks_for_some_shared_area() -> None:
    config = dataclasses.replace(CONFIG, min_jaccard=0.0)
    touching = known((1, 0, 2, 1))
    assert jaccard(shapely.box(0, 0, 1, 1), CHAIR, touching, config).tolist() == []


def test_removing_a_row_moves_the_later_ones_up() -> None:
    shapes = known((0, 0, 1, 1), (2, 0, 3, 1), (4, 0, 5, 1))
    shapes.remove(np.array([1]))
    assert len(shapes) == 2
    assert shapes.near(CHAIR, np.array([4.5, 0.5, 4.5, 0.5])).tolist() == [1]
    assert shapes.areas.tolist() == [1, 1]
