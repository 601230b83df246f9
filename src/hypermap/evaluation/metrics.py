"""Metrics of an estimated semantic layer; undefined for a class without ground truth."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.core.arrays import as_objects
from hypermap.core.semantic import SemanticObject
from hypermap.core.shapes import valid_copies
from hypermap.evaluation.closest import ClosestShape, centroids, closest_shapes
from hypermap.evaluation.matching import Match, find_duplicates, match_objects

THRESHOLDS = (0.25, 0.5)


@dataclass(frozen=True)
class Detection:
    """How many objects were found, given the smallest IoU of a find.

    Attributes:
        min_iou: the smallest IoU of a find.
        found: true objects that were found.
        missed: true objects that were not.
        duplicates: estimated objects that show a found one once more.
        false: all other estimated objects that are not finds.
        found_iou: mean IoU of the finds; None if there are none.
    """

    min_iou: float
    found: int
    missed: int
    duplicates: int
    false: int
    found_iou: float | None

    @property
    def precision(self) -> float | None:
        """Share of the estimated objects that are finds; None unless there are some of both."""
        if not self._has_truth:
            return None
        return _ratio(self.found, self.found + self.duplicates + self.false)

    @property
    def recall(self) -> float | None:
        """Share of the true objects that were found; None if there are none."""
        return _ratio(self.found, self.found + self.missed)

    @property
    def f1(self) -> float | None:
        """Harmonic mean of precision and recall; None if there are no true objects."""
        if not self._has_truth:
            return None
        return _ratio(2 * self.found, 2 * self.found + self.missed + self.duplicates + self.false)

    @property
    def panoptic_quality(self) -> float | None:
        """Mean IoU of the finds, times F1; None if there are no true objects.

        Source: Kirillov et al., "Panoptic Segmentation", 2019, equation 1, with `min_iou`
        instead of their 0.5.
        """
        return None if self.f1 is None else self.f1 * (self.found_iou or 0.0)

    @property
    def _has_truth(self) -> bool:
        return self.found + self.missed > 0


@dataclass(frozen=True)
class Score:
    """How well the objects of one class, or of all, were mapped.

    Attributes:
        estimated: number of estimated objects.
        true: number of true objects.
        iou: mean over the true objects of the IoU with their match, 0 without one; None if there
            are no true objects.
        centroid_distance: mean over the matched objects of the distance between the centroids
            [m]; None if nothing matched, as in the next two.
        area_error: mean over the matched objects of the absolute area error, as a
            share of the true area.
        area_bias: the same with a sign: above 0 where areas are too large.
        compared: number of true objects that the thesis' measure compares, see `closest_shapes`.
        shape_iou: their mean Jaccard index, moved onto each other; None if there are none.
        shape_distance: mean distance of their centroids [m]; None if there are none.
        detection: what was found, one for each threshold.
    """

    estimated: int
    true: int
    iou: float | None
    centroid_distance: float | None
    area_error: float | None
    area_bias: float | None
    compared: int
    shape_iou: float | None
    shape_distance: float | None
    detection: tuple[Detection, ...]


@dataclass(frozen=True)
class Finds:
    """Which estimated objects are finds at a threshold, and which are duplicates of them.

    Attributes:
        min_iou: the smallest IoU of a find.
        matches: the finds.
        duplicates: indices in the estimated objects.
    """

    min_iou: float
    matches: tuple[Match, ...]
    duplicates: tuple[int, ...]


@dataclass(frozen=True)
class Evaluation:
    """An estimated map against the truth.

    Attributes:
        overall: over all objects.
        classes: of every class in the estimate or in the truth, by name in alphabetical order.
        object_iou: IoU of every true object with its match, 0 without one, in their order.
        matches: of estimated and true objects, with the largest sum of IoU.
        closest: the thesis' comparisons.
        finds: one for each threshold.
    """

    overall: Score
    classes: Mapping[str, Score]
    object_iou: tuple[float, ...]
    matches: tuple[Match, ...]
    closest: tuple[ClosestShape, ...]
    finds: tuple[Finds, ...]

    def class_mean_quality(self) -> list[float | None]:
        """Return the panoptic quality for each threshold, averaged as in the paper.

        The mean is over the classes that have true objects, with equal weights.
        """
        by_class = [
            [d.panoptic_quality for d in score.detection] for score in self.classes.values()
        ]
        columns = zip(*by_class, strict=True) if by_class else [()] * len(self.finds)
        return [_mean([q for q in column if q is not None]) for column in columns]


def evaluate(
    estimate: Iterable[SemanticObject],
    ground_truth: Iterable[SemanticObject],
    thresholds: Sequence[float] = THRESHOLDS,
) -> Evaluation:
    """Return how well estimated objects agree with the true ones, both in the same frame.

    Precision and recall at a threshold use the best matching among the pairs that reach it;
    IoU, distance and area use the best matching of all pairs that overlap.

    Args:
        estimate: objects of the estimated map, such as a semantic layer.
        ground_truth: the true objects, likewise.
        thresholds: least IoU of a find, for each entry of `Score.detection`.

    >>> table = SemanticObject("table", shapely.box(0, 0, 2, 1))
    >>> half = SemanticObject("table", shapely.box(0, 0, 1, 1))
    >>> score = evaluate([half], [table]).overall
    >>> score.iou, score.centroid_distance, score.area_bias, [d.recall for d in score.detection]
    (0.5, 0.5, -0.5, [1.0, 1.0])
    """
    estimate, ground_truth = list(estimate), list(ground_truth)  # a layer's indices are ids
    matches = match_objects(estimate, ground_truth)
    finds = tuple(_finds(estimate, ground_truth, at) for at in thresholds)
    closest = closest_shapes(estimate, ground_truth)
    scoring = _Scoring(estimate, ground_truth, matches, finds, closest)
    names = sorted({thing.name for thing in (*estimate, *ground_truth)})
    object_iou = [0.0] * len(ground_truth)
    for match in matches:
        object_iou[match.ground_truth] = match.iou
    return Evaluation(
        overall=scoring.of(set(names)),
        classes={name: scoring.of({name}) for name in names},
        object_iou=tuple(object_iou),
        matches=matches,
        closest=closest,
        finds=finds,
    )


def _finds(
    estimate: Sequence[SemanticObject], ground_truth: Sequence[SemanticObject], min_iou: float
) -> Finds:
    matches = match_objects(estimate, ground_truth, min_iou)
    return Finds(min_iou, matches, find_duplicates(estimate, ground_truth, matches))


class _Scoring:
    """Everything about two maps that the score of any classes is computed from."""

    def __init__(
        self,
        estimate: Sequence[SemanticObject],
        ground_truth: Sequence[SemanticObject],
        matches: Sequence[Match],
        finds: Sequence[Finds],
        closest: Sequence[ClosestShape],
    ) -> None:
        self.estimate, self.ground_truth = estimate, ground_truth
        self.matches, self.finds, self.closest = matches, finds, closest
        ours = np.array([m.estimate for m in matches], dtype=int)
        true = np.array([m.ground_truth for m in matches], dtype=int)
        shifts = centroids(estimate)[ours] - centroids(ground_truth)[true]
        self.distances = np.hypot(*shifts.T)
        self.area_errors = _areas(estimate)[ours] / _areas(ground_truth)[true] - 1

    def of(self, names: set[str]) -> Score:
        """Return the score of the objects that have one of the names."""
        estimated = sum(thing.name in names for thing in self.estimate)
        true = sum(thing.name in names for thing in self.ground_truth)
        rows = [k for k, match in enumerate(self.matches) if self._is_of(names, match)]
        shapes = [c for c in self.closest if self.ground_truth[c.ground_truth].name in names]
        return Score(
            estimated=estimated,
            true=true,
            iou=_ratio(sum(self.matches[k].iou for k in rows), true),
            centroid_distance=_mean(self.distances[rows].tolist()),
            area_error=_mean(np.abs(self.area_errors[rows]).tolist()),
            area_bias=_mean(self.area_errors[rows].tolist()),
            compared=len(shapes),
            shape_iou=_mean([c.iou for c in shapes]),
            shape_distance=_mean([c.distance for c in shapes]),
            detection=tuple(self._detection(at, names, estimated, true) for at in self.finds),
        )

    def _detection(self, at: Finds, names: set[str], estimated: int, true: int) -> Detection:
        ious = [match.iou for match in at.matches if self._is_of(names, match)]
        found = len(ious)
        duplicates = sum(self.estimate[i].name in names for i in at.duplicates)
        return Detection(
            min_iou=at.min_iou,
            found=found,
            missed=true - found,
            duplicates=duplicates,
            false=estimated - found - duplicates,
            found_iou=_mean(ious),
        )

    def _is_of(self, names: set[str], match: Match) -> bool:
        return self.ground_truth[match.ground_truth].name in names


def _areas(objects: Sequence[SemanticObject]) -> NDArray[np.float64]:
    shapes = valid_copies(as_objects(thing.footprint for thing in objects))
    return np.asarray(shapely.area(shapes))


def _ratio(part: float, whole: int) -> float | None:
    return part / whole if whole else None


def _mean(values: Sequence[float]) -> float | None:
    return _ratio(sum(values), len(values))
