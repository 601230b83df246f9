"""Which tracks an observed shape belongs to."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import shapely

from hypermap.mapping.association import _widened, jaccard, overlap, radius
from hypermap.mapping.prepared_polygon import PreparedPolygon
from hypermap.mapping.stages import EvidenceConfig
from hypermap.mapping.track_shapes import TrackShapes

CHAIR, TABLE = 0, 1
CONFIG = EvidenceConfig()


def outline(xmin: float, ymin: float, xmax: float, ymax: float) -> PreparedPolygon:
    return PreparedPolygon.of(shapely.box(xmin, ymin, xmax, ymax))


def known(*boxes: tuple[float, float, float, float], class_: int = CHAIR) -> TrackShapes:
    shapes = TrackShapes()
    for box in boxes:
        shapes.append(class_, outline(*box))
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
    shape = outline(shift, 0, shift + 3, 1)
    assert jaccard(shape, CHAIR, known((0, 0, 3, 1)), CONFIG) == expected


def test_jaccard_misses_the_corner_of_a_table_that_overlap_finds() -> None:
    table = known((0, 0, 2, 1))  # the corner is an eighth of it
    corner = outline(0, 0, 0.5, 0.5)
    assert jaccard(corner, CHAIR, table, CONFIG) == []
    assert overlap(corner, CHAIR, table, CONFIG) == [0]


@pytest.mark.parametrize(
    ("shared", "expected"), [(0.35, [0]), (0.349, [])], ids=["just enough", "too little"]
)
def test_overlap_asks_for_a_third_of_the_smaller_one(shared: float, expected: list[int]) -> None:
    shape = outline(-1 + shared, 0, shared, 1)
    config = dataclasses.replace(CONFIG, slack=0.0)
    assert overlap(shape, CHAIR, known((0, 0, 5, 5)), config) == expected


@pytest.mark.parametrize(
    ("gap", "expected"), [(0.01, [0]), (0.04, [])], ids=["a little off", "too far off"]
)
def test_slack_finds_a_thin_thing_beside_itself(gap: float, expected: list[int]) -> None:
    monitor = known((0, 0, 0.06, 0.5))
    again = outline(0.06 + gap, 0, 0.12 + gap, 0.49)
    assert overlap(again, CHAIR, monitor, dataclasses.replace(CONFIG, slack=0)) == []
    assert overlap(again, CHAIR, monitor, CONFIG) == expected


def test_slack_does_not_join_neighbours() -> None:
    cups = known((0, 0, 0.09, 0.09))
    assert overlap(outline(0.09, 0, 0.18, 0.09), CHAIR, cups, CONFIG) == []


@pytest.mark.parametrize(
    ("near_edge", "expected"),
    [(0.49, [0]), (0.5, [0]), (0.51, [])],
    ids=["inside the box", "at its edge", "outside"],
)
def test_radius_matches_what_reaches_into_the_box(near_edge: float, expected: list[int]) -> None:
    shape = outline(-0.1, -0.1, 0.1, 0.1)
    shapes = known((near_edge, -0.1, near_edge + 5, 0.1))
    assert radius(shape, CHAIR, shapes, CONFIG) == expected


def test_radius_takes_a_box_and_not_a_circle() -> None:
    shape = outline(-0.1, -0.1, 0.1, 0.1)
    in_the_corner = known((0.45, 0.45, 1, 1))  # 0.64 m away
    assert radius(shape, CHAIR, in_the_corner, CONFIG) == [0]


@pytest.mark.parametrize("associate", [jaccard, overlap, radius])
def test_only_objects_of_the_same_class_match(associate: object) -> None:
    shapes = known((0, 0, 1, 1), class_=TABLE)
    assert len(associate(outline(0, 0, 1, 1), CHAIR, shapes, CONFIG)) == 0


@pytest.mark.parametrize("associate", [jaccard, overlap, radius])
def test_nothing_matches_in_an_empty_map(associate: object) -> None:
    assert len(associate(outline(0, 0, 1, 1), CHAIR, TrackShapes(), CONFIG)) == 0


def test_the_best_match_comes_first_and_of_equal_ones_the_oldest() -> None:
    shape = outline(0, 0, 1, 1)
    shapes = known((0, 0, 1, 2), (0, 0, 1, 1.25), (0, 0, 1, 2))
    assert jaccard(shape, CHAIR, shapes, CONFIG) == [1, 0, 2]


def test_of_two_that_hold_the_whole_shape_the_oldest_comes_first() -> None:
    # All of the shape's area is shared with both, but summed up in different pieces.
    hexagon = shapely.Point(0.1, 0.2).buffer(0.3, quad_segs=3)
    shapes = known((-1, -1, 1, 1))
    shapes.append(CHAIR, PreparedPolygon.of(shapely.Point(0.13, 0.17).buffer(0.9, quad_segs=7)))
    assert overlap(PreparedPolygon.of(hexagon), CHAIR, shapes, CONFIG) == [0, 1]


def test_the_nearest_comes_first_for_radius() -> None:
    shape = outline(-0.1, -0.1, 0.1, 0.1)
    assert radius(shape, CHAIR, known((0.4, 0, 1, 1), (0.2, 0, 1, 1)), CONFIG) == [1, 0]


def test_a_threshold_of_zero_still_asks_for_some_shared_area() -> None:
    config = dataclasses.replace(CONFIG, min_jaccard=0.0)
    touching = known((1, 0, 2, 1))
    assert jaccard(outline(0, 0, 1, 1), CHAIR, touching, config) == []


def test_removing_a_row_moves_the_later_ones_up() -> None:
    shapes = known((0, 0, 1, 1), (2, 0, 3, 1), (4, 0, 5, 1))
    shapes.keep(np.array([0, 2]))
    assert len(shapes) == 2
    assert shapes.near(CHAIR, (4.5, 0.5, 4.5, 0.5)) == [1]
    assert [shape.area for shape in shapes.polygons] == [1, 1]


@pytest.mark.parametrize("sharp", [0.05, 1.0])  # buffering cuts sharp corners off
@pytest.mark.parametrize("seed", range(4))
def test_a_hull_is_widened_as_shapely_buffers_it(seed: int, sharp: float) -> None:
    corners = np.random.default_rng(seed).uniform(-1, 1, (6, 2)) * (1, sharp)
    hull = shapely.convex_hull(shapely.multipoints(corners))
    for shape in (hull, hull.reverse(), shapely.Polygon([*corners]).buffer(0)):
        expected = shapely.buffer(shape, 0.01, join_style="mitre")
        found = _widened(PreparedPolygon.of(shape), 0.01).geometry
        assert shapely.hausdorff_distance(found, expected) < 1e-9
