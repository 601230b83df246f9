"""Cells that a robot has seen, put into the occupancy layer of a site.

A robot sends the cells that it knows and that have changed since it sent the last ones. They
replace those of the site: what was seen last holds, whichever robot saw it.
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
"""The value of a cell that has not changed, or is not known."""

_EDGE = 1e-6  # of a cell, by which rounding may put an edge beyond a cell's border


@dataclass(frozen=True, eq=False)
class ChangedCells:
    """The known cells of an occupancy layer that have changed.

    Attributes:
        layer: the name of the layer.
        frame_id: its frame.
        grid: around the cells that have changed.
        cells: 0 free .. 100 occupied, or NO_NEWS; int8, shape (height, width).
    """

    layer: str
    frame_id: str
    grid: GridGeometry
    cells: NDArray[np.int8]


def changed_cells(before: OccupancyLayer | None, now: OccupancyLayer) -> ChangedCells | None:
    """Return the known cells that differ from an earlier state of a layer; None if none does.

    Args:
        before: the layer as it was, whose cells lie on those of the new one; None for nothing.
        now: the layer as it is.
    """
    if now.grid is None or now.cells is None:
        return None
    side = now.grid.resolution
    is_news = now.cells != UNKNOWN
    if before is not None and before.grid is not None and before.cells is not None:
        shift = _first_cell(before, side) - _first_cell(now, side)
        common = _overlap(shift, before.cells.shape, now.cells.shape)
        old = before.cells[_overlap(-shift, now.cells.shape, before.cells.shape)]
        is_news[common] &= now.cells[common] != old
    if not is_news.any():
        return None
    part = tuple(
        slice(int(places[0]), int(places[-1]) + 1)
        for places in (np.flatnonzero(is_news.any(axis=axis)) for axis in (1, 0))
    )
    cells = np.where(is_news[part], now.cells[part], NO_NEWS).astype(np.int8)
    row, col = np.add(_first_cell(now, side), [part[0].start, part[1].start])
    origin = Pose2D(along(int(col), side), along(int(row), side))
    grid = GridGeometry(cells.shape[1], cells.shape[0], side, origin)
    return ChangedCells(now.name, now.frame_id, grid, cells)


def _overlap(
    shift: NDArray[np.int64], shape: tuple[int, ...], within: tuple[int, ...]
) -> tuple[slice, ...]:
    """Return where an array of a shape, shifted by rows and columns, lies within another."""
    return tuple(
        slice(min(max(first, 0), whole), min(max(first + size, 0), whole))
        for first, size, whole in zip(shift.tolist(), shape, within, strict=True)
    )


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

    Only tiles with such cells are read and written, unless the layer grows.

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
    at, values = _news(whole, seen)
    if whole == grid:
        return _put_tiles(cursor, layer_id, version, whole, kind, at, values)
    cells = np.full(whole.shape, UNKNOWN, kind)
    if grid is not None:
        row, col = np.round(whole.positions_at([[grid.origin.x, grid.origin.y]])[0]).astype(int)
        within = cells[row : row + grid.height, col : col + grid.width]
        within[...] = rows.cells_of(_tiles(cursor, layer_id), grid, kind, UNKNOWN)
    cells[tuple(at.T)] = values
    tables.GRIDS.replace(cursor, layer_id, version, [rows.row_of_grid(whole, cells)])
    return tables.TILES.replace(cursor, layer_id, version, rows.rows_of_cells(cells))


def _put_tiles(
    cursor: Cursor[Any],
    layer_id: int,
    version: int,
    grid: GridGeometry,
    kind: np.dtype[Any],
    at: NDArray[np.int64],
    values: NDArray[Any],
) -> int:
    """Let cells have values; return how many tiles have changed."""
    places, tile_of_cell = np.unique(at // rows.TILE, axis=0, return_inverse=True)
    stored = {(row, col): content for row, col, content in _tiles(cursor, layer_id, places)}
    changed = []
    for number, (row, col) in enumerate(places.tolist()):
        if (row, col) in stored:
            before = rows.tile_of(stored[row, col], (row, col), grid, kind)
        else:
            before = np.full(rows.shape_of_tile((row, col), grid), UNKNOWN, kind)
        is_here = tile_of_cell.reshape(-1) == number
        now = before.copy()
        now[tuple((at[is_here] - places[number] * rows.TILE).T)] = values[is_here]
        if (now != before).any():
            changed.append((row, col, rows.content_of_tile(now)))
    if changed:
        tables.TILES.put(cursor, layer_id, version, changed)
    return len(changed)


def _tiles(
    cursor: Cursor[Any], layer_id: int, places: NDArray[np.int64] | None = None
) -> list[rows.Row]:
    """Return tile_row, tile_col and cells of the tiles at some places, shape (N, 2), or of all."""
    question = (
        "SELECT tile_row, tile_col, cells FROM tiles WHERE layer_id = %s::integer "
        "AND valid_to IS NULL"
    )
    if places is None:
        return cursor.execute(question, (layer_id,)).fetchall()
    return cursor.execute(
        f"{question} AND (tile_row, tile_col) IN (SELECT * FROM unnest(%s::int[], %s::int[]))",
        (layer_id, *places.T.tolist()),
    ).fetchall()


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


def _news(grid: GridGeometry, seen: ChangedCells) -> tuple[NDArray[np.int64], NDArray[np.int8]]:
    """Return row and column of the cells with news at their centers, shape (N, 2), and the news.

    A robot that does not know a cell says nothing of it, as others may.
    """
    window = grid.window_in(seen.grid.outline())
    at = np.add(np.indices(window.shape).reshape(2, -1).T, [window.row, window.col])
    places = seen.grid.cells_at(grid.centers(*at.T))
    is_on = seen.grid.contains(*places.T)
    values = seen.cells[tuple(places[is_on].T)]
    is_news = values > UNKNOWN
    return at[is_on][is_news], values[is_news]


def _first_cell(layer: OccupancyLayer, side: float) -> NDArray[np.int64]:
    """Return row and column of the first cell, counted from the origin of the frame."""
    assert layer.grid is not None
    origin = layer.grid.origin
    return np.round([origin.y / side, origin.x / side]).astype(np.int64)
