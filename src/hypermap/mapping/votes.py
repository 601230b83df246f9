"""Fusion on a voting grid: views of an object vote on its shape, cell by cell."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap._loops import inner_loop, loop
from hypermap.core.arrays import IntArray, as_objects
from hypermap.mapping.evidence_buffer import EvidenceBuffer
from hypermap.mapping.footprint_alignment import align_footprints
from hypermap.mapping.prepared_polygon import Box
from hypermap.mapping.stages import EvidenceConfig

_MAX_CELLS_PER_SIDE = 128
_MOST = _MAX_CELLS_PER_SIDE + 4  # with what rounding to cells adds, and one column more


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
        one of the lowest back to it, shape (M, 2); M is 0 if no cell belongs to the object.
    """
    corners_xy, _, _ = _vote(buffer, config, shifts)
    return corners_xy


def votes_at(
    buffer: EvidenceBuffer,
    config: EvidenceConfig,
    shifts: NDArray[np.float64],
    points_xy: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the votes for some places, and the votes cast on them, as in `agreed_corners`.

    Args:
        buffer: the evidence.
        config: the settings.
        shifts: translations applied to the footprints first [m], shape (N, 2).
        points_xy: the places in the map frame [m], shape (P, 2).

    Returns:
        Shape (2, P); no place has more votes than were cast on it.
    """
    _, moves, weights = _vote(buffer, config, shifts)
    areas = as_objects(item.visible_area for item in buffer.items)
    shapely.prepare(areas)
    votes, cast = np.zeros((2, len(points_xy)))
    for shape, move, area, weight in zip(buffer.footprints(), moves, areas, weights, strict=True):
        votes += weight * shapely.contains_xy(shape, points_xy - move)
        cast += weight if area.is_empty else weight * shapely.contains_xy(area, points_xy)
    # A view has seen its own footprint, even if its visible area is a little smaller.
    return np.vstack([votes, np.maximum(cast, votes)])


def _vote(
    buffer: EvidenceBuffer, config: EvidenceConfig, shifts: NDArray[np.float64] | None
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return what `agreed_corners` does, the translations of the footprints, and their weights."""
    count, views = len(buffer), buffer.views
    shifts = np.zeros((count, 2)) if shifts is None else shifts
    limits = config.half_weight, config.align, config.vote_resolution, config.vote_share
    room = np.empty(count, np.int64), np.empty((2, count, 2)), np.empty(count)
    grid = np.empty((2, _MOST, _MOST)), np.empty((2, _MOST)), np.empty((2, _MOST), np.int64)
    corners = np.empty((4 * _MOST + 1, 2))
    while True:
        given = views.seen, views.edges, views.near, views.counts, views.box, buffer.centroids
        found, *box = _agreed(*given, shifts, limits, *room, *grid, corners)
        if found >= 0:
            return corners[:found], room[1][0], room[2]
        views.look_at((box[0], box[1], box[2], box[3]), buffer.items)


@loop()
def _agreed(
    seen: NDArray[np.float64],
    edges: NDArray[np.float64],
    near: NDArray[np.float64],
    counts: IntArray,
    box: Box,
    centroids: NDArray[np.float64],
    shifts: NDArray[np.float64],
    limits: tuple[float, float, float, float],
    order: IntArray,
    places: NDArray[np.float64],
    weights: NDArray[np.float64],
    steps: NDArray[np.float64],
    sums: NDArray[np.float64],
    ends: IntArray,
    corners: NDArray[np.float64],
) -> tuple[int, float, float, float, float]:
    """Do the work of `agreed_corners`.

    Args:
        seen: as `JoinedViews.seen`, as `edges`, `near`, `counts` and `box`.
        edges: likewise.
        near: likewise.
        counts: likewise.
        box: likewise.
        centroids: of the footprints [m], shape (N, 2).
        shifts: as in `agreed_corners`, but zeros for none.
        limits: the settings `half_weight`, `align`, `vote_resolution` [m] and `vote_share`.
        order: room for the order of the views, shape (N,).
        places: room for the translations of the footprints, and for their centroids after
            `shifts` [m], shape (2, N, 2).
        weights: room for the weights of the views, shape (N,).
        steps: room for the votes, shape (2, M, M), for grids of M - 1 by M - 1 cells.
        sums: room for the votes of a column, shape (2, M).
        ends: room for the ends of the rows, shape (2, M).
        corners: filled with the corners [m], shape (4 M + 1, 2).

    Returns:
        The number of corners, -1 if `box` does not contain the grid; and the grid's box: xmin,
        ymin, xmax, ymax [m].
    """
    moves = places[0]
    for i in range(len(seen)):
        for axis in range(2):
            moves[i, axis] = shifts[i, axis]
            places[1, i, axis] = centroids[i, axis] + shifts[i, axis]
    unbounded = _weigh(seen, counts, limits, weights)
    if limits[1] > 0:
        area = int(np.int64(2))  # `align_footprints` would be compiled once more for a constant
        align_footprints(seen, area, places[1], weights, limits[1], order, moves)
    xmin, ymin, xmax, ymax = _box_of(seen, moves)
    side = max(limits[2], max(xmax - xmin, ymax - ymin) / _MAX_CELLS_PER_SIDE)
    left, bottom = np.floor(xmin / side), np.floor(ymin / side)
    width = int(np.floor(xmax / side) - left) + 1
    height = int(np.floor(ymax / side) - bottom) + 1
    left, bottom = left * side, bottom * side
    right, top = left + width * side, bottom + height * side
    if left < box[0] or bottom < box[1] or right > box[2] or top > box[3]:
        return -1, left, bottom, right, top
    for k in range(2):
        for col in range(width + 1):
            for row in range(height):
                steps[k, col, row] = 0.0
    grid, place, votes = (height, width), (left, bottom, side), (unbounded, limits[3])
    first = int(np.int64(0))  # `_add_steps` would be compiled once more for a constant
    _add_steps(edges, counts, first, weights, moves, 1.0, grid, place, steps[0])
    _add_steps(near, counts, first + 1, weights, moves, 0.0, grid, place, steps[1])
    _find_ends(steps, grid, votes, sums, ends)
    count = _hull_of(ends, grid, place, corners)
    return count, left, bottom, right, top


@inner_loop()
def _weigh(
    seen: NDArray[np.float64],
    counts: IntArray,
    limits: tuple[float, float, float, float],
    weights: NDArray[np.float64],
) -> float:
    """Find the weights of the views, and return the votes of those that have seen everything.

    Args:
        seen: as in `_agreed`, as `counts` and `limits`.
        counts: likewise.
        limits: likewise.
        weights: filled, shape (N,).
    """
    count = len(seen)
    has_scores = False
    for i in range(count):
        has_scores = has_scores or seen[i, 0] != 0
    unbounded = 0.0
    for i in range(count):
        far = seen[i, 1] / limits[0]
        weights[i] = (seen[i, 0] if has_scores else 1.0) / (1 + far * far)
        if counts[i, 1] < 0:
            unbounded += weights[i]
    return unbounded


@inner_loop()
def _box_of(
    seen: NDArray[np.float64], moves: NDArray[np.float64]
) -> tuple[float, float, float, float]:
    """Return the box around all footprints after translations: xmin, ymin, xmax, ymax [m].

    Args:
        seen: as in `_agreed`.
        moves: translations of the footprints [m], shape (N, 2).
    """
    xmin = ymin = np.inf
    xmax = ymax = -np.inf
    for i in range(len(seen)):
        xmin, ymin = min(xmin, seen[i, 3] + moves[i, 0]), min(ymin, seen[i, 4] + moves[i, 1])
        xmax, ymax = max(xmax, seen[i, 5] + moves[i, 0]), max(ymax, seen[i, 6] + moves[i, 1])
    return xmin, ymin, xmax, ymax


@inner_loop()
def _hull_of(
    ends: IntArray,
    grid: tuple[int, int],
    place: tuple[float, float, float],
    corners: NDArray[np.float64],
) -> int:
    """Find the convex hull of the accepted cells, and return how many corners it has.

    Args:
        ends: as `_find_ends` fills it.
        grid: the numbers of its rows and columns.
        place: of the grid: x and y of its first corner, and the side of a cell [m].
        corners: filled with them [m], clockwise from the left one of the lowest back to it, shape
            (4 M + 1, 2).
    """
    begin = count = int(np.int64(0))  # others would be compiled once more for a constant
    for row in range(grid[0]):  # up the left side
        if ends[1, row] >= 0:
            count = _with_corner(corners, count, begin, ends[0, row], row)
            count = _with_corner(corners, count, begin, ends[0, row], row + 1)
    begin = count
    for row in range(grid[0] - 1, -1, -1):  # down the right side
        if ends[1, row] >= 0:
            count = _with_corner(corners, count, begin, ends[1, row] + 1, row + 1)
            count = _with_corner(corners, count, begin, ends[1, row] + 1, row)
    if count:
        corners[count, 0], corners[count, 1] = corners[0, 0], corners[0, 1]
        count += 1
    for corner in range(count):  # from cells to meters
        for axis in range(2):
            corners[corner, axis] = corners[corner, axis] * place[2] + place[axis]
    return count


@inner_loop()
def _with_corner(corners: NDArray[np.float64], count: int, begin: int, col: int, row: int) -> int:
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
    counts: IntArray,
    column: int,
    weights: NDArray[np.float64],
    moves: NDArray[np.float64],
    moved: float,
    grid: tuple[int, int],
    place: tuple[float, float, float],
    steps: NDArray[np.float64],
) -> None:
    """Rasterize weighted polygons: add the change of the votes from each cell to the next.

    A cell's votes are the sum of the weights of the polygons that cover its center, which is the
    cumulative sum of the steps in its row.

    Args:
        edges: of all polygons, as `PreparedPolygon.edges`.
        counts: of the edges of each of N polygons, shape (N, 2).
        column: which of the two counts it is.
        weights: of the polygons, shape (N,).
        moves: translations applied to the polygons first [m], shape (N, 2).
        moved: share of these that is applied.
        grid: the numbers of its rows and columns.
        place: of the grid, as in `_hull_of`.
        steps: for each column the changes in all rows, which are added, shape (M, M).
    """
    height, width = grid
    scale = 1 / place[2]
    x_begin, y_begin = -place[0] * scale, -place[1] * scale
    begin = end = int(np.int64(0))
    for polygon in range(len(weights)):
        begin, end = end, end + max(counts[polygon, column], 0)
        x_move, y_move = moved * moves[polygon, 0], moved * moves[polygon, 1]
        for e in range(begin, end):
            # In cells, whose centers are at integers.
            x0 = (edges[e, 0] + x_move) * scale + x_begin - 0.5
            y0 = (edges[e, 1] + y_move) * scale + y_begin - 0.5
            x1 = (edges[e, 2] + x_move) * scale + x_begin - 0.5
            y1 = (edges[e, 3] + y_move) * scale + y_begin - 0.5
            weight = weights[polygon] * edges[e, 4]
            begins = y1 < y0  # going down, the inside is to the right
            first_row = max(int(np.ceil(min(y0, y1))), 0)
            last_row = min(int(np.ceil(max(y0, y1))), height)
            slope = (x1 - x0) / (y1 - y0)
            for row in range(first_row, last_row):
                x = x0 + (row - y0) * slope
                col = min(max(int(np.ceil(x)), 0), width)
                steps[col, row] += weight if begins else -weight


@inner_loop()
def _find_ends(
    steps: NDArray[np.float64],
    grid: tuple[int, int],
    votes: tuple[float, float],
    sums: NDArray[np.float64],
    ends: IntArray,
) -> None:
    """Find the first and the last accepted cell of each row.

    This goes column by column, so that the compiler computes several rows at once.

    Args:
        steps: the changes of the votes for each cell, and of all votes on it, as in `_agreed`.
        grid: the numbers of its rows and columns.
        votes: those cast on all cells, and the share of all votes that a cell needs.
        sums: room for the votes for the cells of a column, and for all on it, shape (2, M).
        ends: filled; the last one of a row without any is -1, shape (2, M).
    """
    height, width = grid
    for row in range(height):
        sums[0, row] = sums[1, row] = 0.0
        ends[0, row], ends[1, row] = width, -1
    for col in range(width):
        for row in range(height):
            votes_for = sums[0, row] + steps[0, col, row]
            votes_cast = sums[1, row] + steps[1, col, row]
            sums[0, row], sums[1, row] = votes_for, votes_cast
            # A view has seen its own footprint, even if its visible area is a little smaller.
            needed = votes[1] * max(votes_cast + votes[0], votes_for)
            is_accepted = (votes_for > 1e-9) & (votes_for >= needed - 1e-9)
            ends[0, row] = min(ends[0, row], col if is_accepted else width)
            ends[1, row] = max(ends[1, row], col if is_accepted else -1)
