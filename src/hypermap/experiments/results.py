"""The results of an experiment: its drives, and means over them."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.semantic import SemanticObject
from hypermap.evaluation.average_precision import average_precision
from hypermap.evaluation.metrics import Evaluation, Score, evaluate
from hypermap.experiments.calibration import Bin, judged, reliability
from hypermap.experiments.drives import Mapped
from hypermap.simulation import World
from hypermap.simulation.truth import true_objects

Data = dict[str, Any]
AP_THRESHOLDS = tuple(0.25 + 0.05 * step for step in range(11))  # to 0.75


@dataclass(frozen=True)
class Measure:
    """A figure of one drive.

    Attributes:
        title: for the head of a table.
        of: returns it; None where it is not defined.
    """

    title: str
    of: Callable[[Score], float | None]


MEASURES: Mapping[str, Measure] = {
    "iou": Measure("IoU", lambda score: score.shape_iou),
    "distance": Measure("off by [m]", lambda score: score.shape_distance),
    "precision": Measure("precision", lambda score: score.detection[0].precision),
    "recall": Measure("recall", lambda score: score.detection[0].recall),
    "f1": Measure("F1 at 0.25", lambda score: score.detection[0].f1),
    "f1_half": Measure("F1 at 0.5", lambda score: score.detection[1].f1),
}


@dataclass(frozen=True, eq=False)
class WorldResult:
    """All drives through a world.

    Attributes:
        world: the world, as the first drive saw it.
        truth: its true objects; those of the other drives are as many, of the same classes.
        mapped: what became of each drive, by ascending seed.
        evaluations: one for each drive, by the method's name.
    """

    world: World
    truth: tuple[SemanticObject, ...]
    mapped: tuple[Mapped, ...]
    evaluations: Mapping[str, tuple[Evaluation, ...]]

    @classmethod
    def of(cls, mapped: Sequence[Mapped], without: Container[str] = ()) -> WorldResult:
        """Return the result of drives through the same world, without some methods."""
        by_seed = tuple(sorted(mapped, key=lambda m: m.drive.seed))
        truths = [tuple(true_objects(m.drive.world).objects()) for m in by_seed]
        evaluations = {
            name: tuple(
                evaluate(m.objects[name], truth) for m, truth in zip(by_seed, truths, strict=True)
            )
            for name in mapped[0].objects
            if name not in without
        }
        return cls(by_seed[0].drive.world, truths[0], by_seed, evaluations)

    def classes(self) -> list[str]:
        """Return the classes of the true objects, in alphabetical order."""
        return sorted({thing.name for thing in self.truth})

    def shape(self, method: str, class_: str | None = None) -> tuple[float | None, float | None]:
        """Return the thesis' measures, as means over the true objects of all drives.

        Args:
            method: its name.
            class_: of the true objects; None for all of them.

        Returns:
            Mean Jaccard index and mean distance of the centroids [m], over the true objects whose
            class the map has; None where there are none.
        """
        found = [
            closest
            for evaluation in self.evaluations[method]
            for closest in evaluation.closest
            if class_ is None or self.truth[closest.ground_truth].name == class_
        ]
        if not found:
            return None, None
        return (
            float(np.mean([closest.iou for closest in found])),
            float(np.mean([closest.distance for closest in found])),
        )

    def found(self, method: str) -> Data:
        """Return means over the drives of precision, recall and F1 at each threshold, and more."""
        evaluations = self.evaluations[method]
        scores = [evaluation.overall for evaluation in evaluations]
        detections = [[score.detection[k] for score in scores] for k in range(2)]
        return {
            "objects": float(np.mean([score.estimated for score in scores])),
            "matched_iou": mean([score.iou for score in scores]),
            "at": [
                {
                    "min_iou": column[0].min_iou,
                    "precision": mean([d.precision for d in column]),
                    "recall": mean([d.recall for d in column]),
                    "f1": mean([d.f1 for d in column]),
                    "duplicates": float(np.mean([d.duplicates for d in column])),
                    "false": float(np.mean([d.false for d in column])),
                }
                for column in detections
            ],
        }

    def bound(self) -> Data:
        """Return means over the drives of what no method can find more of: see `Sightings`."""
        drives = [mapped.sightings for mapped in self.mapped]
        return {
            "shown": float(np.mean([np.mean(drive.visible > 0) for drive in drives])),
            "detected": mean([drive.share() for drive in drives]),
            "detected_twice": mean([drive.share(at_least=2) for drive in drives]),
        }

    def maps(self, method: str) -> list[tuple[Sequence[SemanticObject], Sequence[SemanticObject]]]:
        """Return the mapped and the true objects of each drive."""
        return [
            (mapped.objects[method], true_objects(mapped.drive.world).objects())
            for mapped in self.mapped
        ]

    def average_precision(self, method: str) -> dict[str, float | None]:
        """Return the average precision at each of `AP_THRESHOLDS`, over all drives at once."""
        maps = self.maps(method)
        return {f"{at:.2f}": average_precision(maps, at) for at in AP_THRESHOLDS}

    def reliability(self, method: str) -> tuple[Bin, ...]:
        """Return how often a method's objects are true, by how sure its maps are of them."""
        objects = [mapped.objects[method] for mapped in self.mapped]
        return reliability(*judged(objects, self.evaluations[method]))

    def gains(self, method: str, other: str, measure: str) -> NDArray[np.float64]:
        """Return by how much a method is better than another, for each true object, shape (N,).

        An object's gain is the mean over the drives in which both maps have its class. The same
        object is seen on all drives, so that these are not pairs of their own. Objects of which no
        drive compares the two are left out.

        Args:
            method: of which it is asked.
            other: with which it is compared.
            measure: "iou" or "distance".
        """
        gains: dict[int, list[float]] = {}
        for ours, theirs in zip(self.evaluations[method], self.evaluations[other], strict=True):
            known = {closest.ground_truth: closest for closest in theirs.closest}
            for closest in ours.closest:
                if closest.ground_truth in known:
                    pair = closest, known[closest.ground_truth]
                    a, b = (float(getattr(one, measure)) for one in pair)
                    gain = a - b if measure == "iou" else b - a
                    gains.setdefault(closest.ground_truth, []).append(gain)
        return np.array([np.mean(gains[thing]) for thing in sorted(gains)])


def failures(results: Iterable[WorldResult]) -> dict[str, str]:
    """Return why methods have failed on a drive, by their names; they are not in the results."""
    mapped = [each for result in results for each in result.mapped]
    return {name: why for each in reversed(mapped) for name, why in each.failed.items()}


def mean(values: Sequence[float | None]) -> float | None:
    """Return the mean of the defined values; None for none."""
    defined = [value for value in values if value is not None]
    return float(np.mean(defined)) if defined else None
