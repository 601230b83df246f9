"""Matches the objects of an estimated map with the true objects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import as_objects
from hypermap.core.semantic import SemanticObject
from hypermap.core.shapes import valid_copies

DUPLICATE_SHARE = 0.5  # of the smaller area, shared by a duplicate and an object that was found
_PER_PAIR = 1e-9  # added to the IoU of a pair; enough to decide between equal sums


@dataclass(frozen=True)
class Match:
    """An estimated object and the true object that it represents.

    Attributes:
        estimate: its index in the estimated objects.
        ground_truth: its index in the true objects.
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

    Of matchings with the same sum, it is one with the most pairs.

    Args:
        estimate: objects of the estimated map.
        ground_truth: objects of the truth, in the same frame.
        min_iou: pairs with less do not match; nor do pairs that share no area.

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
        rows, cols = scipy.optimize.linear_sum_assignment(
            iou + _PER_PAIR * (iou > 0), maximize=True
        )
        matches += [
            Match(found[row], true[col], float(iou[row, col]))
            for row, col in zip(rows, cols, strict=True)
            if iou[row, col] > 0
        ]
    return tuple(sorted(matches, key=lambda match: match.ground_truth))


def find_duplicates(
    estimate: Sequence[SemanticObject],
    ground_truth: Sequence[SemanticObject],
    matches: Sequence[Match],
) -> tuple[int, ...]:
    """Return the indices of the estimated objects that show a matched true object once more.

    They have no match, but share at least `DUPLICATE_SHARE` of the smaller one's area with a true
    object of their name that has one. So a piece of an object is a duplicate, too.
    """
    taken = {match.estimate for match in matches}
    found: list[int] = []
    for name in {ground_truth[match.ground_truth].name for match in matches}:
        free = [i for i, thing in enumerate(estimate) if thing.name == name and i not in taken]
        shown = [ground_truth[match.ground_truth] for match in matches]
        overlap = _overlap(
            [estimate[i].footprint for i in free],
            [thing.footprint for thing in shown if thing.name == name],
        )
        shares = overlap.of_smaller().max(axis=1)
        found += [i for i, share in zip(free, shares, strict=True) if share >= DUPLICATE_SHARE]
    return tuple(sorted(found))


def iou_matrix(
    shapes: Sequence[BaseGeometry], others: Sequence[BaseGeometry]
) -> NDArray[np.float64]:
    """Return the intersection over union of every shape with every other, shape (N, M).

    0 if neither of the two has an area. An outline that crosses itself counts as what it
    winds around.
    """
    return _overlap(shapes, others).of_both()


@dataclass(frozen=True, eq=False)
class _Overlap:
    """Areas [m^2]: shared by each of N shapes and each of M others, and of each shape."""

    shared: NDArray[np.float64]
    areas: NDArray[np.float64]
    others: NDArray[np.float64]

    def of_both(self) -> NDArray[np.float64]:
        """Return the shared area over that of the union, shape (N, M)."""
        return self._over(self.areas[:, None] + self.others - self.shared)

    def of_smaller(self) -> NDArray[np.float64]:
        """Return the shared area over that of the smaller of the two, shape (N, M)."""
        return self._over(np.minimum(self.areas[:, None], self.others))

    def _over(self, whole: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.divide(self.shared, whole, out=np.zeros_like(self.shared), where=whole > 0)


def _overlap(shapes: Sequence[BaseGeometry], others: Sequence[BaseGeometry]) -> _Overlap:
    a, b = (valid_copies(as_objects(column)) for column in (shapes, others))
    shared = np.zeros((len(a), len(b)))
    i, j = shapely.STRtree(b).query(a, predicate="intersects")
    shared[i, j] = shapely.area(shapely.intersection(a[i], b[j]))
    return _Overlap(shared, np.asarray(shapely.area(a)), np.asarray(shapely.area(b)))
