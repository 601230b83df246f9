"""How good a map is, measured against another."""

from hypermap.core.history import Change
from hypermap.evaluation.changes import Changes, are_of_one_map, changes_between, knowledge_of
from hypermap.evaluation.closest import ClosestShape, closest_shapes
from hypermap.evaluation.comparison import Comparison, compare
from hypermap.evaluation.maps import MapObjects, map_objects, objects_in_frame
from hypermap.evaluation.matching import Match, find_duplicates, iou_matrix, match_objects
from hypermap.evaluation.metrics import Detection, Evaluation, Finds, Score, evaluate
from hypermap.evaluation.significance import Effect, SignedRank, effect_of, signed_rank

__all__ = [
    "Change",
    "Changes",
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
    "are_of_one_map",
    "changes_between",
    "closest_shapes",
    "compare",
    "effect_of",
    "evaluate",
    "find_duplicates",
    "iou_matrix",
    "knowledge_of",
    "map_objects",
    "match_objects",
    "objects_in_frame",
    "signed_rank",
]
