"""Places the names on a map so that they are readable."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_GAP = 3.0  # pixels between a label and its shape, and between two labels


@dataclass(frozen=True, eq=False)
class Spot:
    """A shape that wants a label.

    Attributes:
        center: the best place of the label [pixels].
        bounds: the shape's xmin, ymin, xmax, ymax [pixels].
        size: width and height of the label [pixels].
    """

    center: tuple[float, float]
    bounds: tuple[float, float, float, float]
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
    shapes = np.array([spot.bounds for spot in spots], dtype=float).reshape(-1, 4)
    taken = np.empty((0, 4))
    areas = (shapes[:, 2] - shapes[:, 0]) * (shapes[:, 3] - shapes[:, 1])
    for i in np.argsort(-areas, kind="stable"):
        spot = spots[i]
        centers = _candidates(spot)
        half = np.array(spot.size) / 2
        boxes = np.hstack([centers - half, centers + half])
        inside = (boxes[:, :2] >= frame[:2]).all(axis=1) & (boxes[:, 2:] <= frame[2:]).all(axis=1)
        free = inside & (_overlap(boxes, taken, _GAP).sum(axis=1) == 0)
        if not free.any():
            continue
        # A large shape may be written on. A label that covers a small one wholly is as bad as one
        # that lies wholly on another shape.
        label_area = spot.size[0] * spot.size[1]
        is_hidden = areas < max(areas[i], 2 * label_area)
        is_hidden[i] = False
        whole = np.minimum(areas[is_hidden], label_area) + 1e-9
        hidden = (_overlap(boxes, shapes[is_hidden], 0.0) / whole).sum(axis=1)
        cost = np.where(free, np.arange(len(boxes)) * 0.05 + hidden, np.inf)
        best = int(np.argmin(cost))
        places[i] = (float(centers[best, 0]), float(centers[best, 1]))
        taken = np.vstack([taken, boxes[best]])
    return places


def _candidates(spot: Spot) -> NDArray[np.float64]:
    """Return the places of a label, the best first, shape (N, 2)."""
    x, y = spot.center
    xmin, ymin, xmax, ymax = spot.bounds
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


def _overlap(
    boxes: NDArray[np.float64], others: NDArray[np.float64], gap: float
) -> NDArray[np.float64]:
    """Return the area that each box (N, 4) shares with each other box (M, 4), shape (N, M)."""
    low = np.maximum(boxes[:, None, :2], others[None, :, :2] - gap)
    high = np.minimum(boxes[:, None, 2:], others[None, :, 2:] + gap)
    return np.asarray(np.prod(np.clip(high - low, 0, None), axis=2))
