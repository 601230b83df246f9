"""Objects that were moved within a drive, which appear as new tracks, go on as the old ones."""

from __future__ import annotations

import math

import numpy as np
import shapely

from hypermap.history.likeness import MIN_MOVED
from hypermap.mapping.changing_tracks import ChangingTracks
from hypermap.mapping.moved import GONE, Move, find_moves


def note_gone(tracks: ChangingTracks, stamp: float) -> None:
    """Note the stamp [s] of the present frame for the tracks that are gone since it.

    Args:
        tracks: changed.
        stamp: of the frame [s].
    """
    tracks.note_times()
    is_gone = tracks.table.existence <= GONE
    was_there = np.isnan(tracks.table.times[:, 3])
    for row in (is_gone == was_there).nonzero()[0].tolist():
        tracks.touch(row).gone_since = stamp if is_gone[row] else None


def follow_moves(tracks: ChangingTracks, stamp: float = math.inf) -> dict[int, int]:
    """Give moved objects, which appear as new tracks, their old ids.

    Args:
        tracks: changed.
        stamp: of the newest frame [s]; infinite if there is none since the last call.

    Returns:
        The old ids, by those of the new tracks, which are removed.
    """
    tracks.note_times()
    moves = find_moves(tracks.table, tracks.config, stamp)
    for move in moves:
        (row,), (other,) = (tracks.table.rows_of([number]) for number in (move.gone, move.there))
        if _is_in_place(tracks, row, other):
            _rejoin(tracks, row, other)
        else:
            _follow(tracks, row, other, move)
    return {move.there: move.gone for move in moves}


def _is_in_place(tracks: ChangingTracks, row: int, other: int) -> bool:
    """Return whether two tracks are so near that poses may be off by as much."""
    centers = [tracks.table.shapes.polygons[one].geometry.centroid for one in (row, other)]
    return bool(shapely.distance(*centers) < MIN_MOVED)


def _follow(tracks: ChangingTracks, row: int, other: int, move: Move) -> None:
    """Let a track go on at the place of a new one."""
    table, track, there = tracks.table, tracks.touch(row), tracks.touch(other)
    tracks.forget_co_occurrences(track)
    track.co_occurrences.clear()
    tracks.transfer_co_occurrences(there, track)
    track.buffer = there.buffer.since(track.buffer.first_seen)
    track.pending, track.moved = there.pending, move.confidence
    track.moved_since = there.buffer.surely_there[0]
    track.gone_since = None
    table.shapes.replace(row, table.shapes.polygons[other])
    table.shapes.heights[row] = table.shapes.heights[other]
    for column in (table.existence, table.spared, table.misses):
        column[row] = column[other]
    table.remove([other])


def _rejoin(tracks: ChangingTracks, row: int, other: int) -> None:
    """Add the evidence of a new track to the one that is in its place, or was."""
    table, track, there = tracks.table, tracks.touch(row), tracks.touch(other)
    track.buffer.merge([there.buffer])
    track.pending, track.gone_since = len(track.buffer), None
    tracks.transfer_co_occurrences(there, track)
    table.change_existence(row, max(0.0, -float(table.existence[row])))
    table.change_existence(row, float(table.existence[other]), float(table.spared[other]))
    table.remove([other])
    (row,) = table.rows_of([track.id])
    tracks.refresh_shape(row)
