"""Which estimated object is which true one."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from hypermap.core.semantic import SemanticObject
from hypermap.evaluation.matching import iou_matrix, match_objects


def square(x: float, y: float, side: float = 1.0) -> shapely.Polygon:
    return shapely.box(x, y, x + side, y + side)


def thing(name: str, x: float, y: float, side: float = 1.0) -> SemanticObject:
    return SemanticObject(name, square(x, y, side))


boxes = st.builds(
    square,
    st.integers(0, 6).map(float),
    st.integers(0, 6).map(float),
    st.integers(1, 4).map(float),
)
objects = st.lists(st.builds(SemanticObject, st.sampled_from(["cup", "chair"]), boxes), max_size=6)


def test_iou_is_the_shared_area_over_the_area_of_both_together() -> None:
    # Two unit squares that overlap by half: 0.5 shared, 1.5 together. Worked by hand.
    iou = iou_matrix([square(0, 0)], [square(0.5, 0), square(0, 0), square(1, 0), square(5, 5)])
    assert iou == pytest.approx(np.array([[1 / 3, 1.0, 0.0, 0.0]]))


def test_iou_of_a_shape_with_a_hole_and_of_one_in_two_pieces() -> None:
    frame = square(0, 0, 3).difference(square(1, 1))  # 9 - 1
    pieces = shapely.MultiPolygon([square(0, 0), square(2, 2)])
    assert iou_matrix([frame], [square(0, 0, 3), pieces]) == pytest.approx(
        np.array([[8 / 9, 2 / 8]])
    )


def test_shapes_without_area_have_no_iou_rather_than_an_error() -> None:
    line = shapely.LineString([(0, 0), (1, 1)])
    assert iou_matrix([line, shapely.Polygon()], [line]).tolist() == [[0.0], [0.0]]


def test_a_ring_that_crosses_itself_is_compared_by_the_area_it_encloses() -> None:
    bow_tie = shapely.Polygon([(0, 0), (1, 1), (1, 0), (0, 1)])  # two triangles of 1/4 each
    assert iou_matrix([bow_tie], [square(0, 0)]) == pytest.approx(np.array([[0.5]]))


def test_nothing_matches_nothing() -> None:
    assert match_objects([], []) == ()
    assert match_objects([thing("cup", 0, 0)], []) == ()
    assert match_objects([], [thing("cup", 0, 0)]) == ()


def test_objects_of_different_names_do_not_match() -> None:
    assert match_objects([thing("cup", 0, 0)], [thing("bowl", 0, 0)]) == ()


def test_each_object_matches_once_and_the_better_overlap_wins() -> None:
    estimate = [thing("cup", 0.5, 0), thing("cup", 0.1, 0)]
    (match,) = match_objects(estimate, [thing("cup", 0, 0)])
    assert (match.estimate, match.ground_truth) == (1, 0)
    assert match.iou == pytest.approx(0.9 / 1.1)


def bar(a: float, b: float) -> SemanticObject:
    return SemanticObject("bar", shapely.box(a, 0, b, 1))


def test_the_matching_has_the_largest_sum_not_the_best_first_pair() -> None:
    # [0, 4.5] overlaps [0, 4] by 4/4.5, the best pair of all, and [3, 7] by 1.5/7. Greedily,
    # [-1, 4] would be left with nothing of [3, 7] but 1/8; the other way round it is 4/5 + 1.5/7.
    truth = [bar(0, 4), bar(3, 7)]
    matches = match_objects([bar(0, 4.5), bar(-1, 4)], truth)
    assert 4 / 5 + 1.5 / 7 > 4 / 4.5 + 1 / 8
    assert [(m.estimate, m.ground_truth) for m in matches] == [(1, 0), (0, 1)]
    assert [m.iou for m in matches] == pytest.approx([4 / 5, 1.5 / 7])


def test_of_equal_sums_the_one_with_more_pairs_wins() -> None:
    # Exactly (IoU 1, and nothing left for the other), or two halves (1/2 + 1/2).
    whole, half = bar(0, 2), bar(0, 1)
    far = bar(1, 2)
    matches = match_objects([whole, half], [whole, far])
    assert [(m.estimate, m.ground_truth) for m in matches] == [(1, 0), (0, 1)]


def test_pairs_below_the_least_iou_do_not_match() -> None:
    estimate, truth = [thing("cup", 0.5, 0)], [thing("cup", 0, 0)]
    assert len(match_objects(estimate, truth, min_iou=0.33)) == 1
    assert match_objects(estimate, truth, min_iou=0.34) == ()


@given(objects)
def test_a_map_matches_itself_wholly(things: list[SemanticObject]) -> None:
    matches = match_objects(things, things)
    assert [m.ground_truth for m in matches] == list(range(len(things)))
    assert all(m.iou == pytest.approx(1) for m in matches)


@given(objects, objects)
def test_matching_is_one_to_one_and_symmetric_in_its_sum(
    a: list[SemanticObject], b: list[SemanticObject]
) -> None:
    forth, back = match_objects(a, b), match_objects(b, a)
    assert len({m.estimate for m in forth}) == len({m.ground_truth for m in forth}) == len(forth)
    assert all(a[m.estimate].name == b[m.ground_truth].name for m in forth)
    assert sum(m.iou for m in forth) == pytest.approx(sum(m.iou for m in back))


@given(boxes, boxes)
def test_iou_agrees_with_shapely_and_is_symmetric(a: shapely.Polygon, b: shapely.Polygon) -> None:
    expected = a.intersection(b).area / a.union(b).area
    assert iou_matrix([a], [b])[0, 0] == pytest.approx(expected)
    assert iou_matrix([b], [a])[0, 0] == pytest.approx(expected)
