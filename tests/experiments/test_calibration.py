"""How sure a map is of its objects, and how often it is right."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from hypermap.core.semantic import SemanticObject
from hypermap.evaluation.metrics import evaluate
from hypermap.experiments.calibration import Bin, calibration_error, judged, reliability


def test_a_sure_map_that_is_right_as_often_has_no_error() -> None:
    confidences = np.repeat([0.25, 0.75], 20)
    is_right = np.arange(40) % 20 < np.repeat([5, 15], 20)
    bins = reliability(confidences, is_right)
    assert bins == (Bin(0.2, 0.3, 20, 0.25, 0.25), Bin(0.7, 0.8, 20, 0.75, 0.75))
    assert calibration_error(bins) == 0


def test_the_error_weighs_bins_by_their_objects() -> None:
    bins = reliability(np.array([0.3, 0.3, 0.3, 1.0]), np.array([True, True, True, False]))
    assert [(one.low, one.high) for one in bins] == [(0.3, 0.4), (0.9, 1.0)]
    assert calibration_error(bins) == pytest.approx((3 * 0.7 + 1.0) / 4)


def test_no_objects_have_no_error() -> None:
    assert calibration_error(reliability(np.empty(0), np.empty(0, dtype=bool))) is None


def test_finds_are_right_and_objects_without_a_confidence_are_left_out() -> None:
    def thing(x: float, *confidence: float) -> SemanticObject:
        tags = ("cup",) * len(confidence)
        return SemanticObject("cup", shapely.box(x, 0, x + 1, 1), tags=tags, confidence=confidence)

    mapped = [thing(0, 0.9), thing(5, 0.4), thing(9)]
    evaluation = evaluate(mapped, [thing(0), thing(9)])
    confidences, is_right = judged([mapped], [evaluation])
    assert confidences.tolist() == [0.9, 0.4]
    assert is_right.tolist() == [True, False]
