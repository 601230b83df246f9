"""How well the shape of each true object was mapped: the measure of the 2019 thesis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import as_objects
from hypermap.core.semantic import SemanticObject
from hypermap.core.shapes import valid_copies
from hypermap.evaluation.matching import iou_matrix


@dataclass(frozen=True)
class ClosestShape:
    """A true object next to the nearest estimated object of its class.

    Attributes:
        ground_truth: its index in the true objects.
        estimate: index of the one whose centroid is the nearest.
        distance: between the centroids [m].
        iou: IoU of the shapes, moved so that the centroids coincide.
    """

    ground_truth: int
    estimate: int
    distance: float
    iou: float


def closest_shapes(
    estimate: Sequence[SemanticObject], ground_truth: Sequence[SemanticObject]
) -> tuple[ClosestShape, ...]:
    """Return how well the shape of the nearest estimated object of its class fits each true object.

    The nearest has the nearest centroid; it is moved so that the centroids coincide, and then
    the IoU of the shapes is computed. One estimated object may be the nearest to
    several. True objects whose class does not occur in the estimate are skipped.

    Source: the measure of the 2019 thesis.
    """
    places_of: dict[str, list[int]] = {}
    for i, thing in enumerate(estimate):
        places_of.setdefault(thing.name, []).append(i)
    ours, theirs = centroids(estimate), centroids(ground_truth)
    closest = []
    for j, true in enumerate(ground_truth):
        if true.name not in places_of:
            continue
        places = places_of[true.name]
        distances = np.hypot(*(ours[places] - theirs[j]).T)
        nearest = int(np.argmin(distances))
        i, distance = places[nearest], float(distances[nearest])
        moved = _moved(estimate[i], theirs[j] - ours[i])
        iou = iou_matrix([moved], [true.footprint])[0, 0]
        closest.append(ClosestShape(j, i, distance, float(iou)))
    return tuple(closest)


def centroids(objects: Sequence[SemanticObject]) -> NDArray[np.float64]:
    """Return the centroids of the footprints [m], shape (N, 2)."""
    shapes = valid_copies(as_objects(thing.footprint for thing in objects))
    return np.asarray(shapely.get_coordinates(shapely.centroid(shapes)))


def _moved(thing: SemanticObject, shift: NDArray[np.float64]) -> BaseGeometry:
    moved: BaseGeometry = shapely.transform(thing.footprint, lambda xy: xy + shift)
    return moved
