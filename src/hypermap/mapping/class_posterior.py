"""One class per place: a chair that a detector sometimes calls a bench is one object.

Two solid objects cannot fill one place. If two published objects of different classes do, one of
them is a misclassification of the other. A detector confuses the same object again and again, so
frames are not independent votes: if an object is a chair in half of all frames and a bench in the
others, the labels say little, however many there are. But a map with ten other chairs and no other
bench says much.

Source: Bayes' rule; the detector's confusion rate, unknown for each single object, is integrated
out (beta-binomial; Skellam, Journal of the Royal Statistical Society B 10, 1948). The prior of the
classes is their frequency in the rest of the map (empirical Bayes).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
import shapely

from hypermap.core.arrays import as_objects
from hypermap.core.semantic import SemanticObject
from hypermap.mapping.footprint_iou import at_same_height

_RATES = np.linspace(0.02, 0.6, 30)  # confusion rates: shares of frames with the wrong class
_UNSEEN = 0.5  # pseudocount of objects: the prior of a class that the map does not have


def one_class_per_place(
    objects: Sequence[SemanticObject], min_iou: float, fixed: Collection[int] = ()
) -> list[SemanticObject]:
    """Return the objects without misclassified copies of others.

    The remaining objects have the other classes as additional tags, each with its probability as
    confidence.

    Args:
        objects: of a map, with the attributes `evidence`, `z_min` and `z_max`.
        min_iou: two footprints at the same height with at least this IoU are one place.
        fixed: ids of objects that do not change, because they were edited by hand.
    """
    places = [n for n, item in enumerate(objects) if item.id not in fixed]
    free = [objects[n] for n in places]  # those drawn by hand have no heights
    pairs = [(places[i], places[j]) for i, j in _sharing_places(free, min_iou)]
    if not pairs:
        return list(objects)
    doubtful = {place for pair in pairs for place in pair}
    known = Counter(item.name for n, item in enumerate(objects) if n not in doubtful)
    others: dict[int, dict[str, float]] = {}  # of the objects that stay: other classes and odds
    gone: set[int] = set()
    for i, j in pairs:
        if i in gone or j in gone:
            continue
        odds = _log_odds(objects[i], objects[j], known)
        stays, goes = (i, j) if odds >= 0 else (j, i)
        gone.add(goes)
        others.setdefault(stays, {})[objects[goes].name] = math.exp(-abs(odds))
    return [
        _with_classes(item, others.get(n, {})) for n, item in enumerate(objects) if n not in gone
    ]


def _sharing_places(objects: Sequence[SemanticObject], min_iou: float) -> list[tuple[int, int]]:
    """Return pairs of objects of different classes in one place, the largest IoU first."""
    shapes = as_objects(item.footprint for item in objects)
    first, second = shapely.STRtree(shapes).query(shapes, predicate="intersects")
    found = []
    for i, j in zip(first.tolist(), second.tolist(), strict=True):
        one, other = objects[i], objects[j]
        if i >= j or one.name == other.name or not at_same_height(_heights(one), _heights(other)):
            continue
        shared = shapely.area(shapely.intersection(shapes[i], shapes[j]))
        whole = shapes[i].area + shapes[j].area - shared
        if whole > 0 and shared >= min_iou * whole:
            found.append((-shared / whole, i, j))
    return [(i, j) for _, i, j in sorted(found)]


def _heights(item: SemanticObject) -> tuple[float, float]:
    return item.attributes["z_min"], item.attributes["z_max"]


def _log_odds(one: SemanticObject, other: SemanticObject, known: Counter[str]) -> float:
    """Return the log odds that an object in one place is the first, not the second."""
    own, others = one.attributes["evidence"], other.attributes["evidence"]
    prior = math.log(known[one.name] + _UNSEEN) - math.log(known[other.name] + _UNSEEN)
    return prior + _log_likelihood(own, others) - _log_likelihood(others, own)


def _log_likelihood(right: int, wrong: int) -> float:
    """Return the log likelihood of `right` correct and `wrong` wrong labels of one object."""
    logs = right * np.log1p(-_RATES) + wrong * np.log(_RATES)
    return float(np.logaddexp.reduce(logs))


def _with_classes(item: SemanticObject, odds: dict[str, float]) -> SemanticObject:
    if not odds:
        return item
    shares = np.array([1.0, *odds.values()]) / (1 + sum(odds.values()))
    confidence = tuple((max(item.confidence, default=1.0) * shares).tolist())
    return replace(item, tags=(item.name, *odds), confidence=confidence)
