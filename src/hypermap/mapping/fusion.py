"""How an object's shape comes from its evidence: one small function per answer."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeAlias

import numpy as np
import shapely
from numba import njit
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import ObjectArray
from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.mapping.pile import Pile
from hypermap.mapping.stages import EvidenceConfig

_MAX_CELLS_PER_SIDE = 128
_WHOLE = 0.6  # of the area that a quarter of the footprints exceed: what shows the whole object


def best_shape(pile: Pile, config: EvidenceConfig) -> BaseGeometry:  # noqa: ARG001
    """Return the footprint whose centroid is nearest to the mean of all centroids.

    Of equally near ones the oldest is taken.
    """
    offsets = pile.centroids - pile.centroids.mean(axis=0)
    return pile.items[int(np.argmin(np.sum(offsets * offsets, axis=1)))].footprint


def convex_hull(pile: Pile, config: EvidenceConfig) -> BaseGeometry:  # noqa: ARG001
    """Return the convex hull of all footprints."""
    return _hull(shapely.get_coordinates(pile.footprints()))


def votes(pile: Pile, config: EvidenceConfig) -> BaseGeometry:
    """Return the convex hull of what enough of the views agree on.

    The ground under the footprints is cut into cells. Each view votes, with its detection's
    score, for the cells of its footprint, and abstains on cells outside its observed area: the
    half of a table that one frame shows does not vote against the other half. A cell belongs to
    the object if it gets `vote_share` of the votes cast on it.

    Near views weigh more (`half_weight`), and footprints are moved onto each other first (`align`).
    """
    scores = np.array([evidence.score for evidence in pile.items])
    if not scores.any():
        scores = np.ones(len(pile))
    if config.half_weight < np.inf:
        scores /= 1 + (pile.distances() / config.half_weight) ** 2
    footprints = pile.footprints()
    if config.align > 0:
        footprints = aligned(footprints, pile.centroids, scores, config.align)
    grid = _voting_grid(footprints, config.vote_resolution)
    areas = np.array([evidence.visible_area for evidence in pile.items], dtype=object)
    ayes = _count_votes(footprints, scores, grid)
    cast = _count_votes(areas, scores, grid) + scores[shapely.is_empty(areas)].sum()
    # A view has seen its own footprint, even where its observed area is a little smaller.
    chosen = (ayes > 1e-9) & (ayes >= config.vote_share * np.maximum(cast, ayes) - 1e-9)
    if not chosen.any():  # smaller than a cell
        return best_shape(pile, config)
    return _hull_of_cells(chosen, grid)


Fusion: TypeAlias = Callable[[Pile, EvidenceConfig], BaseGeometry]

FUSIONS: Mapping[str, Fusion] = {
    "best_shape": best_shape,
    "convex_hull": convex_hull,
    "votes": votes,
}


def aligned(
    footprints: ObjectArray,
    centroids: NDArray[np.float64],
    weights: NDArray[np.float64],
    limit: float,
) -> ObjectArray:
    """Return footprints that lie where most of them do, so that drifting poses do not blur them.

    Those that show about the whole object are moved: their centroids come to the weighted median
    of them. Parts stay where they are, as their centroids may well differ.

    Args:
        footprints: polygons [m], shape (N,).
        centroids: of these [m], shape (N, 2).
        weights: positive, shape (N,).
        limit: footprints farther than this from the median stay where they are [m].
    """
    areas = shapely.area(footprints)
    is_whole = areas >= _WHOLE * np.percentile(areas, 75)
    median = [_weighted_median(axis, weights[is_whole]) for axis in centroids[is_whole].T]
    shifts = median - centroids
    result = footprints.copy()
    moved = is_whole & (np.hypot(*shifts.T) <= limit)
    xy, footprint_of_point = shapely.get_coordinates(footprints[moved], return_index=True)
    result[moved] = shapely.set_coordinates(
        footprints[moved], xy + shifts[moved][footprint_of_point]
    )
    return result


def _weighted_median(values: NDArray[np.float64], weights: NDArray[np.float64]) -> float:
    order = np.argsort(values, kind="stable")
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, total[-1] / 2)])


def _voting_grid(footprints: ObjectArray, resolution: float) -> GridGeometry:
    """Return a grid over all footprints, aligned to its resolution and of bounded size."""
    xmin, ymin, xmax, ymax = shapely.total_bounds(footprints)
    resolution = max(resolution, max(xmax - xmin, ymax - ymin) / _MAX_CELLS_PER_SIDE)
    left, bottom = np.floor(xmin / resolution), np.floor(ymin / resolution)
    return GridGeometry(
        width=int(np.floor(xmax / resolution) - left) + 1,
        height=int(np.floor(ymax / resolution) - bottom) + 1,
        resolution=resolution,
        origin=Pose2D(float(left * resolution), float(bottom * resolution)),
    )


def _count_votes(
    polygons: ObjectArray, weights: NDArray[np.float64], grid: GridGeometry
) -> NDArray[np.float64]:
    """Return the sum of the weights of the polygons that cover each cell's centre."""
    parts, polygon_of_part = shapely.get_parts(polygons, return_index=True)
    rings, part_of_ring = shapely.get_rings(parts, return_index=True)
    points_xy, ring_of_point = shapely.get_coordinates(rings, return_index=True)
    # Inside a ring that runs counter-clockwise its weight is added, whichever way it was drawn.
    is_hole = np.append(False, part_of_ring[1:] == part_of_ring[:-1])
    weight_of_ring = weights[polygon_of_part[part_of_ring]] * np.where(is_hole, -1, 1)
    weight_of_ring *= np.where(shapely.is_ccw(rings), 1, -1)

    matrix = grid.to_cells_matrix()
    cells_xy = points_xy @ matrix[:2, :2].T + matrix[:2, 2] - 0.5  # centres at whole numbers
    is_edge = ring_of_point[1:] == ring_of_point[:-1]
    edges = np.column_stack([cells_xy[:-1][is_edge], cells_xy[1:][is_edge]])
    steps = np.zeros((grid.height, grid.width + 1))
    _add_steps(steps, edges, weight_of_ring[ring_of_point[:-1][is_edge]])
    return np.cumsum(steps[:, :-1], axis=1)


@njit(cache=True)
def _add_steps(
    steps: NDArray[np.float64], edges: NDArray[np.float64], weights: NDArray[np.float64]
) -> None:
    """Note in each row of cells where a polygon's weight begins and where it ends.

    Args:
        steps: change from one cell's sum to the next's, shape (height, width + 1); changed.
        edges: x0, y0, x1, y1 in cells, the inside on the left, shape (E, 4).
        weights: shape (E,).
    """
    height, width = steps.shape[0], steps.shape[1] - 1
    for e in range(len(edges)):
        x0, y0, x1, y1 = edges[e, 0], edges[e, 1], edges[e, 2], edges[e, 3]
        begins = y1 < y0  # on the way down the inside lies to the right
        first = max(int(np.ceil(min(y0, y1))), 0)
        last = min(int(np.ceil(max(y0, y1))), height)
        for row in range(first, last):
            x = x0 + (row - y0) * (x1 - x0) / (y1 - y0)
            col = min(max(int(np.ceil(x)), 0), width)
            steps[row, col] += weights[e] if begins else -weights[e]


def _hull_of_cells(chosen: NDArray[np.bool_], grid: GridGeometry) -> BaseGeometry:
    """Return the convex hull of whole cells."""
    rows = np.flatnonzero(chosen.any(axis=1))
    left = chosen[rows].argmax(axis=1)
    right = chosen.shape[1] - 1 - chosen[rows, ::-1].argmax(axis=1)
    corner_rows = np.concatenate([rows - 0.5, rows + 0.5, rows - 0.5, rows + 0.5])
    corner_cols = np.concatenate([left - 0.5, left - 0.5, right + 0.5, right + 0.5])
    return _hull(grid.centers(corner_rows, corner_cols))


def _hull(points_xy: NDArray[np.float64]) -> BaseGeometry:
    """Return the convex hull of at least two points, shape (N, 2)."""
    return shapely.LineString(points_xy).convex_hull
