"""Average precision, worked out by hand."""

from __future__ import annotations

import pytest
import shapely

from hypermap.core.semantic import SemanticObject
from hypermap.evaluation.average_precision import average_precision


def cup(x: float, *confidence: float) -> SemanticObject:
    tags = ("cup",) * len(confidence)
    return SemanticObject("cup", shapely.box(x, 0, x + 1, 1), tags=tags, confidence=confidence)


def test_wrong_objects_count_less_the_less_sure_they_are() -> None:
    truth = [cup(0), cup(10), cup(20), cup(30)]
    # By falling confidence: right, wrong, right, right; one is never found.
    mapped = [cup(0, 0.9), cup(50, 0.8), cup(10, 0.7), cup(20.1, 0.2)]
    assert average_precision([(mapped, truth)], 0.5) == pytest.approx((1 + 0.75 + 0.75) / 4)
    assert average_precision([(mapped, truth)], 0.9) == pytest.approx((1 + 2 / 3) / 4)


def test_objects_of_all_maps_are_ranked_together_and_those_without_confidence_come_last() -> None:
    first = [cup(5), cup(0, 0.5)], [cup(0)]
    second = [cup(0, 0.9)], [cup(0)]
    assert average_precision([first, second], 0.5) == 1.0
    assert average_precision([([], [cup(0)])], 0.5) == 0.0
    assert average_precision([([cup(0)], [])], 0.5) is None
