"""Fusion on a voting grid: views of an object vote on its shape, cell by cell."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hypermap._loops import loop
from hypermap.core.arrays import BoolArray, IntArray
from hypermap.mapping.evidence_buffer import NEAR, Evidence, EvidenceBuffer
from hypermap.mapping.stages import EvidenceConfig

_MAX_CELLS_PER_SIDE = 128
_WHOLE = 0.6  # of the upper quartile of the areas; larger footprints show the whole object


def agreed_points(
    buffer: EvidenceBuffer, config: EvidenceConfig, shifts: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """Return the corners of the cells on which enough views agree; their convex hull is the shape.

    The floor below the footprints is divided into cells. Each view votes, weighted by its
    detection's score, for the cells of its footprint, and abstains on cells outside its visible
    area: a frame that shows one half of a table does not vote against the other half. A cell
    belongs to the object if it gets `vote_share` of the votes cast on it.

    Near views have more weight (`half_weight`). Footprints are first aligned with each other
    (`align`).

    Args:
        buffer: the evidence.
        config: the settings.
        shifts: translations applied to the footprints first [m], shape (N, 2); None for none.

    Returns:
        Points in the map frame [m], shape (M, 2); M is 0 if no cell belongs to the object.
    """
    items = buffer.items
    scores = np.array([evidence.score for evidence in items], dtype=np.float64)
    if not scores.any():
        scores = np.ones(len(items))
    if config.half_weight < np.inf:
        distances = np.array([evidence.distance for evidence in items])
        scores /= 1 + (distances / config.half_weight) ** 2
    footprints = [evidence.prepared for evidence in items]
    moves = np.zeros((len(items), 2)) if shifts is None else shifts
    if config.align > 0:
        areas = np.array([polygon.area for polygon in footprints])
        moves = moves + aligning_moves(areas, buffer.centroids + moves, scores, config.align)

    boxes = np.array([polygon.box for polygon in footprints])
    low, high = np.fmin.reduce(boxes[:, :2] + moves), np.fmax.reduce(boxes[:, 2:] + moves)
    grid = _voting_grid((*low.tolist(), *high.tolist()), config.vote_resolution)
    to_cells = grid.to_cells_matrix()
    in_favor, cast = np.zeros((2, grid.height, grid.width + 1))
    _add_steps(*_joined([shape.edges for shape in footprints]), scores, moves, to_cells, in_favor)
    edges, first = _joined(_edges_of_areas(items, boxes, grid))
    _add_steps(edges, first, scores, np.zeros(moves.shape), to_cells, cast)
    is_unbounded = [len(evidence.prepared_area.edges) == 0 for evidence in items]
    unbounded_votes = scores[is_unbounded].sum() if any(is_unbounded) else 0.0
    found = np.empty((3, grid.height), np.int64)
    count = _choose(in_favor, cast, unbounded_votes, config.vote_share, *found)
    return grid.corners(*found[:, :count])


def aligning_moves(
    areas: NDArray[np.float64],
    centroids: NDArray[np.float64],
    weights: NDArray[np.float64],
    limit: float,
) -> NDArray[np.float64]:
    """Return translations that align footprints, because pose drift would blur the shape.

    Footprints of about the whole object are moved so that their centroids meet at the weighted
    median. Partial views stay, because their centroids may differ.

    Args:
        areas: of the footprints [m²], shape (N,).
        centroids: of the footprints [m], shape (N, 2).
        weights: positive, shape (N,).
        limit: footprints farther than this from the median stay [m].

    Returns:
        Translations [m], shape (N, 2).
    """
    moves = np.empty(centroids.shape)
    order = np.argsort(centroids, axis=0, kind="stable")
    _fill_moves(order, shows_whole(areas), centroids, weights, limit, moves)
    return moves


@loop()
def _fill_moves(
    order: IntArray,
    is_whole: BoolArray,
    centroids: NDArray[np.float64],
    weights: NDArray[np.float64],
    limit: float,
    moves: NDArray[np.float64],
) -> None:
    """Find the translations of `aligning_moves`.

    Args:
        order: of the centroids by x and by y, shape (N, 2).
        is_whole: which footprints show about the whole object, at least one, shape (N,).
        centroids: as in `aligning_moves`, and so on.
        weights: likewise.
        limit: likewise.
        moves: filled, shape (N, 2).
    """
    count = len(weights)
    for axis in range(2):
        total = 0.0
        for k in range(count):
            if is_whole[order[k, axis]]:
                total += weights[order[k, axis]]
        so_far, median = 0.0, 0.0
        for k in range(count):
            i = order[k, axis]
            if is_whole[i]:
                so_far += weights[i]
                median = centroids[i, axis]
                if so_far >= total / 2:
                    break
        for i in range(count):
            moves[i, axis] = median - centroids[i, axis]
    for i in range(count):
        if not is_whole[i] or np.hypot(moves[i, 0], moves[i, 1]) > limit:
            moves[i, 0] = moves[i, 1] = 0.0


def shows_whole(areas: NDArray[np.float64]) -> BoolArray:
    """Return which footprints, by their areas [m²], show about the whole object, shape (N,)."""
    ranked = np.sort(areas)
    place = 0.75 * (len(areas) - 1)
    below = int(place)
    above, share = min(below + 1, len(areas) - 1), place - below
    return np.asarray(areas >= _WHOLE * (ranked[below] * (1 - share) + ranked[above] * share))


def _joined(
    edges: Sequence[NDArray[np.float64]],
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the edges of N polygons, shape (E, 5), and the offsets of each, shape (N + 1,)."""
    first = np.zeros(len(edges) + 1, dtype=np.int64)
    np.cumsum([len(each) for each in edges], out=first[1:])
    return np.concatenate(edges), first


def _edges_of_areas(
    items: Sequence[Evidence], boxes: NDArray[np.float64], grid: _VotingGrid
) -> list[NDArray[np.float64]]:
    """Return those edges of the visible areas of some evidence that matter for the votes.

    Args:
        items: the evidence.
        boxes: of their footprints [m], shape (N, 4).
        grid: on which they vote.
    """
    right = grid.left + grid.width * grid.resolution
    top = grid.bottom + grid.height * grid.resolution
    is_near = (boxes[:, 1] - NEAR <= grid.bottom) & (boxes[:, 3] + NEAR >= top)
    is_near &= boxes[:, 2] + NEAR >= right
    return [
        evidence.near_edges if near else evidence.prepared_area.edges
        for evidence, near in zip(items, is_near.tolist(), strict=True)
    ]


class _VotingGrid(NamedTuple):
    """Cells of the floor, whose lengths are in meters."""

    left: float
    bottom: float
    width: int
    height: int
    resolution: float

    def to_cells_matrix(self) -> NDArray[np.float64]:
        """Return the same as that of `GridGeometry`, shape (3, 3)."""
        scale = 1 / self.resolution
        return np.array(
            [[scale, 0, -self.left * scale], [0, scale, -self.bottom * scale], [0, 0, 1.0]]
        )

    def corners(self, rows: IntArray, left: IntArray, right: IntArray) -> NDArray[np.float64]:
        """Return the corners of the first and the last cells of N rows [m], shape (4 N, 2)."""
        points = np.empty((2, 2, len(rows), 2))
        for side, cols in enumerate((left, right + 1)):
            points[side, :, :, 0] = cols * self.resolution + self.left
        for end in (0, 1):
            points[:, end, :, 1] = (rows + end) * self.resolution + self.bottom
        return points.reshape(-1, 2)


def _voting_grid(box: tuple[float, float, float, float], resolution: float) -> _VotingGrid:
    """Return a grid over a box, aligned to its resolution and of bounded size."""
    xmin, ymin, xmax, ymax = box
    resolution = max(resolution, max(xmax - xmin, ymax - ymin) / _MAX_CELLS_PER_SIDE)
    left, bottom = math.floor(xmin / resolution), math.floor(ymin / resolution)
    return _VotingGrid(
        left=left * resolution,
        bottom=bottom * resolution,
        width=math.floor(xmax / resolution) - left + 1,
        height=math.floor(ymax / resolution) - bottom + 1,
        resolution=resolution,
    )


@loop()
def _add_steps(
    edges: NDArray[np.float64],
    first: IntArray,
    weights: NDArray[np.float64],
    moves: NDArray[np.float64],
    to_cells: NDArray[np.float64],
    steps: NDArray[np.float64],
) -> None:
    """Rasterize weighted polygons: add the change of the votes from each cell to the next.

    A cell's votes are the sum of the weights of the polygons that cover its center, which is the
    cumulative sum of the steps in its row.

    Args:
        edges: of all polygons, as `PreparedPolygon.edges`.
        first: offsets of the edges of each of N polygons, shape (N + 1,).
        weights: of the polygons, shape (N,).
        moves: translations applied to the polygons first [m], shape (N, 2).
        to_cells: `GridGeometry.to_cells_matrix` of a grid that is not rotated.
        steps: zeros, shape (height, width + 1); filled in.
    """
    height, width = steps.shape[0], steps.shape[1] - 1
    x_scale, y_scale = to_cells[0, 0], to_cells[1, 1]
    x_begin, y_begin = to_cells[0, 2], to_cells[1, 2]
    for polygon in range(len(weights)):
        x_move, y_move = moves[polygon, 0], moves[polygon, 1]
        for e in range(first[polygon], first[polygon + 1]):
            # In cells, whose centers are at integers.
            x0 = (edges[e, 0] + x_move) * x_scale + x_begin - 0.5
            y0 = (edges[e, 1] + y_move) * y_scale + y_begin - 0.5
            x1 = (edges[e, 2] + x_move) * x_scale + x_begin - 0.5
            y1 = (edges[e, 3] + y_move) * y_scale + y_begin - 0.5
            weight = weights[polygon] * edges[e, 4]
            begins = y1 < y0  # going down, the inside is to the right
            first_row = max(int(np.ceil(min(y0, y1))), 0)
            last_row = min(int(np.ceil(max(y0, y1))), height)
            for row in range(first_row, last_row):
                x = x0 + (row - y0) * (x1 - x0) / (y1 - y0)
                col = min(max(int(np.ceil(x)), 0), width)
                steps[row, col] += weight if begins else -weight


@loop()
def _choose(
    in_favor: NDArray[np.float64],
    cast: NDArray[np.float64],
    unbounded_votes: float,
    share: float,
    rows: IntArray,
    left: IntArray,
    right: IntArray,
) -> int:
    """Find the rows with accepted cells, and return how many there are.

    Args:
        in_favor: steps of the votes for each cell, shape (height, width + 1).
        cast: steps of all votes on each cell, for and against, of the same shape.
        unbounded_votes: votes cast on all cells.
        share: share of the votes cast that a cell needs.
        rows: filled with those rows, shape (height,).
        left: filled with the first accepted cell of each, shape (height,).
        right: filled with the last accepted cell of each, shape (height,).
    """
    height, width = in_favor.shape[0], in_favor.shape[1] - 1
    count = 0
    for row in range(height):
        votes_for = votes_cast = 0.0
        is_first = True
        for col in range(width):
            votes_for += in_favor[row, col]
            votes_cast += cast[row, col]
            # A view has seen its own footprint, even if its visible area is a little smaller.
            needed = share * max(votes_cast + unbounded_votes, votes_for)
            if votes_for > 1e-9 and votes_for >= needed - 1e-9:
                if is_first:
                    rows[count], left[count] = row, col
                    count, is_first = count + 1, False
                right[count - 1] = col
    return count
