"""Aligns the footprints of an object with each other, as far as they show about the whole of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hypermap._loops import inner_loop, loop
from hypermap.core.arrays import BoolArray, IntArray

_ROUNDS = 8  # of reweighting the mean of footprints
_SCALE = 0.3  # of the limit: footprints this far from the mean have a quarter of the weight
_WHOLE = 0.6  # of the upper quartile of the areas; larger footprints show the whole object


@loop()
def align_footprints(
    views: NDArray[np.float64],
    area: int,
    centroids: NDArray[np.float64],
    weights: NDArray[np.float64],
    limit: float,
    order: IntArray,
    moves: NDArray[np.float64],
) -> None:
    """Add translations that align footprints, because pose drift would blur the shape.

    Footprints of about the whole object are moved so that their centroids meet at a robust mean,
    which small errors of poses hardly change; a median jumps from one centroid to the next. Partial
    views stay, because their centroids may differ.

    Args:
        views: an array that has the areas of the footprints [m²] in a column, shape (N, C).
        area: this column.
        centroids: of the footprints [m], shape (N, 2).
        weights: positive, shape (N,).
        limit: footprints farther than this from the mean stay [m].
        order: room for their order, shape (N,).
        moves: translations [m], to which these are added, shape (N, 2).

    Source: Geman, McClure, "Statistical methods for tomographic image reconstruction", 1987, for
    the loss; its minimum is found by iteratively reweighted least squares.
    """
    least = _least_whole(views, area, order)
    x = y = 0.0
    scale = np.inf  # the first mean is that of all
    for _ in range(_ROUNDS):
        total = x_sum = y_sum = 0.0
        for i in range(len(order)):
            if views[i, area] >= least:
                far = np.hypot(centroids[i, 0] - x, centroids[i, 1] - y) / scale
                weight = weights[i] / (1 + far * far) ** 2
                total += weight
                x_sum += weight * centroids[i, 0]
                y_sum += weight * centroids[i, 1]
        x, y, scale = x_sum / total, y_sum / total, _SCALE * limit
    for i in range(len(order)):
        dx, dy = x - centroids[i, 0], y - centroids[i, 1]
        if views[i, area] >= least and np.hypot(dx, dy) <= limit:
            moves[i, 0] += dx
            moves[i, 1] += dy


def shows_whole(areas: NDArray[np.float64]) -> BoolArray:
    """Return which footprints, by their areas [m²], show about the whole object, shape (N,)."""
    column = np.ascontiguousarray(areas, np.float64)[:, np.newaxis]
    return np.asarray(areas >= _least_whole(column, 0, np.empty(len(areas), np.int64)))


@loop()
def _least_whole(views: NDArray[np.float64], area: int, order: IntArray) -> float:
    """Return the least area of a footprint that shows about the whole object [m²].

    Args:
        views: as in `align_footprints`.
        area: likewise.
        order: likewise.
    """
    _sort(views, area, order)
    place = 0.75 * (len(order) - 1)
    below = int(place)
    above, share = min(below + 1, len(order) - 1), place - below
    low, high = views[order[below], area], views[order[above], area]
    return float(_WHOLE * (low * (1 - share) + high * share))


@inner_loop()
def _sort(rows: NDArray[np.float64], column: int, order: IntArray) -> None:
    """Find the order of rows by one column; equals stay in order.

    There are a few dozen, which come almost in order.

    Args:
        rows: shape (N, C).
        column: by which to sort.
        order: filled, shape (N,).
    """
    for k in range(len(order)):
        place = k
        while place > 0 and rows[order[place - 1], column] > rows[k, column]:
            order[place] = order[place - 1]
            place -= 1
        order[place] = k
