"""How good an estimate is, as numbers worked out by hand."""

from __future__ import annotations

import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.evaluation.metrics import Detection, evaluate


def bar(name: str, x0: float, x1: float) -> SemanticObject:
    """An object one meter deep from x0 to x1."""
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
    mean = pytest.approx((3 / 4 + 1 / 3 + 1) / 3)
    assert loose == Detection(0.25, found=3, missed=1, duplicates=0, false=1, found_iou=mean)
    assert (loose.precision, loose.recall, loose.f1) == (0.75, 0.75, 0.75)
    mean = pytest.approx((3 / 4 + 1) / 2)
    assert strict == Detection(0.5, found=2, missed=2, duplicates=0, false=2, found_iou=mean)
    assert (strict.precision, strict.recall, strict.f1) == (0.5, 0.5, 0.5)


def test_layers_whose_ids_have_gaps_are_as_good_as_lists() -> None:
    layers = [SemanticLayer("objects", "map", each) for each in (ESTIMATE, TRUTH)]
    estimate, truth = layers
    estimate.remove(0)
    assert evaluate(estimate, truth).matches == evaluate(ESTIMATE[1:], TRUTH).matches


def test_panoptic_quality_is_the_sum_of_iou_over_finds_and_half_of_all_errors() -> None:
    # Kirillov's equation 1: the sum over the finds, over finds + missed / 2 + no finds / 2.
    loose, strict = evaluate(ESTIMATE, TRUTH).overall.detection
    assert loose.panoptic_quality == pytest.approx((3 / 4 + 1 / 3 + 1) / (3 + 1 / 2 + 1 / 2))
    assert strict.panoptic_quality == pytest.approx((3 / 4 + 1) / (2 + 2 / 2 + 2 / 2))


def test_its_mean_over_the_classes_leaves_out_those_without_truth() -> None:
    # At 0.25 chairs have (3/4 + 1/3) / 2, the table 1 and the cup 0; plants have no truth.
    at_quarter, at_half = evaluate(ESTIMATE, TRUTH).class_mean_quality()
    assert at_quarter == pytest.approx(((3 / 4 + 1 / 3) / 2 + 1 + 0) / 3)
    assert at_half == pytest.approx((3 / 4 / (1 + 1 / 2 + 1 / 2) + 1 + 0) / 3)
    assert evaluate(ESTIMATE, []).class_mean_quality() == [None, None]
    assert evaluate([], []).class_mean_quality() == [None, None]


def test_the_area_is_off_by_a_share_of_the_true_one() -> None:
    # Matches: 3 of 4 m2 (-1/4), 2 of 2 (0), and a sofa three times as large as it is (+2).
    overall = evaluate([*ESTIMATE, bar("sofa", 50, 53)], [*TRUTH, bar("sofa", 51, 52)]).overall
    assert overall.area_bias == pytest.approx((-1 / 4 + 0 + 0 + 2) / 4)
    assert overall.area_error == pytest.approx((1 / 4 + 0 + 0 + 2) / 4)


def test_a_second_object_on_a_found_one_is_a_duplicate_and_elsewhere_it_is_false() -> None:
    estimate = [bar("chair", 0, 4), bar("chair", 3, 5), bar("chair", 3.1, 5.1), bar("chair", 8, 9)]
    (loose, _) = evaluate(estimate, [bar("chair", 0, 4)]).overall.detection
    assert (loose.found, loose.duplicates, loose.false) == (1, 1, 2)
    assert loose.precision == 1 / 4


def test_a_second_object_where_nothing_was_found_is_no_duplicate() -> None:
    pieces = [bar("table", 0, 1), bar("table", 5, 6)]
    (loose, _) = evaluate(pieces, [bar("table", 0, 10)]).overall.detection
    assert (loose.found, loose.missed, loose.duplicates, loose.false) == (0, 1, 0, 2)


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
    assert (plant.iou, plant.centroid_distance, plant.area_error) == (None, None, None)
    assert (plant.compared, plant.shape_iou, plant.shape_distance) == (0, None, None)
    for detection in plant.detection:
        assert (detection.precision, detection.recall, detection.f1) == (None, None, None)
        assert detection.panoptic_quality is None
        assert detection.false == 1


def test_a_class_that_was_missed_scores_zero_where_that_is_defined() -> None:
    cup = evaluate(ESTIMATE, TRUTH).classes["cup"]
    assert (cup.iou, cup.centroid_distance, cup.shape_iou) == (0.0, None, None)
    assert [(d.precision, d.recall, d.f1) for d in cup.detection] == [(None, 0.0, 0.0)] * 2
    assert [d.panoptic_quality for d in cup.detection] == [0.0, 0.0]


def test_two_empty_maps_have_no_scores() -> None:
    evaluation = evaluate([], [])
    assert evaluation.overall.iou is None
    assert evaluation.overall.detection[0].f1 is None
    assert evaluation.classes == {}


def test_the_iou_of_every_true_object_is_reported() -> None:
    assert evaluate(ESTIMATE, TRUTH).object_iou == pytest.approx((3 / 4, 1 / 3, 1, 0))


def test_the_shape_measure_takes_its_means_over_classes_that_the_estimate_has() -> None:
    evaluation = evaluate(ESTIMATE, TRUTH)
    # Chairs: 3 of 4 m, and 2 of 2 m; the table is exact; the cup's class is not in the estimate.
    assert evaluation.classes["chair"].shape_iou == pytest.approx((3 / 4 + 1) / 2)
    assert evaluation.classes["cup"].shape_iou is None
    assert evaluation.overall.compared == 3
    assert evaluation.overall.shape_iou == pytest.approx((3 / 4 + 1 + 1) / 3)
    assert evaluation.overall.shape_distance == pytest.approx((0.5 + 1 + 0) / 3)


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
        assert score.centroid_distance == score.shape_distance == pytest.approx(0)
        assert score.area_error == pytest.approx(0)
        assert [d.f1 for d in score.detection] == [1, 1]
        assert [d.panoptic_quality for d in score.detection] == pytest.approx([1, 1])


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
        values += [d.panoptic_quality for d in score.detection]
        assert all(0 <= value <= 1 + 1e-9 for value in values if value is not None)


@given(things, things)
def test_every_object_is_counted_once(a: list[SemanticObject], b: list[SemanticObject]) -> None:
    evaluation = evaluate(a, b)
    for k, whole in enumerate(evaluation.overall.detection):
        parts = [score.detection[k] for score in evaluation.classes.values()]
        assert whole.found + whole.duplicates + whole.false == len(a)
        assert whole.found + whole.missed == len(b)
        for count in ("found", "missed", "duplicates", "false"):
            assert getattr(whole, count) == sum(getattr(part, count) for part in parts)
