"""Fusion on a voting grid: views of an object vote on its shape, cell by cell."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import accumulate
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hypermap._loops import inner_loop, loop
from hypermap.core.arrays import BoolArray, IntArray
from hypermap.mapping.evidence_buffer import NEAR, Evidence, EvidenceBuffer
from hypermap.mapping.stages import EvidenceConfig

_MAX_CELLS_PER_SIDE = 128
_WHOLE = 0.6  # of the upper quartile of the areas; larger footprints show the whole object


def agreed_corners(
    buffer: EvidenceBuffer, config: EvidenceConfig, shifts: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """Return the shape on which enough views agree: the convex hull of cells, as its corners.

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
        The corners of the convex hull of these cells in the map frame [m], clockwise from the left
        one of the lowest, shape (M, 2); M is 0 if no cell belongs to the object.
    """
    items = buffer.items
    seen = np.array([evidence.seen for evidence in items])
    weights = seen[:, 0] if seen[:, 0].any() else np.ones(len(items))
    if config.half_weight < np.inf:
        weights = weights / (1 + (seen[:, 1] / config.half_weight) ** 2)
    moves = np.zeros((len(items), 2)) if shifts is None else shifts
    if config.align > 0:
        moves = moves + aligning_moves(seen[:, 2], buffer.centroids + moves, weights, config.align)
    low, high = np.fmin.reduce(seen[:, 3:5] + moves), np.fmax.reduce(seen[:, 5:] + moves)
    grid = _voting_grid((*low.tolist(), *high.tolist()), config.vote_resolution)
    is_unbounded = [len(evidence.prepared_area.edges) == 0 for evidence in items]
    unbounded_votes = float(weights[is_unbounded].sum()) if any(is_unbounded) else 0.0
    steps = np.zeros((2, grid.height, grid.width + 1))
    corners = np.empty((4 * grid.height, 2), np.int64)
    count = _hull_of_votes(
        *_joined([evidence.prepared.edges for evidence in items]),
        *_joined(_edges_of_areas(items, seen, grid)),
        np.ascontiguousarray(weights),
        moves,
        grid.place,
        steps,
        (unbounded_votes, config.vote_share),
        np.empty(grid.height, np.int64),
        corners,
    )
    return grid.points(corners[:count])


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
    first = np.array([0, *accumulate(map(len, edges))], np.int64)
    return np.concatenate(edges), first


def _edges_of_areas(
    items: Sequence[Evidence], seen: NDArray[np.float64], grid: _VotingGrid
) -> list[NDArray[np.float64]]:
    """Return those edges of the visible areas of some evidence that matter for the votes.

    Args:
        items: the evidence.
        seen: `Evidence.seen` of each, shape (N, 7).
        grid: on which they vote.
    """
    left, bottom, resolution = grid.place
    right, top = left + grid.width * resolution, bottom + grid.height * resolution
    return [
        evidence.near_edges
        if ymin - NEAR <= bottom and ymax + NEAR >= top and xmax + NEAR >= right
        else evidence.prepared_area.edges
        for evidence, (ymin, xmax, ymax) in zip(items, seen[:, 4:].tolist(), strict=True)
    ]


class _VotingGrid(NamedTuple):
    """Cells of the floor: their number, and x and y of the first corner and the side [m]."""

    width: int
    height: int
    place: tuple[float, float, float]

    def points(self, corners: IntArray) -> NDArray[np.float64]:
        """Return where corners of cells, (col, row), are [m], shape (N, 2)."""
        left, bottom, resolution = self.place
        points: NDArray[np.float64] = corners * resolution + np.array([left, bottom])
        return points


def _voting_grid(box: tuple[float, float, float, float], resolution: float) -> _VotingGrid:
    """Return a grid over a box, aligned to its resolution and of bounded size."""
    xmin, ymin, xmax, ymax = box
    resolution = max(resolution, max(xmax - xmin, ymax - ymin) / _MAX_CELLS_PER_SIDE)
    left, bottom = math.floor(xmin / resolution), math.floor(ymin / resolution)
    return _VotingGrid(
        width=math.floor(xmax / resolution) - left + 1,
        height=math.floor(ymax / resolution) - bottom + 1,
        place=(left * resolution, bottom * resolution, resolution),
    )


@loop()
def _hull_of_votes(
    edges: NDArray[np.float64],
    first: IntArray,
    area_edges: NDArray[np.float64],
    area_first: IntArray,
    weights: NDArray[np.float64],
    moves: NDArray[np.float64],
    place: tuple[float, float, float],
    steps: NDArray[np.float64],
    votes: tuple[float, float],
    ends: IntArray,
    corners: IntArray,
) -> int:
    """Find the convex hull of the accepted cells, and return how many corners it has.

    Args:
        edges: of all footprints, as `PreparedPolygon.edges`.
        first: offsets of the edges of each, shape (N + 1,).
        area_edges: of all visible areas.
        area_first: likewise.
        weights: of the views, shape (N,).
        moves: translations of the footprints [m], shape (N, 2).
        place: of the grid, as in `_VotingGrid`.
        steps: zeros, shape (2, height, width + 1); filled with the changes of the votes for each
            cell, and of all votes on it.
        votes: those cast on all cells, and the share of all votes that a cell needs.
        ends: filled with the last accepted cell of each row, -1 for none, shape (height,).
        corners: filled with them, (col, row), clockwise from the left
            one of the lowest, shape (4 height, 2).
    """
    _add_steps(edges, first, weights, moves, 1.0, place, steps[0])
    _add_steps(area_edges, area_first, weights, moves, 0.0, place, steps[1])
    height = steps.shape[1]
    begin = count = int(np.int64(0))  # `_with_corner` would be compiled once more for a constant
    for row in range(height):  # up the left side
        left, ends[row] = _accepted(steps, row, votes)
        if left >= 0:
            count = _with_corner(corners, count, begin, left, row)
            count = _with_corner(corners, count, begin, left, row + 1)
    begin = count
    for row in range(height - 1, -1, -1):  # down the right side
        if ends[row] >= 0:
            count = _with_corner(corners, count, begin, ends[row] + 1, row + 1)
            count = _with_corner(corners, count, begin, ends[row] + 1, row)
    return count


@inner_loop()
def _with_corner(corners: IntArray, count: int, begin: int, col: int, row: int) -> int:
    """Add a corner to a chain that only turns right, and return the number of corners.

    Args:
        corners: filled.
        count: how many there are.
        begin: where the chain begins among them.
        col: of the new corner.
        row: likewise.
    """
    while count - begin >= 2:
        x, y = corners[count - 2, 0], corners[count - 2, 1]
        along_x, along_y = corners[count - 1, 0] - x, corners[count - 1, 1] - y
        if along_x * (row - y) - along_y * (col - x) < 0:
            break
        count -= 1
    corners[count, 0], corners[count, 1] = col, row
    return count + 1


@loop()
def _add_steps(
    edges: NDArray[np.float64],
    first: IntArray,
    weights: NDArray[np.float64],
    moves: NDArray[np.float64],
    moved: float,
    place: tuple[float, float, float],
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
        moved: share of these that is applied.
        place: of the grid, as in `_VotingGrid`.
        steps: zeros, shape (height, width + 1); filled in.
    """
    height, width = steps.shape[0], steps.shape[1] - 1
    scale = 1 / place[2]
    x_begin, y_begin = -place[0] * scale, -place[1] * scale
    for polygon in range(len(weights)):
        x_move, y_move = moved * moves[polygon, 0], moved * moves[polygon, 1]
        for e in range(first[polygon], first[polygon + 1]):
            # In cells, whose centers are at integers.
            x0 = (edges[e, 0] + x_move) * scale + x_begin - 0.5
            y0 = (edges[e, 1] + y_move) * scale + y_begin - 0.5
            x1 = (edges[e, 2] + x_move) * scale + x_begin - 0.5
            y1 = (edges[e, 3] + y_move) * scale + y_begin - 0.5
            weight = weights[polygon] * edges[e, 4]
            begins = y1 < y0  # going down, the inside is to the right
            first_row = max(int(np.ceil(min(y0, y1))), 0)
            last_row = min(int(np.ceil(max(y0, y1))), height)
            for row in range(first_row, last_row):
                x = x0 + (row - y0) * (x1 - x0) / (y1 - y0)
                col = min(max(int(np.ceil(x)), 0), width)
                steps[row, col] += weight if begins else -weight


@inner_loop()
def _accepted(steps: NDArray[np.float64], row: int, votes: tuple[float, float]) -> tuple[int, int]:
    """Return the first and the last accepted cell of a row; -1 for none.

    Args:
        steps: as in `_hull_of_votes`.
        row: the row.
        votes: likewise.
    """
    votes_for = votes_cast = 0.0
    left = right = -1
    for col in range(steps.shape[2] - 1):
        votes_for += steps[0, row, col]
        votes_cast += steps[1, row, col]
        # A view has seen its own footprint, even if its visible area is a little smaller.
        needed = votes[1] * max(votes_cast + votes[0], votes_for)
        if votes_for > 1e-9 and votes_for >= needed - 1e-9:
            left = col if left < 0 else left
            right = col
    return left, right
