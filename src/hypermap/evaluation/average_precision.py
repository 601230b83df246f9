"""Average precision of maps whose objects have a confidence, over several maps at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hypermap.core.semantic import SemanticObject
from hypermap.evaluation.matching import match_objects


def average_precision(
    maps: Sequence[tuple[Sequence[SemanticObject], Sequence[SemanticObject]]], min_iou: float
) -> float | None:
    """Return the area under the curve of precision over recall; None without true objects.

    The curve goes through the objects of all maps by falling confidence; an object without one
    comes last. Precision counts at each recall as the best at that recall or a higher one.

    Args:
        maps: estimated and true objects of each.
        min_iou: from which on a pair of a class is a find; each object is in one pair at most.

    Source: Everingham et al., "The Pascal Visual Object Classes Challenge", IJCV 2010, section 4.2,
    with the area under all points, as since 2010.
    """
    sure, right, true = [], [], 0
    for estimate, truth in maps:
        found = {match.estimate for match in match_objects(estimate, truth, min_iou)}
        sure += [max(item.confidence, default=0.0) for item in estimate]
        right += [number in found for number in range(len(estimate))]
        true += len(truth)
    if true == 0:
        return None
    order = np.argsort(-np.array(sure, dtype=float), kind="stable")
    hits = np.array(right, dtype=bool)[order]
    precision = np.cumsum(hits) / np.arange(1, len(hits) + 1)
    best = np.maximum.accumulate(precision[::-1])[::-1]
    return float(best[hits].sum() / true)
