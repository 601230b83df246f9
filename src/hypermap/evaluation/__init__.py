"""How good a map is, measured against another."""

from hypermap.evaluation.closest import ClosestShape, closest_shapes
from hypermap.evaluation.comparison import Comparison, compare
from hypermap.evaluation.maps import MapObjects, map_objects
from hypermap.evaluation.matching import Match, find_duplicates, iou_matrix, match_objects
from hypermap.evaluation.metrics import Detection, Evaluation, Finds, Score, evaluate
from hypermap.evaluation.significance import Effect, SignedRank, effect_of, signed_rank

__all__ = [
    "ClosestShape",
    "Comparison",
    "Detection",
    "Effect",
    "Evaluation",
    "Finds",
    "MapObjects",
    "Match",
    "Score",
    "SignedRank",
    "closest_shapes",
    "compare",
    "effect_of",
    "evaluate",
    "find_duplicates",
    "iou_matrix",
    "map_objects",
    "match_objects",
    "signed_rank",
]
