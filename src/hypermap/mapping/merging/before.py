"""Two maps as they were before the frames that are mapped again, joined object by object."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry, along
from hypermap.core.occupancy import OccupancyLayer
from hypermap.mapping.completion import free_share
from hypermap.mapping.config import MappingConfig
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.frame_log import MapBefore
from hypermap.mapping.merging.grids import added_log_odds, log_odds_of
from hypermap.mapping.merging.logged import Side
from hypermap.mapping.merging.moving import moved_tracks
from hypermap.mapping.merging.tracks import IsFree, Joined, join_tracks
from hypermap.mapping.tracks import TrackTable

_Cells: TypeAlias = "tuple[NDArray[np.int64], NDArray[np.float32] | None]"
"""The first cell, and the log-odds, as in `MapperState`."""

_FREE = 0.9  # share of an area that must be free for it to contain no object


def joined_before(
    sides: tuple[Side, Side],
    kept: tuple[int, int],
    grids: tuple[OccupancyLayer, OccupancyLayer],
    config: MappingConfig,
) -> tuple[Joined, MapBefore]:
    """Return both maps as one, before the frames that are mapped again.

    Args:
        sides: the maps.
        kept: as `kept_drives` returns it.
        grids: the occupancy layer of each, in its own frame.
        config: of both.

    Returns:
        The tracks of both, and the map with them. It has no log-odds if the first map has none.

    Raises:
        HypermapError: If the occupancy grid would have too many cells.
    """
    first, second = sides
    tracks = _tracks_before(first, kept[0], config), _tracks_before(second, kept[1], config)
    tracks[0].next_id = max(tracks[0].next_id, first.tracks.next_id)
    is_free = (
        _is_free(grids[0], Pose2D(), config.occupancy.free_below),
        _is_free(grids[1], second.a_T_b.inverse(), config.occupancy.free_below),
    )
    joined = join_tracks(tracks[0], tracks[1], config.evidence, is_free)
    cells = _cells_before(first, kept[0]), _cells_before(second, kept[1])
    first_cell, log_odds = _added_cells(*cells, grids[1], second.a_T_b, config)
    return joined, MapBefore(joined.tracks, first_cell, log_odds)


def _tracks_before(side: Side, kept: int, config: MappingConfig) -> TrackTable:
    """Return the tracks of a map before all but some of its logged drives, one per object.

    What people had drawn by then, and have deleted since, is left out.
    """
    if kept == len(side.logged):
        return side.tracks.snapshot()
    evidence, before = EvidenceMap(config.evidence), side.logged[kept].parts[0].before.tracks
    edited = side.tracks.hand_edits().keys()
    edits = {number: edit for number, edit in before.hand_edits().items() if number in edited}
    evidence.go_on_with(before.snapshot(), edits)
    tracks = evidence.settled().snapshot()
    return moved_tracks(tracks, side.a_T_b, config.evidence, side.later)


def _is_free(grid: OccupancyLayer, grid_T_a: Pose2D, free_below: float) -> IsFree:
    """Return whether a map's grid knows that nothing stands in areas of the first map's frame.

    Args:
        grid: of a map.
        grid_T_a: transforms points from the first map's frame to that of the grid.
        free_below: height below which rays pass over a free cell [m].
    """

    def is_free(area: BaseGeometry, bottom: float) -> bool:
        # A cell is free if rays pass below a height: a table may be over it, with a cup on it.
        return bottom < free_below and free_share(grid, grid_T_a.apply_geometry(area)) >= _FREE

    return is_free


def _cells_before(side: Side, kept: int) -> _Cells:
    """Return the cells of a map before all but some of its logged drives."""
    if kept == len(side.logged):
        return side.state.first_cell, side.state.log_odds
    before = side.logged[kept].parts[0].before
    return before.first_cell, before.log_odds


def _added_cells(
    first: _Cells, second: _Cells, grid: OccupancyLayer, a_T_b: Pose2D, config: MappingConfig
) -> _Cells:
    """Return the cells of two maps; no log-odds if the first has none.

    Args:
        first: of one map.
        second: of the other, whose log-odds are those of `grid` if it has none.
        grid: the occupancy layer of the second map.
        a_T_b: transforms points of the second map to the first.
        config: of both.
    """
    other = None if first[1] is None else _log_odds_of(second, grid, config)
    if first[1] is None or other is None:
        return first
    return added_log_odds(first[0], first[1], other, a_T_b, config.occupancy)


def _log_odds_of(
    cells: _Cells, grid: OccupancyLayer, config: MappingConfig
) -> tuple[GridGeometry, NDArray[np.float32]] | None:
    """Return the cells of a map as a grid and log-odds; None for none."""
    (row, col), log_odds = cells[0].tolist(), cells[1]
    if log_odds is None:
        return None if grid.grid is None else (grid.grid, log_odds_of(grid))
    if not log_odds.size:
        return None
    side = config.occupancy.resolution
    height, width = log_odds.shape
    origin = Pose2D(along(col, side), along(row, side))
    return GridGeometry(width, height, side, origin), log_odds
