"""The views of an object vote on its shape, cell by cell."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hypermap._loops import inner_loop, loop
from hypermap.core.arrays import IntArray
from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.mapping.outlines import Outline
from hypermap.mapping.pile import Pile
from hypermap.mapping.stages import EvidenceConfig

_MAX_CELLS_PER_SIDE = 128
_WHOLE = 0.6  # of the area that a quarter of the footprints exceed: what shows the whole object


def agreed_points(pile: Pile, config: EvidenceConfig) -> NDArray[np.float64]:
    """Return corners of the cells that enough of the views agree on; their hull is the shape.

    The ground under the footprints is cut into cells. Each view votes, with its detection's
    score, for the cells of its footprint, and abstains on cells outside its observed area: the
    half of a table that one frame shows does not vote against the other half. A cell belongs to
    the object if it gets `vote_share` of the votes cast on it.

    Near views weigh more (`half_weight`), and footprints are moved onto each other first (`align`).

    Returns:
        Points in the map frame [m], shape (N, 2); none if no cell belongs to the object.
    """
    scores = np.array([evidence.score for evidence in pile.items], dtype=np.float64)
    if not scores.any():
        scores = np.ones(len(pile))
    if config.half_weight < np.inf:
        distances = np.array([evidence.distance for evidence in pile.items])
        scores /= 1 + (distances / config.half_weight) ** 2
    footprints = [evidence.outline for evidence in pile.items]
    grounds = [evidence.ground for evidence in pile.items]
    moves = np.zeros((len(pile), 2))
    if config.align > 0:
        areas = np.array([outline.area for outline in footprints])
        moves = aligning_moves(areas, pile.centroids, scores, config.align)

    edges, first = _joined(footprints)
    grid = _voting_grid(_bounds(edges, first, moves), config.vote_resolution)
    to_cells = grid.to_cells_matrix()
    ayes = _steps(edges, first, scores, moves, grid.shape, to_cells)
    edges, first = _joined(grounds)
    cast = _steps(edges, first, scores, np.zeros(moves.shape), grid.shape, to_cells)
    without_area = scores[first[1:] == first[:-1]].sum()
    rows, left, right = _chosen(ayes, cast, without_area, config.vote_share)
    corner_rows = np.concatenate([rows - 0.5, rows + 0.5, rows - 0.5, rows + 0.5])
    corner_cols = np.concatenate([left - 0.5, left - 0.5, right + 0.5, right + 0.5])
    return grid.centers(corner_rows, corner_cols)


def aligning_moves(
    areas: NDArray[np.float64],
    centroids: NDArray[np.float64],
    weights: NDArray[np.float64],
    limit: float,
) -> NDArray[np.float64]:
    """Return by how much to move footprints to where most are, as drifting poses would blur them.

    Those that show about the whole object are moved: their centroids come to the weighted median
    of them. Parts stay where they are, as their centroids may well differ.

    Args:
        areas: of the footprints [m²], shape (N,).
        centroids: of the footprints [m], shape (N, 2).
        weights: positive, shape (N,).
        limit: footprints farther than this from the median stay where they are [m].

    Returns:
        Moves [m], shape (N, 2).
    """
    moves = np.empty(centroids.shape)
    order = np.argsort(centroids, axis=0, kind="stable")
    _align(moves, np.sort(areas), areas, centroids, order, weights, limit)
    return moves


@loop()
def _align(
    moves: NDArray[np.float64],
    sorted_areas: NDArray[np.float64],
    areas: NDArray[np.float64],
    centroids: NDArray[np.float64],
    order: IntArray,
    weights: NDArray[np.float64],
    limit: float,
) -> None:
    """Do what `aligning_moves` says.

    Args:
        moves: to be filled, shape (N, 2).
        sorted_areas: in rising order, shape (N,).
        areas: as there.
        centroids: as there.
        order: of the centroids along each axis, shape (N, 2).
        weights: as there.
        limit: as there.
    """
    count = len(areas)
    place = 0.75 * (count - 1)
    below = int(place)
    above = below + 1 if below + 1 < count else below
    share = place - below
    quartile = sorted_areas[below] * (1 - share) + sorted_areas[above] * share
    least = _WHOLE * quartile  # what shows the whole object
    for axis in range(2):
        median = _weighted_median(axis, least, areas, centroids, order, weights)
        for i in range(count):
            moves[i, axis] = median - centroids[i, axis]
    for i in range(count):
        if areas[i] < least or np.hypot(moves[i, 0], moves[i, 1]) > limit:
            moves[i, 0] = moves[i, 1] = 0


@inner_loop()
def _weighted_median(axis, least, areas, centroids, order, weights):  # type: ignore[no-untyped-def]
    """Return the first coordinate with half of the weights of what is large enough up to it."""
    whole = 0.0
    for k in range(len(order)):
        i = order[k, axis]
        if areas[i] >= least:
            whole += weights[i]
    total, median = 0.0, np.nan
    for k in range(len(order)):
        i = order[k, axis]
        if areas[i] >= least:
            total += weights[i]
            median = centroids[i, axis]
            if total >= whole / 2:
                break
    return median


def _joined(outlines: Sequence[Outline]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the edges of all outlines, and where those of each begin and the last ones end."""
    first = np.zeros(len(outlines) + 1, dtype=np.int64)
    np.cumsum([len(outline.edges) for outline in outlines], out=first[1:])
    return np.concatenate([outline.edges for outline in outlines]), first


@loop()
def _bounds(
    edges: NDArray[np.float64], first: IntArray, moves: NDArray[np.float64]
) -> tuple[float, float, float, float]:
    """Return the box of all polygons after their moves, as `_add_steps` takes them."""
    xmin = ymin = np.inf
    xmax = ymax = -np.inf
    for polygon in range(len(moves)):
        for e in range(first[polygon], first[polygon + 1]):
            x, y = edges[e, 0] + moves[polygon, 0], edges[e, 1] + moves[polygon, 1]
            xmin, ymin, xmax, ymax = min(xmin, x), min(ymin, y), max(xmax, x), max(ymax, y)
    return xmin, ymin, xmax, ymax


def _voting_grid(box: tuple[float, float, float, float], resolution: float) -> GridGeometry:
    """Return a grid over a box, aligned to its resolution and of bounded size."""
    xmin, ymin, xmax, ymax = box
    resolution = max(resolution, max(xmax - xmin, ymax - ymin) / _MAX_CELLS_PER_SIDE)
    left, bottom = np.floor(xmin / resolution), np.floor(ymin / resolution)
    return GridGeometry(
        width=int(np.floor(xmax / resolution) - left) + 1,
        height=int(np.floor(ymax / resolution) - bottom) + 1,
        resolution=resolution,
        origin=Pose2D(float(left * resolution), float(bottom * resolution)),
    )


@loop()
def _steps(
    edges: NDArray[np.float64],
    first: IntArray,
    weights: NDArray[np.float64],
    moves: NDArray[np.float64],
    shape: tuple[int, int],
    to_cells: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return by how much the votes change from each cell to the next, (height, width + 1).

    A cell gets the weights of the polygons that cover its centre: the sum of its row's steps up to
    its own.

    Args:
        edges: of all polygons, as `Outline.edges`.
        first: where the edges of each of N polygons begin and the last ones end, shape (N + 1,).
        weights: of the polygons, shape (N,).
        moves: by how much the polygons are moved first [m], shape (N, 2).
        shape: height and width of a grid that is not turned.
        to_cells: its `GridGeometry.to_cells_matrix`.
    """
    height, width = shape
    steps = np.zeros((height, width + 1))
    x_scale, y_scale = to_cells[0, 0], to_cells[1, 1]
    x_begin, y_begin = to_cells[0, 2], to_cells[1, 2]
    for polygon in range(len(weights)):
        x_move, y_move = moves[polygon, 0], moves[polygon, 1]
        for e in range(first[polygon], first[polygon + 1]):
            # In cells, whose centres are at whole numbers.
            x0 = (edges[e, 0] + x_move) * x_scale + x_begin - 0.5
            y0 = (edges[e, 1] + y_move) * y_scale + y_begin - 0.5
            x1 = (edges[e, 2] + x_move) * x_scale + x_begin - 0.5
            y1 = (edges[e, 3] + y_move) * y_scale + y_begin - 0.5
            weight = weights[polygon] * edges[e, 4]
            begins = y1 < y0  # on the way down the inside lies to the right
            first_row = max(int(np.ceil(min(y0, y1))), 0)
            last_row = min(int(np.ceil(max(y0, y1))), height)
            for row in range(first_row, last_row):
                x = x0 + (row - y0) * (x1 - x0) / (y1 - y0)
                col = min(max(int(np.ceil(x)), 0), width)
                steps[row, col] += weight if begins else -weight
    return steps


@loop()
def _chosen(
    ayes: NDArray[np.float64], cast: NDArray[np.float64], without_area: float, share: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return the rows in which cells are chosen, and the first and last such cell of each.

    Args:
        ayes: steps of the votes for each cell, shape (height, width + 1).
        cast: steps of the votes for and against each cell, of the same shape.
        without_area: votes that are cast on all cells.
        share: of the votes cast, that a cell needs.
    """
    height, width = ayes.shape[0], ayes.shape[1] - 1
    rows, left = np.empty(height, dtype=np.int64), np.empty(height, dtype=np.int64)
    right = np.empty(height, dtype=np.int64)
    count = 0
    for row in range(height):
        votes_for = votes_cast = 0.0
        is_first = True
        for col in range(width):
            votes_for += ayes[row, col]
            votes_cast += cast[row, col]
            # A view has seen its own footprint, even where its observed area is a little smaller.
            needed = share * max(votes_cast + without_area, votes_for)
            if votes_for > 1e-9 and votes_for >= needed - 1e-9:
                if is_first:
                    rows[count], left[count] = row, col
                    count, is_first = count + 1, False
                right[count - 1] = col
    return rows[:count], left[:count], right[:count]
