"""Search for a place: the pose at which surfaces of one part of a drive match those of another.

Source: Olson, "Real-time correlative scan matching", ICRA 2009; its search by branch and bound
over grids of maxima is that of Hess, Kohler, Rapp, Andor, "Real-time loop closure in 2D LIDAR
SLAM", ICRA 2016. Here points are in bands of height, so that a table does not match a wall.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from hypermap._loops import loop
from hypermap.core.arrays import IntArray
from hypermap.mapping.pose_graph.planar import Array

_SIDE = 0.05  # of a cell [m]
_BANDS = np.array([0.4, 0.85, 1.3])  # heights between bands [m]
_LEVELS = 5  # of grids; the coarsest has cells 2 ** (_LEVELS - 1) as large
_SPREAD = 1.0  # cells; standard deviation of the place of a surface
_STEP = math.radians(1.0)
_MOST_POINTS = 500
_FEWEST_POINTS = 60
_ELSEWHERE = np.array([0.4, math.radians(10)])  # by which another place differs [m, rad]

Cells = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Found:
    """The best place of a search.

    Attributes:
        a_T_b: pose of the second part in the first: x, y, yaw [m, m, rad], shape (3,).
        score: 0..1; 1 if all its points are on surfaces of the first.
        other: the best score of other places, 0 if below the least of interest.
    """

    a_T_b: Array
    score: float
    other: float


class Surroundings:
    """The surfaces around a place, as a pyramid of grids of maxima."""

    def __init__(self, points: Array) -> None:
        """Prepare to search.

        Args:
            points: of upright surfaces, x and y from the place, z from the floor [m], shape (N, 3).
        """
        self._first = np.floor(points[:, :2].min(axis=0) / _SIDE).astype(int) - 4
        shape = np.floor(points[:, :2].max(axis=0) / _SIDE).astype(int) - self._first + 5
        band = np.digitize(points[:, 2], _BANDS)
        cells = np.floor(points[:, :2] / _SIDE).astype(int) - self._first
        grid = np.zeros((len(_BANDS) + 1, *shape[::-1]), np.float32)
        grid[band, cells[:, 1], cells[:, 0]] = 1
        blurred = np.stack([_near(one) for one in grid])
        levels = [blurred]
        for level in range(1, _LEVELS):
            levels.append(_maxima(levels[-1], 2 ** (level - 1)))
        self._levels = levels

    def place_of(self, points: Array, about: Array, reach: Array, least: float) -> Found | None:
        """Return the pose at which the points of another part match best; None if none does.

        Args:
            points: as above, from its own place, shape (N, 3).
            about: approximate pose of this place: x, y, yaw [m, m, rad], shape (3,).
            reach: largest error of this pose [m, rad], shape (2,).
            least: least score of a match; and the share of the best score that another place must
                have to be of interest.
        """
        points = thinned(points)
        if len(points) < _FEWEST_POINTS:
            return None
        yaws = about[2] + np.arange(-reach[1], reach[1] + _STEP, _STEP)
        cells, bands = self._cells(points, about[:2], yaws), np.digitize(points[:, 2], _BANDS)
        steps = math.ceil(reach[0] / _SIDE)
        best = self._best(cells, bands, steps, least, np.ones(len(yaws), bool), None)
        if best is None:
            return None
        yaw, dx, dy, score = best
        near = np.abs(yaws - yaws[yaw]) <= _ELSEWHERE[1]
        away = round(_ELSEWHERE[0] / _SIDE)
        others = [
            self._best(cells, bands, steps, least * score, ~near, None),
            self._best(cells, bands, steps, least * score, near, (dx, dy, away)),
        ]
        other = max((found[3] for found in others if found is not None), default=0.0)
        x, y = about[:2] + np.array([dx, dy]) * _SIDE
        return Found(np.array([x, y, yaws[yaw]]), score, other)

    def _cells(self, points: Array, about: Array, yaws: Array) -> IntArray:
        """Return column and row of each point for each yaw, shape (Y, N, 2)."""
        cos, sin = np.cos(yaws)[:, np.newaxis], np.sin(yaws)[:, np.newaxis]
        x = cos * points[:, 0] - sin * points[:, 1] + about[0]
        y = sin * points[:, 0] + cos * points[:, 1] + about[1]
        places = np.floor(np.stack([x, y], axis=2) / _SIDE).astype(np.int64) - self._first
        return np.ascontiguousarray(places)

    def _best(
        self,
        cells: IntArray,
        bands: IntArray,
        steps: int,
        least: float,
        is_tried: NDArray[np.bool_],
        spared: tuple[int, int, int] | None,
    ) -> tuple[int, int, int, float] | None:
        """Return the best place: index of the yaw, steps in x and y, and score.

        Args:
            cells: of the points for each yaw, shape (Y, N, 2).
            bands: of the points, shape (N,).
            steps: largest difference in x and y.
            least: least score.
            is_tried: which yaws are tried, shape (Y,).
            spared: x, y and radius of an area that is excluded, in steps; None for none.
        """
        coarsest = 2 ** (_LEVELS - 1)
        corners = np.arange(-steps, steps + 1, coarsest)
        chosen = np.flatnonzero(is_tried)
        first = np.array(np.meshgrid(chosen, corners, corners, indexing="ij")).reshape(3, -1).T
        bounds = np.zeros(len(first))
        grid = self._levels[-1]
        _score(grid, coarsest - 1, cells, bands, np.ascontiguousarray(first), bounds)
        best: tuple[int, int, int, float] | None = None
        # Best first, then depth first: bounds of finer cells are never larger.
        stack = [(bounds[k], _LEVELS - 1, first[k]) for k in np.argsort(bounds)]
        while stack:
            bound, level, node = stack.pop()
            if bound <= least:
                if level == _LEVELS - 1:
                    break  # the others have smaller bounds
                continue
            if level == 0:
                if max(abs(int(node[1])), abs(int(node[2]))) > steps:
                    continue
                if spared is not None and (
                    math.hypot(node[1] - spared[0], node[2] - spared[1]) < spared[2]
                ):
                    continue
                least, best = bound, (int(node[0]), int(node[1]), int(node[2]), float(bound))
                continue
            half = 2 ** (level - 1)
            parts = node + np.array([[0, 0, 0], [0, half, 0], [0, 0, half], [0, half, half]])
            scores = np.zeros(4)
            _score(self._levels[level - 1], half - 1, cells, bands, parts, scores)
            better = [k for k in np.argsort(scores) if scores[k] > least]
            stack.extend((scores[k], level - 1, parts[k]) for k in better)
        return best


def thinned(points: Array) -> Array:
    """Return one point per cell and band, and not more than can be compared fast, shape (M, 3)."""
    keys = np.column_stack([np.floor(points[:, :2] / _SIDE), np.digitize(points[:, 2], _BANDS)])
    _, chosen = np.unique(keys.astype(np.int64), axis=0, return_index=True)
    chosen.sort()
    return points[chosen[:: -(-len(chosen) // _MOST_POINTS)]]


def _near(grid: NDArray[np.float32]) -> Cells:
    """Return the proximity of each cell to an occupied one, uint8, 255 for occupied."""
    if not grid.any():
        return np.zeros(grid.shape, np.uint8)
    distance = scipy.ndimage.distance_transform_edt(grid == 0)
    return np.asarray(255 * np.exp(-0.5 * (distance / _SPREAD) ** 2)).astype(np.uint8)


def _maxima(finer: Cells, half: int) -> Cells:
    """Return grids with the maximum of each cell and three later cells, `half` apart.

    They are padded at the beginning by the cells that reach into the finer grids.
    """
    bands, height, width = finer.shape
    padded = np.zeros((bands, height + half, width + half), np.uint8)
    for rows in (0, half):
        for columns in (0, half):
            part = padded[:, rows : rows + height, columns : columns + width]
            np.maximum(part, finer, out=part)
    return padded


@loop()
def _score(
    grid: Cells,
    before: int,
    cells: IntArray,
    bands: IntArray,
    nodes: IntArray,
    scores: Array,
) -> None:
    """Fill in the mean value of the points' cells at some places.

    Args:
        grid: values by band, row and column.
        before: numbers of its rows and columns before the first ones of the finest grid.
        cells: of the points for each yaw, shape (Y, N, 2).
        bands: of the points, shape (N,).
        nodes: index of the yaw, and steps in x and y, shape (P, 3).
        scores: filled in, 0..1, shape (P,).
    """
    rows, columns = grid.shape[1:]
    for k in range(len(nodes)):
        yaw, dx, dy = nodes[k]
        total = 0
        for i in range(len(bands)):
            column, row = cells[yaw, i, 0] + dx + before, cells[yaw, i, 1] + dy + before
            if 0 <= row < rows and 0 <= column < columns:
                total += grid[bands[i], row, column]
        scores[k] = total / (255.0 * len(bands))
