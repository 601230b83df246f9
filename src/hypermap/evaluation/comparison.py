"""Compares two estimates of the same ground truth, object by object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hypermap.evaluation.metrics import Evaluation
from hypermap.evaluation.significance import TIE, SignedRank, signed_rank


@dataclass(frozen=True)
class Comparison:
    """Whether an estimate is better than another by one measure, over the same true objects.

    Attributes:
        rule: how objects were compared with the truth: "closest" or "matched".
        measure: "iou" or "distance".
        estimate: mean of the measure over the pairs; None if there are no pairs.
        other: the same for the other estimate.
        better: true objects for which the estimate is better.
        worse: true objects for which it is worse.
        test: whether it is better by more than chance.
    """

    rule: str
    measure: str
    estimate: float | None
    other: float | None
    better: int
    worse: int
    test: SignedRank


def compare(estimate: Evaluation, other: Evaluation, exact: bool = False) -> tuple[Comparison, ...]:
    """Return how much better an estimate is than another with the same ground truth.

    The thesis' measures are compared over the true objects whose class occurs in both estimates;
    the IoU of the one-to-one matching over all true objects.

    Args:
        estimate: the one that may be better.
        other: evaluated against the same true objects.
        exact: whether to use the exact distribution, however many pairs there are.

    Raises:
        ValueError: If the two were evaluated against different numbers of true objects.
        HypermapError: If there are too many pairs for the exact distribution.
    """
    if len(estimate.object_iou) != len(other.object_iou):
        raise ValueError(
            "the estimates must be evaluated against the same true objects, got "
            f"{len(estimate.object_iou)} and {len(other.object_iou)}"
        )
    ours, theirs = ({c.ground_truth: c for c in run.closest} for run in (estimate, other))
    pairs = [(ours[j], theirs[j]) for j in sorted(ours.keys() & theirs.keys())]
    matched = list(zip(estimate.object_iou, other.object_iou, strict=True))
    more, less = 1, -1  # is better
    return (
        _compare("closest", "iou", [(a.iou, b.iou) for a, b in pairs], more, exact),
        _compare("closest", "distance", [(a.distance, b.distance) for a, b in pairs], less, exact),
        _compare("matched", "iou", matched, more, exact),
    )


def _compare(
    rule: str, measure: str, pairs: Sequence[tuple[float, float]], sign: int, exact: bool
) -> Comparison:
    values = np.array(pairs, dtype=float).reshape(-1, 2)
    gains = sign * (values[:, 0] - values[:, 1])
    ours, theirs = values.mean(axis=0).tolist() if pairs else (None, None)
    return Comparison(
        rule=rule,
        measure=measure,
        estimate=ours,
        other=theirs,
        better=int((gains > TIE).sum()),
        worse=int((gains < -TIE).sum()),
        test=signed_rank(gains, exact),
    )
