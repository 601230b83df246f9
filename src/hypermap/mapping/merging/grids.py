"""Adds the occupancy grids of two maps: log-odds of cells add up (Moravec and Elfes, ICRA 1985)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import HypermapError
from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry, along
from hypermap.core.occupancy import FREE, OCCUPIED, UNKNOWN, OccupancyLayer
from hypermap.mapping.stages import OccupancyConfig

_CERTAIN = 0.97, 0.12
"""Probabilities of an occupied and a free cell in a map without log-odds.

They are the clamps of OctoMap (Hornung et al., Autonomous Robots 2013)."""

_EDGE = 1e-6  # of a cell; tolerance for edges on a cell's border


def added_log_odds(
    first_cell: NDArray[np.int64],
    log_odds: NDArray[np.float32],
    other: tuple[GridGeometry, NDArray[np.float32]],
    a_T_b: Pose2D,
    config: OccupancyConfig,
) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """Return the log-odds of an occupancy mapper plus those of another grid.

    Args:
        first_cell: row and column of the first cell of `log_odds`, from the frame's origin, (2,).
        log_odds: NaN if never seen, float32, shape (H, W).
        other: another grid in frame b, and its log-odds.
        a_T_b: transforms points in b to the frame of the mapper.
        config: of the mapper.

    Returns:
        First cell and log-odds, as `OccupancyMapper.log_odds` returns them.

    Raises:
        HypermapError: If the grid would have more cells than `max_cells`.
    """
    side = config.resolution
    origin = Pose2D(along(int(first_cell[1]), side), along(int(first_cell[0]), side))
    height, width = log_odds.shape
    grid = GridGeometry(max(width, 1), max(height, 1), side, origin)
    if log_odds.size == 0:
        log_odds = np.full((1, 1), np.nan, np.float32)
    whole, values = _added(grid, log_odds, other, a_T_b, config.max_cells)
    values = np.clip(values, config.min_log_odds, config.max_log_odds)
    shift = np.round([(origin.y - whole.origin.y) / side, (origin.x - whole.origin.x) / side])
    return first_cell - shift.astype(np.int64), values


def added_layers(first: OccupancyLayer, second: OccupancyLayer, a_T_b: Pose2D) -> OccupancyLayer:
    """Return the sum of two layers, with the name, frame and resolution of the first.

    Raises:
        HypermapError: If the grid would have too many cells.
    """
    if first.grid is None or second.grid is None:
        return second if first.grid is None else first
    other = second.grid, log_odds_of(second)
    grid, values = _added(first.grid, log_odds_of(first), other, a_T_b, OccupancyConfig().max_cells)
    likelihood = 1 / (1 + np.exp(-np.nan_to_num(values.astype(np.float64))))
    cells = np.round(100 * likelihood).astype(np.int8)
    occupied, free = _CERTAIN
    cells[likelihood >= occupied - 1e-6] = OCCUPIED
    cells[likelihood <= free + 1e-6] = FREE
    cells[np.isnan(values)] = UNKNOWN
    layer = OccupancyLayer(first.name, first.frame_id, grid, cells)
    layer.settings = first.settings
    return layer


def log_odds_of(layer: OccupancyLayer) -> NDArray[np.float32]:
    """Return the log-odds for the values of a layer, NaN if unknown, float32, shape (H, W)."""
    if layer.cells is None:
        return np.empty((0, 0), np.float32)
    cells = layer.cells.astype(np.float32)
    occupied, free = _CERTAIN
    likelihood = np.clip(cells / 100, free, occupied)
    return np.where(cells < 0, np.nan, np.log(likelihood / (1 - likelihood))).astype(np.float32)


def _added(
    grid: GridGeometry,
    log_odds: NDArray[np.float32],
    other: tuple[GridGeometry, NDArray[np.float32]],
    a_T_b: Pose2D,
    max_cells: int,
) -> tuple[GridGeometry, NDArray[np.float32]]:
    """Return a grid that covers both, aligned to the first one, and its log-odds."""
    other_grid, other_log_odds = other
    corners = grid.positions_at(a_T_b.apply(other_grid.corners()))
    low = np.minimum(np.floor(corners.min(axis=0) + _EDGE), 0).astype(np.int64)
    high = np.maximum(np.ceil(corners.max(axis=0) - _EDGE), grid.shape).astype(np.int64)
    height, width = (int(n) for n in high - low)
    if height * width > max_cells:
        raise HypermapError(
            f"the merged occupancy grid would have {width} x {height} cells, more than "
            f"{max_cells}; are the maps aligned?"
        )
    corner = Pose2D(along(int(low[1]), grid.resolution), along(int(low[0]), grid.resolution))
    whole = GridGeometry(width, height, grid.resolution, grid.origin @ corner)
    values = np.full((height, width), np.nan, np.float32)
    row, col = -low
    values[row : row + grid.height, col : col + grid.width] = log_odds
    b_T_a = a_T_b.inverse()
    cols = np.arange(width)
    for row in range(height):  # one at a time, because the coordinates of all cells take memory
        cells = other_grid.cells_at(b_T_a.apply(whole.centers(np.full(width, row), cols)))
        is_on = other_grid.contains(*cells.T)
        found = np.full(width, np.nan, np.float32)
        found[is_on] = other_log_odds[tuple(cells[is_on].T)]
        both = np.nan_to_num(values[row]) + np.nan_to_num(found)
        values[row] = np.where(np.isnan(values[row]) & np.isnan(found), np.nan, both)
    return whole, values
