"""Calibration: whether a map is right about its objects as often as it is sure of them.

Source: reliability diagrams of DeGroot and Fienberg, "The comparison and evaluation of
forecasters", The Statistician 32, 1983; expected calibration error of Guo, Pleiss, Sun, Weinberger,
"On calibration of modern neural networks", ICML 2017, equation 3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray
from hypermap.core.semantic import SemanticObject
from hypermap.evaluation.metrics import Evaluation

_BINS = 10


@dataclass(frozen=True)
class Bin:
    """Objects of about the same confidence.

    Attributes:
        low: the least confidence.
        high: where the next bin begins; the last one includes it.
        objects: how many there are.
        confidence: their mean confidence.
        right: share of them that are true.
    """

    low: float
    high: float
    objects: int
    confidence: float
    right: float


def reliability(confidences: NDArray[np.float64], is_right: BoolArray) -> tuple[Bin, ...]:
    """Return the bins that have objects, by rising confidence.

    Args:
        confidences: 0..1, shape (N,).
        is_right: which of the objects are true, shape (N,).

    >>> reliability(np.array([0.72, 0.78, 0.95]), np.array([True, False, True]))
    (Bin(low=0.7, high=0.8, objects=2, confidence=0.75, right=0.5), \
Bin(low=0.9, high=1.0, objects=1, confidence=0.95, right=1.0))
    """
    places = np.minimum(np.floor(confidences * _BINS + 1e-9).astype(int), _BINS - 1)
    return tuple(
        Bin(
            low=float(place / _BINS),
            high=float((place + 1) / _BINS),
            objects=int(np.count_nonzero(places == place)),
            confidence=float(confidences[places == place].mean()),
            right=float(is_right[places == place].mean()),
        )
        for place in np.unique(places)
    )


def calibration_error(bins: Sequence[Bin]) -> float | None:
    """Return the mean difference of confidence and share of right ones; None without objects."""
    total = sum(one.objects for one in bins)
    if total == 0:
        return None
    return sum(one.objects * abs(one.confidence - one.right) for one in bins) / total


def judged(
    objects: Sequence[Sequence[SemanticObject]], evaluations: Sequence[Evaluation]
) -> tuple[NDArray[np.float64], BoolArray]:
    """Return the confidence of each object of some maps, and whether it is true, (N,) each.

    An object is true if it is a find at the lowest threshold. Objects without a confidence are left
    out.
    """
    confidences, right = [], []
    for mapped, evaluation in zip(objects, evaluations, strict=True):
        found = {match.estimate for match in evaluation.finds[0].matches}
        for number, item in enumerate(mapped):
            if item.confidence:
                confidences.append(max(item.confidence))
                right.append(number in found)
    return np.array(confidences, dtype=float), np.array(right, dtype=bool)
