"""One class for each place: what a detector calls now a chair and now a bench is one object.

Two solid things do not fill one place. If two published objects of different classes do, one of
them is what the detector takes the other for. It does so for the same thing again and again, so
that frames are no independent votes: of a thing that is called a chair in half of all frames and a
bench in the others, the names say little, however many there are. But a map with ten other chairs
and no other bench says much.

Source: Bayes' rule, with a confusion rate of the detector that is not known for any one thing, and
is integrated out (beta-binomial, Skellam, Journal of the Royal Statistical Society B 10, 1948). The
prior of the classes is what the rest of the map shows, in the manner of empirical Bayes.
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

_RATES = np.linspace(0.02, 0.6, 30)  # shares of the frames in which a thing is called another
_UNSEEN = 0.5  # of an object: what the prior counts for a class that the map does not have


def one_class_per_place(
    objects: Sequence[SemanticObject], min_iou: float, fixed: Collection[int] = ()
) -> list[SemanticObject]:
    """Return the objects without those that are other objects, called by another class.

    The objects that stay have the other classes as further tags, each with its probability as
    confidence.

    Args:
        objects: of a map, with the attributes `evidence`, `z_min` and `z_max`.
        min_iou: of two footprints at the same height, from which on they are one place.
        fixed: ids of objects that stay as they are, as people have said what they are.
    """
    places = [n for n, item in enumerate(objects) if item.id not in fixed]
    free = [objects[n] for n in places]  # those drawn by hand have no heights, either
    pairs = [(places[i], places[j]) for i, j in _sharing_places(free, min_iou)]
    if not pairs:
        return list(objects)
    doubtful = {place for pair in pairs for place in pair}
    known = Counter(item.name for n, item in enumerate(objects) if n not in doubtful)
    others: dict[int, dict[str, float]] = {}  # of those that stay: classes and odds against theirs
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
    """Return pairs of objects of different classes in one place, the best fitting first."""
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
    """Return the log odds that two objects in one place are the first, and not the second."""
    own, others = one.attributes["evidence"], other.attributes["evidence"]
    prior = math.log(known[one.name] + _UNSEEN) - math.log(known[other.name] + _UNSEEN)
    return prior + _log_likelihood(own, others) - _log_likelihood(others, own)


def _log_likelihood(right: int, wrong: int) -> float:
    """Return how likely it is that a thing is called `right` times its class, `wrong` times not."""
    logs = right * np.log1p(-_RATES) + wrong * np.log(_RATES)
    return float(np.logaddexp.reduce(logs))


def _with_classes(item: SemanticObject, odds: dict[str, float]) -> SemanticObject:
    if not odds:
        return item
    shares = np.array([1.0, *odds.values()]) / (1 + sum(odds.values()))
    confidence = tuple((max(item.confidence, default=1.0) * shares).tolist())
    return replace(item, tags=(item.name, *odds), confidence=confidence)
