"""Places the names on a map so that they are readable."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

_GAP = 3.0  # pixels between a label and its shape, and between two labels
_CONVEX = 0.8  # share of its convex hull that a shape covers whose centroid is its middle


@dataclass(frozen=True, eq=False)
class Spot:
    """A shape that wants a label.

    Attributes:
        shape: the shape [pixels].
        size: width and height of the label [pixels].
    """

    shape: BaseGeometry
    size: tuple[float, float]


def place_labels(
    spots: Sequence[Spot],
    frame: tuple[float, float, float, float],
) -> list[tuple[float, float] | None]:
    """Return the center of each spot's label [pixels], or None where there is no free place.

    Labels never overlap each other, and stay within the frame. Of the free
    places the nearest to the shape that hides least of other shapes is taken; small shapes, which
    have to write next to themselves, are served last.

    Args:
        spots: the shapes.
        frame: xmin, ymin, xmax, ymax in which labels may be placed.
    """
    places: list[tuple[float, float] | None] = [None] * len(spots)
    shapes = np.array([spot.shape for spot in spots], dtype=object)
    taken = np.empty((0, 4))
    areas, tree = shapely.area(shapes), shapely.STRtree(shapes)
    for i in np.argsort(-areas, kind="stable"):
        spot = spots[i]
        centers = _candidates(spot)
        half = np.array(spot.size) / 2
        boxes = np.hstack([centers - half, centers + half])
        inside = (boxes[:, :2] >= frame[:2]).all(axis=1) & (boxes[:, 2:] <= frame[2:]).all(axis=1)
        free = inside & (_overlap(boxes, taken, _GAP).sum(axis=1) == 0)
        if not free.any():
            continue
        cost = np.arange(len(boxes)) * 0.05 + _hidden(boxes, i, spot, shapes, areas, tree)
        best = int(np.argmin(np.where(free, cost, np.inf)))
        places[i] = (float(centers[best, 0]), float(centers[best, 1]))
        taken = np.vstack([taken, boxes[best]])
    return places


def _hidden(
    boxes: NDArray[np.float64],
    own: np.intp,
    spot: Spot,
    shapes: NDArray[np.object_],
    areas: NDArray[np.float64],
    tree: shapely.STRtree,
) -> NDArray[np.float64]:
    """Return how much of other shapes each box of a label hides, 1 for a whole one, shape (N,).

    A large shape may be written on. A label that covers a small one wholly is as bad as one that
    lies wholly on another shape.
    """
    label_area = spot.size[0] * spot.size[1]
    labels = np.asarray(shapely.box(*boxes.T))
    box, other = tree.query(labels)
    is_hidden = (other != own) & (areas[other] < max(areas[own], 2 * label_area))
    box, other = box[is_hidden], other[is_hidden]
    shared = shapely.area(shapely.intersection(labels[box], shapes[other]))
    whole = np.minimum(areas[other], label_area) + 1e-9
    hidden = np.zeros(len(boxes))
    np.add.at(hidden, box, shared / whole)
    return hidden


def _candidates(spot: Spot) -> NDArray[np.float64]:
    """Return the places of a label, the best first, shape (N, 2)."""
    x, y = _middle(spot.shape, tolerance=spot.size[1])
    xmin, ymin, xmax, ymax = spot.shape.bounds
    width, height = spot.size
    right, left = xmax + width / 2 + _GAP, xmin - width / 2 - _GAP
    above, below = ymax + height / 2 + _GAP, ymin - height / 2 - _GAP
    step = height + _GAP
    within = [(x, y), (x, y + step), (x, y - step), (x, y + 2 * step), (x, y - 2 * step)]
    around = [(right, y), (x, above), (x, below), (left, y)]
    corners = [(right, above), (right, below), (left, above), (left, below)]
    fits = width <= 1.15 * (xmax - xmin) and height <= ymax - ymin
    inside = [p for p in within if ymin <= p[1] - height / 2 and p[1] + height / 2 <= ymax]
    ordered = inside + around + corners if fits else around + corners + within[:1]
    return np.array(ordered, dtype=float)


def _middle(shape: BaseGeometry, tolerance: float) -> tuple[float, float]:
    """Return the centroid of a shape, or where it is widest if it is hollow or has long arms."""
    middle = shape.centroid
    if shape.area > _CONVEX * shape.convex_hull.area and middle.covered_by(shape):
        return middle.x, middle.y
    largest = max(shapely.get_parts(shape), key=shapely.area)
    if largest.area == 0:
        return middle.x, middle.y
    circle = shapely.maximum_inscribed_circle(largest, tolerance)
    x, y = shapely.get_coordinates(circle)[0]
    return float(x), float(y)


def _overlap(
    boxes: NDArray[np.float64], others: NDArray[np.float64], gap: float
) -> NDArray[np.float64]:
    """Return the area that each box (N, 4) shares with each other box (M, 4), shape (N, M)."""
    low = np.maximum(boxes[:, None, :2], others[None, :, :2] - gap)
    high = np.minimum(boxes[:, None, 2:], others[None, :, 2:] + gap)
    return np.asarray(np.prod(np.clip(high - low, 0, None), axis=2))
