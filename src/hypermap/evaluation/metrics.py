"""How good an estimated semantic layer is, as numbers; a class without truth is not defined."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.core.semantic import SemanticObject
from hypermap.evaluation.matching import Match, iou_matrix, match_objects

THRESHOLDS = (0.25, 0.5)


@dataclass(frozen=True)
class Detection:
    """How many objects were found, where a find needs some intersection over union.

    Attributes:
        min_iou: the least IoU of a find.
        found: true objects that were found.
        missed: true objects that were not.
        invented: estimated objects that stand for no true one.
    """

    min_iou: float
    found: int
    missed: int
    invented: int

    @property
    def precision(self) -> float | None:
        """Share of the estimated objects that are true; None unless there are some of both."""
        if self.found + self.missed == 0:
            return None
        return _ratio(self.found, self.found + self.invented)

    @property
    def recall(self) -> float | None:
        """Share of the true objects that were found; None if there are none."""
        return _ratio(self.found, self.found + self.missed)

    @property
    def f1(self) -> float | None:
        """Harmonic mean of precision and recall; None if there are no true objects."""
        if self.found + self.missed == 0:
            return None
        return _ratio(2 * self.found, 2 * self.found + self.missed + self.invented)


@dataclass(frozen=True)
class Score:
    """How well the objects of one class, or of all, were mapped.

    Attributes:
        estimated: number of estimated objects.
        true: number of true objects.
        iou: mean over the true objects of the IoU with their match, 0 without one; None if there
            are no true objects.
        centroid_distance: mean over the matched objects of the distance between the centroids
            [m]; None if nothing matched.
        shape_iou: the thesis' measure, see `closest_shapes`; None where it is not defined.
        detection: precision, recall and F1, one for each threshold.
    """

    estimated: int
    true: int
    iou: float | None
    centroid_distance: float | None
    shape_iou: float | None
    detection: tuple[Detection, ...]


@dataclass(frozen=True)
class Evaluation:
    """An estimated map against the truth.

    Attributes:
        overall: over all objects.
        classes: of every class in the estimate or in the truth, by name in alphabetical order.
        object_iou: IoU of every true object with its match, 0 without one, in their order.
        matches: of estimated and true objects, with the largest sum of IoU.
    """

    overall: Score
    classes: Mapping[str, Score]
    object_iou: tuple[float, ...]
    matches: tuple[Match, ...]


@dataclass(frozen=True)
class ClosestShape:
    """A true object beside the nearest estimated object of its class.

    Attributes:
        ground_truth: its place among the true objects.
        estimate: place of the one whose centroid is the nearest.
        distance: between the centroids [m].
        iou: of the shapes, moved so that the centroids coincide.
    """

    ground_truth: int
    estimate: int
    distance: float
    iou: float


def evaluate(
    estimate: Sequence[SemanticObject],
    ground_truth: Sequence[SemanticObject],
    thresholds: Sequence[float] = THRESHOLDS,
) -> Evaluation:
    """Return how well estimated objects agree with the true ones, both in the same frame.

    Precision and recall at a threshold use the matching that is best among the pairs that reach
    it; IoU and distance that of all pairs that overlap.

    >>> table = SemanticObject("table", shapely.box(0, 0, 2, 1))
    >>> half = SemanticObject("table", shapely.box(0, 0, 1, 1))
    >>> score = evaluate([half], [table]).overall
    >>> score.iou, score.centroid_distance, [d.recall for d in score.detection]
    (0.5, 0.5, [1.0, 1.0])
    """
    matches = match_objects(estimate, ground_truth)
    finds = {at: match_objects(estimate, ground_truth, min_iou=at) for at in thresholds}
    closest = closest_shapes(estimate, ground_truth)

    def score(names: set[str]) -> Score:
        """Return the score of the objects that have one of the names."""
        estimated = sum(thing.name in names for thing in estimate)
        true = sum(thing.name in names for thing in ground_truth)
        pairs = [m for m in matches if ground_truth[m.ground_truth].name in names]
        shapes = [c for c in closest if ground_truth[c.ground_truth].name in names]
        found = {
            at: sum(ground_truth[m.ground_truth].name in names for m in of)
            for at, of in finds.items()
        }
        return Score(
            estimated=estimated,
            true=true,
            iou=_ratio(sum(m.iou for m in pairs), true),
            centroid_distance=_mean(
                [_distance(estimate[m.estimate], ground_truth[m.ground_truth]) for m in pairs]
            ),
            shape_iou=_mean([c.iou for c in shapes]),
            detection=tuple(Detection(at, n, true - n, estimated - n) for at, n in found.items()),
        )

    names = sorted({thing.name for thing in (*estimate, *ground_truth)})
    object_iou = [0.0] * len(ground_truth)
    for match in matches:
        object_iou[match.ground_truth] = match.iou
    return Evaluation(
        overall=score(set(names)),
        classes={name: score({name}) for name in names},
        object_iou=tuple(object_iou),
        matches=matches,
    )


def closest_shapes(
    estimate: Sequence[SemanticObject], ground_truth: Sequence[SemanticObject]
) -> tuple[ClosestShape, ...]:
    """Return for every true object how well the nearest estimated one of its class has its shape.

    The nearest is the one with the nearest centroid; it is moved so that the centroids coincide,
    and the Jaccard index of the shapes is taken. One estimated object may be the nearest of
    several. True objects whose class does not occur in the estimate are left out.

    Source: the measure of the 2019 thesis.
    """
    closest = []
    for j, true in enumerate(ground_truth):
        same = [i for i, thing in enumerate(estimate) if thing.name == true.name]
        if same:
            nearest = min(same, key=lambda i: _distance(estimate[i], true))
            closest.append(_compare_shapes(estimate[nearest], true, nearest, j))
    return tuple(closest)


def _compare_shapes(estimate: SemanticObject, true: SemanticObject, i: int, j: int) -> ClosestShape:
    shift = _centroid(true) - _centroid(estimate)
    moved = shapely.transform(estimate.footprint, lambda points_xy: points_xy + shift)
    iou = iou_matrix([moved], [true.footprint])
    return ClosestShape(j, i, float(np.hypot(*shift)), float(iou[0, 0]))


def _centroid(thing: SemanticObject) -> NDArray[np.float64]:
    return np.array([thing.footprint.centroid.x, thing.footprint.centroid.y])


def _distance(a: SemanticObject, b: SemanticObject) -> float:
    return float(a.footprint.centroid.distance(b.footprint.centroid))


def _ratio(part: float, whole: int) -> float | None:
    return part / whole if whole else None


def _mean(values: Sequence[float]) -> float | None:
    return _ratio(sum(values), len(values))
