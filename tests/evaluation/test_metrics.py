"""How good an estimate is, as numbers worked out by hand."""

from __future__ import annotations

import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from hypermap.core.semantic import SemanticObject
from hypermap.evaluation.metrics import Detection, closest_shapes, evaluate


def bar(name: str, x0: float, x1: float) -> SemanticObject:
    """An object one metre deep from x0 to x1."""
    return SemanticObject(name, shapely.box(x0, 0, x1, 1))


# Two chairs, of which one is found well (IoU 3/4) and one poorly (IoU 1/3); a table found exactly;
# a cup missed; a plant invented.
TRUTH = [bar("chair", 0, 4), bar("chair", 10, 12), bar("table", 20, 22), bar("cup", 30, 31)]
ESTIMATE = [bar("chair", 0, 3), bar("chair", 11, 13), bar("table", 20, 22), bar("plant", 40, 41)]


def test_the_scores_of_a_small_map() -> None:
    overall = evaluate(ESTIMATE, TRUTH).overall
    assert (overall.estimated, overall.true) == (4, 4)
    assert overall.iou == pytest.approx((3 / 4 + 1 / 3 + 1 + 0) / 4)
    assert overall.centroid_distance == pytest.approx((0.5 + 1 + 0) / 3)
    loose, strict = overall.detection
    assert loose == Detection(0.25, found=3, missed=1, invented=1)
    assert (loose.precision, loose.recall, loose.f1) == (0.75, 0.75, 0.75)
    assert strict == Detection(0.5, found=2, missed=2, invented=2)
    assert (strict.precision, strict.recall, strict.f1) == (0.5, 0.5, 0.5)


def test_the_scores_of_one_class() -> None:
    chair = evaluate(ESTIMATE, TRUTH).classes["chair"]
    assert (chair.estimated, chair.true) == (2, 2)
    assert chair.iou == pytest.approx((3 / 4 + 1 / 3) / 2)
    assert chair.centroid_distance == pytest.approx(0.75)
    assert [d.found for d in chair.detection] == [2, 1]


def test_every_class_of_either_map_is_scored_in_alphabetical_order() -> None:
    assert list(evaluate(ESTIMATE, TRUTH).classes) == ["chair", "cup", "plant", "table"]


def test_a_class_without_ground_truth_is_not_defined() -> None:
    plant = evaluate(ESTIMATE, TRUTH).classes["plant"]
    assert (plant.iou, plant.centroid_distance, plant.shape_iou) == (None, None, None)
    for detection in plant.detection:
        assert (detection.precision, detection.recall, detection.f1) == (None, None, None)
        assert detection.invented == 1


def test_a_class_that_was_missed_scores_zero_where_that_is_defined() -> None:
    cup = evaluate(ESTIMATE, TRUTH).classes["cup"]
    assert (cup.iou, cup.centroid_distance, cup.shape_iou) == (0.0, None, None)
    assert [(d.precision, d.recall, d.f1) for d in cup.detection] == [(None, 0.0, 0.0)] * 2


def test_two_empty_maps_have_no_scores() -> None:
    evaluation = evaluate([], [])
    assert evaluation.overall.iou is None
    assert evaluation.overall.detection[0].f1 is None
    assert evaluation.classes == {}


def test_the_iou_of_every_true_object_is_told() -> None:
    assert evaluate(ESTIMATE, TRUTH).object_iou == pytest.approx((3 / 4, 1 / 3, 1, 0))


def test_the_shape_measure_moves_the_nearest_object_onto_the_true_one() -> None:
    # A bar of 2 m beside one of 4 m: moved onto each other they share 2 of 4 square metres.
    (closest,) = closest_shapes([bar("sofa", 100, 140), bar("sofa", 11, 13)], [bar("sofa", 0, 4)])
    assert (closest.ground_truth, closest.estimate) == (0, 1)
    assert closest.distance == pytest.approx(10)
    assert closest.iou == pytest.approx(0.5)


def test_the_shape_measure_takes_its_means_over_classes_that_the_estimate_has() -> None:
    evaluation = evaluate(ESTIMATE, TRUTH)
    # Chairs: 3 of 4 m, and 2 of 2 m; the table is exact; the cup's class is not in the estimate.
    assert evaluation.classes["chair"].shape_iou == pytest.approx((3 / 4 + 1) / 2)
    assert evaluation.classes["cup"].shape_iou is None
    assert evaluation.overall.shape_iou == pytest.approx((3 / 4 + 1 + 1) / 3)


def test_one_estimated_object_may_be_the_nearest_of_several() -> None:
    closest = closest_shapes([bar("cup", 0, 1)], [bar("cup", 2, 3), bar("cup", 5, 6)])
    assert [(c.estimate, c.distance) for c in closest] == [
        (0, pytest.approx(2)),
        (0, pytest.approx(5)),
    ]


things = st.lists(
    st.builds(
        lambda name, x, length: bar(name, x, x + length),
        st.sampled_from(["cup", "chair", "table"]),
        st.integers(0, 20),
        st.integers(1, 5),
    ),
    min_size=1,
    max_size=8,
)


@given(
    st.lists(
        st.builds(
            lambda name, place, length: bar(name, 10 * place, 10 * place + length),
            st.sampled_from(["cup", "chair", "table"]),
            st.integers(0, 20),
            st.integers(1, 5),
        ),
        min_size=1,
        unique_by=lambda thing: (thing.name, thing.footprint.bounds[0]),
    )
)
def test_the_truth_against_itself_is_perfect(truth: list[SemanticObject]) -> None:
    evaluation = evaluate(truth, truth)
    for score in (evaluation.overall, *evaluation.classes.values()):
        assert score.iou == pytest.approx(1)
        assert score.shape_iou == pytest.approx(1)
        assert score.centroid_distance == pytest.approx(0)
        assert [d.f1 for d in score.detection] == [1, 1]


@given(things, things)
def test_swapping_the_maps_swaps_precision_and_recall(
    a: list[SemanticObject], b: list[SemanticObject]
) -> None:
    forth, back = evaluate(a, b).overall, evaluate(b, a).overall
    for one, other in zip(forth.detection, back.detection, strict=True):
        assert (one.precision, one.recall, one.f1) == (other.recall, other.precision, other.f1)


@given(things, things)
def test_scores_lie_between_zero_and_one(a: list[SemanticObject], b: list[SemanticObject]) -> None:
    evaluation = evaluate(a, b)
    for score in (evaluation.overall, *evaluation.classes.values()):
        values = [score.iou, score.shape_iou]
        values += [v for d in score.detection for v in (d.precision, d.recall, d.f1)]
        assert all(0 <= value <= 1 + 1e-9 for value in values if value is not None)
