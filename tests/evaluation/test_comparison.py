"""Whether an estimate is better than another, object by object."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from hypermap.core.semantic import SemanticObject
from hypermap.evaluation.comparison import compare
from hypermap.evaluation.metrics import evaluate
from hypermap.testing import square

TRUTH = [square("cup", 10 * i, 0) for i in range(5)] + [square("sink", 60, 0), square("bin", 70, 0)]


def shifted(by: float) -> list[SemanticObject]:
    return [
        SemanticObject(o.name, shapely.transform(o.footprint, lambda xy: xy + np.array([by, 0])))
        for o in TRUTH
    ]


def test_an_exact_map_is_better_than_a_shifted_one_in_all_but_shape() -> None:
    exact, moved = evaluate(TRUTH, TRUTH), evaluate(shifted(0.5), TRUTH)
    shape, distance, overlap = compare(exact, moved)
    assert (shape.rule, shape.measure) == ("closest", "iou")
    assert (shape.estimate, shape.other) == (pytest.approx(1), pytest.approx(1))
    assert (shape.better, shape.worse, shape.test.used, shape.test.p) == (0, 0, 0, 1)
    assert (distance.rule, distance.measure) == ("closest", "distance")
    assert (distance.estimate, distance.other) == (pytest.approx(0), pytest.approx(0.5))
    assert (distance.better, distance.worse, distance.test.p) == (7, 0, 2**-7)
    assert (overlap.rule, overlap.measure) == ("matched", "iou")
    assert (overlap.estimate, overlap.other) == (pytest.approx(1), pytest.approx(1 / 3))
    assert (overlap.better, overlap.worse, overlap.test.p) == (7, 0, 2**-7)


def test_the_other_way_round_it_is_worse() -> None:
    _, distance, overlap = compare(evaluate(shifted(0.5), TRUTH), evaluate(TRUTH, TRUTH))
    for comparison in (distance, overlap):
        assert (comparison.better, comparison.worse, comparison.test.p) == (0, 7, 1)


def test_the_thesis_measures_are_paired_where_both_maps_have_the_class() -> None:
    cups = [thing for thing in TRUTH if thing.name != "sink"]  # a cup and a bin
    others = [thing for thing in TRUTH if thing.name != "bin"]
    shape, distance, overlap = compare(evaluate(cups, TRUTH), evaluate(others, TRUTH))
    assert (shape.test.pairs, distance.test.pairs, overlap.test.pairs) == (5, 5, 7)
    assert (overlap.better, overlap.worse) == (1, 1)  # the bin and the sink


def test_maps_without_a_common_class_cannot_be_compared_by_shape() -> None:
    shape, distance, _ = compare(evaluate(TRUTH[:5], TRUTH), evaluate(TRUTH[5:], TRUTH))
    for comparison in (shape, distance):
        assert (comparison.estimate, comparison.other, comparison.test.p) == (None, None, 1)


def test_the_exact_test_can_be_asked_for() -> None:
    truth = [square("cup", 10 * i, 0) for i in range(20)]
    none, all_ = evaluate([square("cup", -9, 0)], truth), evaluate(truth, truth)
    assert compare(all_, none)[2].test.method == "normal"
    assert compare(all_, none, exact=True)[2].test.p == pytest.approx(2**-20)


def test_estimates_of_different_truths_are_refused() -> None:
    with pytest.raises(ValueError, match="same true objects, got 7 and 5"):
        compare(evaluate(TRUTH, TRUTH), evaluate(TRUTH, TRUTH[:5]))
