"""Which object of an estimated map is which object of the truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment
from shapely.geometry.base import BaseGeometry

from hypermap.core.semantic import SemanticObject

_PER_PAIR = 1e-9  # what a pair is worth besides its IoU; enough to decide between equal sums


@dataclass(frozen=True)
class Match:
    """An estimated object and the object of the truth that it stands for.

    Attributes:
        estimate: its place among the estimated objects.
        ground_truth: its place among the true objects.
        iou: of the two footprints, above 0 up to 1.
    """

    estimate: int
    ground_truth: int
    iou: float


def match_objects(
    estimate: Sequence[SemanticObject],
    ground_truth: Sequence[SemanticObject],
    min_iou: float = 0.0,
) -> tuple[Match, ...]:
    """Return the one-to-one matching of objects of the same name with the largest sum of IoU.

    Of matchings with the same sum it is one with the most pairs.

    Args:
        estimate: objects of the estimated map.
        ground_truth: objects of the truth, in the same frame.
        min_iou: pairs with less than this do not match; nor do pairs that share no area.

    Returns:
        Matches in the order of the true objects.
    """
    matches = []
    for name in {thing.name for thing in estimate} & {thing.name for thing in ground_truth}:
        found = [i for i, thing in enumerate(estimate) if thing.name == name]
        true = [j for j, thing in enumerate(ground_truth) if thing.name == name]
        iou = iou_matrix(
            [estimate[i].footprint for i in found], [ground_truth[j].footprint for j in true]
        )
        iou[iou < min_iou] = 0
        rows, cols = linear_sum_assignment(iou + _PER_PAIR * (iou > 0), maximize=True)
        matches += [
            Match(found[row], true[col], float(iou[row, col]))
            for row, col in zip(rows, cols, strict=True)
            if iou[row, col] > 0
        ]
    return tuple(sorted(matches, key=lambda match: match.ground_truth))


def iou_matrix(
    shapes: Sequence[BaseGeometry], others: Sequence[BaseGeometry]
) -> NDArray[np.float64]:
    """Return the intersection over union of every shape with every other, shape (N, M).

    It is 0 where neither of the two has an area.
    """
    a, b = _valid(shapes), _valid(others)
    iou = np.zeros((len(a), len(b)))
    i, j = shapely.STRtree(b).query(a, predicate="intersects")
    shared = shapely.area(shapely.intersection(a[i], b[j]))
    covered = shapely.area(a[i]) + shapely.area(b[j]) - shared
    iou[i, j] = np.divide(shared, covered, out=np.zeros_like(shared), where=covered > 0)
    return iou


def _valid(shapes: Sequence[BaseGeometry]) -> NDArray[np.object_]:
    """Return shapes of which areas can be taken: a ring drawn by hand may cross itself."""
    column = np.empty(len(shapes), dtype=object)
    column[:] = list(shapes)
    return shapely.make_valid(column)
