"""The confusion matrix: what is mapped where a true object is, whatever its class."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from hypermap.core.arrays import IntArray
from hypermap.core.semantic import SemanticObject
from hypermap.evaluation.matching import iou_matrix

MIN_IOU = 0.25
_OWN_CLASS = 1e-3  # added to the IoU of two of a class: of two in one place, that one is meant


@dataclass(frozen=True, eq=False)
class Confusion:
    """How often each class is mapped as each.

    Attributes:
        classes: N names, in alphabetical order.
        counts: rows are true classes, and last what is mapped where nothing is; columns are mapped
            classes, and last what is not mapped at all; shape (N + 1, N + 1).
    """

    classes: tuple[str, ...]
    counts: IntArray

    @classmethod
    def of(
        cls, maps: Sequence[tuple[Sequence[SemanticObject], Sequence[SemanticObject]]]
    ) -> Confusion:
        """Return the matrix of estimated and true objects of several maps together.

        Objects are matched one to one, from an IoU of 0.25 on.
        """
        names = sorted({thing.name for pair in maps for side in pair for thing in side})
        place = {name: k for k, name in enumerate(names)}
        counts = np.zeros((len(names) + 1, len(names) + 1), np.int64)
        for estimate, truth in maps:
            ours = np.array([place[thing.name] for thing in estimate], dtype=int)
            true = np.array([place[thing.name] for thing in truth], dtype=int)
            iou = iou_matrix([t.footprint for t in truth], [e.footprint for e in estimate])
            score = np.where(iou >= MIN_IOU, iou + _OWN_CLASS * (true[:, None] == ours), 0)
            rows, cols = linear_sum_assignment(score, maximize=True)
            is_match = score[rows, cols] > 0
            rows, cols = rows[is_match], cols[is_match]
            np.add.at(counts, (true[rows], ours[cols]), 1)
            counts[:-1, -1] += np.bincount(np.delete(true, rows), minlength=len(names))
            counts[-1, :-1] += np.bincount(np.delete(ours, cols), minlength=len(names))
        return cls(tuple(names), counts)
