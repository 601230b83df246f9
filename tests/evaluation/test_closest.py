"""The thesis' measure, worked out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from hypermap.core.frames import Pose2D
from hypermap.core.semantic import SemanticObject
from hypermap.evaluation.closest import closest_shapes
from hypermap.testing import square


def bar(name: str, x0: float, x1: float) -> SemanticObject:
    """An object one meter deep from x0 to x1."""
    return SemanticObject(name, shapely.box(x0, 0, x1, 1))


def test_the_shape_measure_moves_the_nearest_object_onto_the_true_one() -> None:
    # A bar of 2 m next to one of 4 m: moved onto each other they share 2 of 4 square meters.
    (closest,) = closest_shapes([bar("sofa", 100, 140), bar("sofa", 11, 13)], [bar("sofa", 0, 4)])
    assert (closest.ground_truth, closest.estimate) == (0, 1)
    assert closest.distance == pytest.approx(10)
    assert closest.iou == pytest.approx(0.5)


def test_one_estimated_object_may_be_the_nearest_of_several() -> None:
    closest = closest_shapes([bar("cup", 0, 1)], [bar("cup", 2, 3), bar("cup", 5, 6)])
    assert [(c.estimate, c.distance) for c in closest] == [
        (0, pytest.approx(2)),
        (0, pytest.approx(5)),
    ]


def test_a_near_object_of_another_class_does_not_count() -> None:
    (closest,) = closest_shapes([square("cup", 0, 0), square("sink", 3, 4)], [square("sink", 0, 0)])
    assert (closest.estimate, closest.distance, closest.iou) == (1, 5.0, 1.0)


def test_true_objects_whose_class_the_estimate_lacks_are_left_out() -> None:
    truth = [square("cup", 0, 0), square("sink", 1, 0), square("cup", 2, 0)]
    assert [c.ground_truth for c in closest_shapes([square("cup", 9, 9)], truth)] == [0, 2]
    assert closest_shapes([], truth) == ()
    assert closest_shapes(truth, []) == ()


def test_shapes_are_moved_but_not_turned() -> None:
    # A bar of 4 x 1 m across one of 1 x 4 m: 1 m2 of 7 is shared.
    across = SemanticObject("bed", shapely.box(10, 10, 11, 14))
    (closest,) = closest_shapes([across], [bar("bed", 0, 4)])
    assert closest.iou == pytest.approx(1 / 7)


def test_an_outline_that_crosses_itself_counts_as_what_it_winds_around() -> None:
    # Two triangles of 1/4 m2 in the square; the centroid of both together is the middle.
    bow_tie = SemanticObject("mat", shapely.Polygon([(5, 5), (6, 6), (6, 5), (5, 6)]))
    (closest,) = closest_shapes([bow_tie], [bar("mat", 0, 1)])
    assert closest.iou == pytest.approx(0.5)
    assert closest.distance == pytest.approx(math.hypot(5, 5))


def test_the_published_map_of_the_laboratory_against_a_shifted_copy(shared_data) -> None:
    from hypermap.formats import open_map

    objects = open_map(shared_data / "maps" / "lab.hmap")["semantic"].objects()
    moved = [
        SemanticObject(o.name, Pose2D(x=0.006, y=-0.008).apply_geometry(o.footprint))
        for o in objects
    ]
    closest = closest_shapes(moved, objects)
    assert [(c.estimate, c.ground_truth) for c in closest] == [(i, i) for i in range(28)]
    assert [c.distance for c in closest] == pytest.approx([0.01] * 28)
    assert [c.iou for c in closest] == pytest.approx([1.0] * 28)


places = st.integers(-20, 20).map(float)
things = st.lists(
    st.builds(
        square, st.sampled_from(["cup", "chair"]), places, places, st.sampled_from([1, 2, 3])
    ),
    max_size=6,
)


@given(things, things)
def test_it_agrees_with_a_search_through_all_pairs(
    estimate: list[SemanticObject], truth: list[SemanticObject]
) -> None:
    by_true = {c.ground_truth: c for c in closest_shapes(estimate, truth)}
    for j, true in enumerate(truth):
        same = [thing for thing in estimate if thing.name == true.name]
        assert (j in by_true) == bool(same)
        if same:
            distances = [
                thing.footprint.centroid.distance(true.footprint.centroid) for thing in same
            ]
            assert by_true[j].distance == pytest.approx(min(distances))
            # Squares about the same center: the smaller over the larger.
            chosen = estimate[by_true[j].estimate].footprint.area
            areas = sorted([chosen, true.footprint.area])
            assert by_true[j].iou == pytest.approx(areas[0] / areas[1])


@given(things, things, places, places)
def test_moving_the_estimate_changes_no_shape_of_an_only_object(
    estimate: list[SemanticObject], truth: list[SemanticObject], x: float, y: float
) -> None:
    estimate = estimate[:1]
    moved = [SemanticObject(o.name, Pose2D(x, y).apply_geometry(o.footprint)) for o in estimate]
    before, after = closest_shapes(estimate, truth), closest_shapes(moved, truth)
    assert np.array([c.iou for c in after]) == pytest.approx(np.array([c.iou for c in before]))
