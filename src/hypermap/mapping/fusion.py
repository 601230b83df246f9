"""How an object's shape comes from its evidence: one small function per answer."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.mapping.outlines import Outline
from hypermap.mapping.pile import Pile
from hypermap.mapping.stages import EvidenceConfig
from hypermap.mapping.votes import agreed_points


def best_shape(pile: Pile, config: EvidenceConfig) -> Outline:  # noqa: ARG001
    """Return the footprint whose centroid is nearest to the mean of all centroids.

    Of equally near ones the oldest is taken.
    """
    return pile.items[_nearest_to_mean(pile.centroids)].outline


def convex_hull(pile: Pile, config: EvidenceConfig) -> Outline:  # noqa: ARG001
    """Return the convex hull of all footprints."""
    return _hull(shapely.get_coordinates(pile.footprints()))


def votes(pile: Pile, config: EvidenceConfig) -> Outline:
    """Return the convex hull of what enough of the views agree on: see `agreed_points`."""
    points_xy = agreed_points(pile, config)
    if len(points_xy) == 0:  # smaller than a cell
        return best_shape(pile, config)
    return _hull(points_xy)


Fusion: TypeAlias = Callable[[Pile, EvidenceConfig], Outline]

FUSIONS: Mapping[str, Fusion] = {
    "best_shape": best_shape,
    "convex_hull": convex_hull,
    "votes": votes,
}


def _hull(points_xy: NDArray[np.float64]) -> Outline:
    """Return the convex hull of at least two points, shape (N, 2)."""
    return Outline.of(shapely.LineString(points_xy).convex_hull)


def _nearest_to_mean(points_xy: NDArray[np.float64]) -> int:
    """Return which point is nearest to the mean of all, the first of equally near ones."""
    offsets = points_xy - points_xy.mean(axis=0)
    return int(np.argmin((offsets * offsets).sum(axis=1)))
