"""Fusion: an object's shape from its evidence; one function per method."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeAlias, cast

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.mapping.evidence_buffer import EvidenceBuffer
from hypermap.mapping.prepared_polygon import PreparedPolygon
from hypermap.mapping.stages import EvidenceConfig
from hypermap.mapping.votes import agreed_corners


def best_shape(buffer: EvidenceBuffer, config: EvidenceConfig) -> PreparedPolygon:  # noqa: ARG001
    """Return the footprint whose centroid is nearest to the mean of all centroids.

    Ties go to the oldest.
    """
    return buffer.items[_nearest_to_mean(buffer.centroids)].prepared


def convex_hull(buffer: EvidenceBuffer, config: EvidenceConfig) -> PreparedPolygon:  # noqa: ARG001
    """Return the convex hull of all footprints."""
    return _hull(shapely.get_coordinates(buffer.footprints()))


def votes(
    buffer: EvidenceBuffer, config: EvidenceConfig, shifts: NDArray[np.float64] | None = None
) -> PreparedPolygon:
    """Return the convex hull of the cells on which enough views agree; see `agreed_corners`.

    `shifts` moves the pieces of evidence first [m], shape (N, 2).
    """
    corners_xy = agreed_corners(buffer, config, shifts)
    if len(corners_xy) == 0:  # smaller than a cell
        return best_shape(buffer, config)
    return PreparedPolygon.of_ring(corners_xy)


Fusion: TypeAlias = Callable[[EvidenceBuffer, EvidenceConfig], PreparedPolygon]

FUSIONS: Mapping[str, Fusion] = {
    "best_shape": best_shape,
    "convex_hull": convex_hull,
    "votes": votes,
}


def _hull(points_xy: NDArray[np.float64]) -> PreparedPolygon:
    """Return the convex hull of at least two points [m], shape (N, 2)."""
    line = cast("BaseGeometry", shapely.linestrings(points_xy))  # faster than LineString
    return PreparedPolygon.of(shapely.convex_hull(line))


def _nearest_to_mean(points_xy: NDArray[np.float64]) -> int:
    """Return the index of the point nearest to the mean, the first one of ties."""
    # For few points, this is faster than np.mean and a sum over the second axis.
    x, y = (points_xy - np.add.reduce(points_xy) / len(points_xy)).T
    return int((x * x + y * y).argmin())
