"""How good a map is, measured against another."""

from hypermap.evaluation.matching import Match, iou_matrix, match_objects
from hypermap.evaluation.metrics import (
    ClosestShape,
    Detection,
    Evaluation,
    Score,
    closest_shapes,
    evaluate,
)

__all__ = [
    "ClosestShape",
    "Detection",
    "Evaluation",
    "Match",
    "Score",
    "closest_shapes",
    "evaluate",
    "iou_matrix",
    "match_objects",
]
