"""The localization curve: which share of the true objects is mapped within some distance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from hypermap.core.semantic import SemanticObject
from hypermap.evaluation.closest import centroids

LIMITS = tuple(round(0.02 * step, 2) for step in range(51))  # meters, to 1.0
_FAR = 1e3  # meters: what no pair is worth


def localization_curve(
    maps: Sequence[tuple[Sequence[SemanticObject], Sequence[SemanticObject]]],
) -> list[float] | None:
    """Return the share of the true objects within each of `LIMITS`; None without any.

    Estimated and true objects of a class are matched one to one, so that as many as possible are
    within the largest limit and the sum of the distances between their centroids is least. The
    shapes do not count.

    Args:
        maps: estimated and true objects of each.
    """
    distances = [_distances(estimate, truth) for estimate, truth in maps]
    every = np.concatenate(distances) if distances else np.zeros(0)
    if len(every) == 0:
        return None
    return [float(np.mean(every <= limit)) for limit in LIMITS]


def _distances(
    estimate: Sequence[SemanticObject], truth: Sequence[SemanticObject]
) -> NDArray[np.float64]:
    """Return how far each true object is from its match [m], inf without one."""
    found = np.full(len(truth), np.inf)
    ours, true = centroids(estimate), centroids(truth)
    for name in {thing.name for thing in estimate} & {thing.name for thing in truth}:
        cols = [i for i, thing in enumerate(estimate) if thing.name == name]
        rows = [j for j, thing in enumerate(truth) if thing.name == name]
        away = np.linalg.norm(true[rows][:, None] - ours[cols], axis=2)
        is_near = away <= LIMITS[-1]
        a, b = linear_sum_assignment(np.where(is_near, away, _FAR))
        for row, col in zip(a, b, strict=True):
            if is_near[row, col]:
                found[rows[row]] = away[row, col]
    return found
