"""Cells that a robot has seen, put into the occupancy layer of a site.

A robot sends the cells that have changed since it sent the last ones. They replace those of the
site: what was seen last holds, whichever robot saw it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry, along
from hypermap.core.occupancy import UNKNOWN, OccupancyLayer
from hypermap.fleet.store import rows, tables
from hypermap.fleet.store.address import StoreError
from hypermap.fleet.store.pushing import add_layer
from hypermap.mapping.stages import OccupancyConfig

if TYPE_CHECKING:
    from psycopg import Cursor

    from hypermap.fleet.store.database import Database

NO_NEWS = -2
"""The value of a cell that has not changed."""

_EDGE = 1e-6  # of a cell, by which rounding may put an edge beyond a cell's border


@dataclass(frozen=True, eq=False)
class ChangedCells:
    """The cells of an occupancy layer that have changed.

    Attributes:
        layer: the name of the layer.
        frame_id: its frame.
        grid: around the cells that have changed.
        cells: -1 unknown, 0 free .. 100 occupied, or NO_NEWS; int8, shape (height, width).
    """

    layer: str
    frame_id: str
    grid: GridGeometry
    cells: NDArray[np.int8]


def changed_cells(before: OccupancyLayer | None, now: OccupancyLayer) -> ChangedCells | None:
    """Return the cells that differ between two states of a layer; None if none does.

    Args:
        before: the layer as it was, whose cells lie on those of the new one; None for nothing.
        now: the layer as it is.
    """
    states = [layer for layer in (before, now) if layer is not None and layer.grid is not None]
    sides = [layer.grid.resolution for layer in states if layer.grid is not None]
    if not sides:
        return None
    side = sides[-1]
    firsts = np.array([_first_cell(layer, side) for layer in states])
    shapes = np.array([layer.grid.shape for layer in states if layer.grid is not None])
    low, high = firsts.min(axis=0), (firsts + shapes).max(axis=0)
    old, new = (_spread(layer, side, low, high - low) for layer in (before, now))
    differs = old != new
    if not differs.any():
        return None
    part = tuple(
        slice(int(places[0]), int(places[-1]) + 1)
        for places in (np.flatnonzero(differs.any(axis=axis)) for axis in (1, 0))
    )
    cells = np.where(differs, new, NO_NEWS)[part].astype(np.int8)
    row, col = np.add(low, [part[0].start, part[1].start])
    origin = Pose2D(along(int(col), side), along(int(row), side))
    grid = GridGeometry(cells.shape[1], cells.shape[0], side, origin)
    return ChangedCells(now.name, now.frame_id, grid, cells)


def layer_for_cells(cursor: Cursor[Any], database: Database, site: str, seen: ChangedCells) -> int:
    """Return the id of the layer of a site for what was seen; it is added if there is none.

    Raises:
        StoreError: If the layer of that name is of another kind or in another frame.
    """
    cursor.execute(
        "SELECT layers.id, kind, frame_id FROM layers JOIN sites ON sites.id = site_id "
        "WHERE sites.name = %s AND layers.name = %s",
        (site, seen.layer),
    )
    known = cursor.fetchone()
    if known is None:
        return add_layer(cursor, database, site, OccupancyLayer(seen.layer, seen.frame_id))
    layer_id, *there = known
    if there != [OccupancyLayer.class_name, seen.frame_id]:
        raise StoreError(
            f"{database.address.shown}: layer {seen.layer!r} of site {site!r} is a {there[0]} in "
            f"frame {there[1]!r}; a robot has seen cells in frame {seen.frame_id!r}"
        )
    return int(layer_id)


def put_cells(cursor: Cursor[Any], layer_id: int, version: int, seen: ChangedCells) -> int:
    """Let a layer of a site have the cells that have changed; it grows by whole tiles.

    Returns:
        How many tiles have changed.

    Raises:
        StoreError: If the layer would have too many cells.
    """
    columns = ", ".join(tables.GRIDS.columns)
    known = cursor.execute(
        f"SELECT {columns} FROM grids WHERE layer_id = %s AND valid_to IS NULL",
        (layer_id,),
    ).fetchone()
    grid, kind = (None, np.dtype(np.int8)) if known is None else rows.grid_of(known)
    whole = _grown(grid, seen.grid)
    tiles = cursor.execute(
        "SELECT tile_row, tile_col, cells FROM tiles WHERE layer_id = %s AND valid_to IS NULL",
        (layer_id,),
    ).fetchall()
    cells = np.full(whole.shape, UNKNOWN, kind)
    if grid is not None:
        row, col = np.round(whole.positions_at([[grid.origin.x, grid.origin.y]])[0]).astype(int)
        within = cells[row : row + grid.height, col : col + grid.width]
        within[...] = rows.cells_of(tiles, grid, kind, UNKNOWN)
    _overwrite(cells, whole, seen)
    tables.GRIDS.replace(cursor, layer_id, version, [rows.row_of_grid(whole, cells)])
    return tables.TILES.replace(cursor, layer_id, version, rows.rows_of_cells(cells))


def _grown(grid: GridGeometry | None, other: GridGeometry) -> GridGeometry:
    """Return a grid that covers another one, too, with whole tiles where it grows."""
    side = other.resolution
    if grid is None:
        tile = rows.TILE * side
        x, y = (tile * np.floor(place / tile + _EDGE) for place in (other.origin.x, other.origin.y))
        grid = GridGeometry(rows.TILE, rows.TILE, side, Pose2D(float(x), float(y)))
    corners = grid.positions_at(other.corners())
    low = np.minimum(np.floor(corners.min(axis=0) + _EDGE), 0) // rows.TILE * rows.TILE
    high = np.maximum(np.ceil(corners.max(axis=0) - _EDGE), grid.shape)
    if not low.any() and (high == grid.shape).all():
        return grid
    height, width = (int(-(-cells // rows.TILE) * rows.TILE) for cells in high - low)
    most = OccupancyConfig().max_cells
    if height * width > most:
        raise StoreError(
            f"the occupancy layer of the site would have {width} x {height} cells, more than "
            f"{most}; do all its robots use the same frame?"
        )
    row, col = low
    corner = Pose2D(along(int(col), grid.resolution), along(int(row), grid.resolution))
    return GridGeometry(width, height, grid.resolution, grid.origin @ corner)


def _overwrite(cells: NDArray[Any], grid: GridGeometry, seen: ChangedCells) -> None:
    """Let cells have what was seen at their centers."""
    window = grid.window_in(seen.grid.outline())
    at = np.add(np.indices(window.shape).reshape(2, -1).T, [window.row, window.col])
    places = seen.grid.cells_at(grid.centers(*at.T))
    is_on = seen.grid.contains(*places.T)
    values = seen.cells[tuple(places[is_on].T)]
    is_news = values != NO_NEWS
    cells[tuple(at[is_on][is_news].T)] = values[is_news]


def _first_cell(layer: OccupancyLayer, side: float) -> NDArray[np.int64]:
    """Return row and column of the first cell, counted from the origin of the frame."""
    assert layer.grid is not None
    origin = layer.grid.origin
    return np.round([origin.y / side, origin.x / side]).astype(np.int64)


def _spread(
    layer: OccupancyLayer | None, side: float, low: NDArray[np.int64], shape: NDArray[np.int64]
) -> NDArray[np.int8]:
    """Return the cells of a layer in a larger window; unknown around them."""
    cells = np.full(tuple(shape), UNKNOWN, np.int8)
    if layer is not None and layer.grid is not None and layer.cells is not None:
        row, col = _first_cell(layer, side) - low
        cells[row : row + layer.grid.height, col : col + layer.grid.width] = layer.cells
    return cells
