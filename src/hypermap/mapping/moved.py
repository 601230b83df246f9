"""Moved objects: gone from one place, while one of the same class and shape is at another.

A gone track stays in the table, unpublished. If a track of its class and shape appears at a place
that the robot saw empty before, both are one object, which keeps its id. This is about one drive;
`earlier_drives` compares it with what earlier ones knew.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap._loops import loop
from hypermap.core.arrays import BoolArray, IntArray, ObjectArray, as_objects
from hypermap.history.likeness import FARTHEST, MAY_BE, likeness
from hypermap.mapping.evidence_buffer import CONFIRMED, STALE
from hypermap.mapping.prepared_polygon import PreparedPolygon
from hypermap.mapping.stages import EvidenceConfig
from hypermap.mapping.track_colors import differ_in_color
from hypermap.mapping.tracks import TrackTable

GONE = 0.0
"""Existence up to which a track is surely gone, not only uncertain."""

_BEFORE = 1.0  # [s] before an object was first seen; views from then on do not show an empty place
_VIEWS = 2  # of the empty place
_COVERED = 0.5  # share of the place that such a view must cover
_ON_FLOOR = 0.3  # [m]; objects that begin higher are not on the floor, and views only near them
_NEAR = 0.25  # [m]
_SAME_HEIGHT = 0.85  # least ratio of the heights of two objects


@dataclass(frozen=True)
class Move:
    """A gone track, and the track of the same object at its new place.

    Attributes:
        gone: id of the gone track.
        there: id of the other one.
        confidence: probability that they are one object, 0..1.
    """

    gone: int
    there: int
    confidence: float


def find_moves(tracks: TrackTable, config: EvidenceConfig, stamp: float = np.inf) -> list[Move]:
    """Return the gone tracks whose objects have appeared at other places since, one to one.

    Among several candidates, those gone since the latest drive come first, and of these the pairs
    with the smallest distances. Tracks edited by hand are never among them, nor those of earlier
    drives, nor new ones that have been there for more than an hour: their ids are known.

    Args:
        tracks: all tracks.
        config: of their map.
        stamp: of the frame that was added last [s]; infinite for none since the last call. A drive
            that is mapped after later ones adds views from before these.
    """
    gone, there = _gone_and_new(tracks, config)
    if not there:  # the usual case, which is fast
        return []
    is_near, distances = _within_reach(tracks, gone, there)
    may_be = _possible(tracks, gone, there, is_near, stamp)
    if may_be.any():
        is_near &= ~differ_in_color(tracks, gone, there)
        may_be &= is_near
    if not may_be.any():  # comparing shapes takes much longer than all of this
        return []
    # Most drives do not get here, and the import takes a quarter of a second.
    from scipy.optimize import linear_sum_assignment

    alike = _compared(tracks, gone, there, is_near)
    alike[alike < MAY_BE] = 0
    _leave_out_older(alike, _gone_since(tracks, gone))
    alike[~may_be] = 0
    rows, cols = linear_sum_assignment(np.where(alike > 0, distances, 1e6))
    found = []
    for i, j in zip(rows.tolist(), cols.tolist(), strict=True):
        if alike[i, j] > 0:
            rivals = max(alike[i].sum(), alike[:, j].sum())
            ids = tracks.objects[gone[i]].id, tracks.objects[there[j]].id
            found.append(Move(*ids, float(alike[i, j] ** 2 / rivals)))
    return found


def _gone_and_new(tracks: TrackTable, config: EvidenceConfig) -> tuple[list[int], list[int]]:
    """Return the rows of gone tracks, and of new ones of their classes; both empty if one is."""
    objects, found = tracks.objects, np.empty((2, len(tracks.objects)), np.int64)
    limits = GONE, config.publish_above, STALE, CONFIRMED
    begin = sum(track.id < tracks.first_id for track in objects)  # rows of earlier drives
    counts = _may_have_moved(tracks.times, tracks.existence, tracks.is_edited, begin, limits, found)
    gone = found[0, : counts[0]].tolist()
    if not gone:
        return [], []
    new, names = found[1, : counts[1]], {objects[row].name for row in gone}
    new = new[tracks.times[new, 0] > tracks.times[gone, 1].min()]
    there = [row for row in new.tolist() if objects[row].name in names]
    return (gone, there) if there else ([], [])


@loop()
def _may_have_moved(
    times: NDArray[np.float64],
    existence: NDArray[np.float64],
    is_edited: BoolArray,
    begin: int,
    limits: tuple[float, float, float, int],
    found: IntArray,
) -> tuple[int, int]:
    """Find the tracks that are gone or may be, and those that are new, by their stamps.

    Args:
        times: as `TrackTable.times`, as `existence` and `is_edited`.
        existence: likewise.
        is_edited: likewise.
        begin: first row of the present drive.
        limits: up to which existence a track is gone, from which on it is there, the seconds after
            which a place may have changed, and how many observations a gone one must have.
        found: filled with the rows of the gone ones, and of the new ones, shape (2, N).

    Returns:
        How many there are of each.
    """
    begun = seen = -np.inf  # the newest first stamp of a track that is there, and the newest stamp
    for row in range(begin, len(times)):
        seen = max(seen, times[row, 2])
        if existence[row] > limits[1] and not is_edited[row]:
            begun = max(begun, times[row, 0])
    gone = new = 0
    for row in range(begin, len(times)):
        first, last = times[row, 0], times[row, 1]
        # One that was not looked at yet since an earlier drive may be gone.
        is_gone = last < begun - limits[2] or (existence[row] <= limits[0] and last < begun)
        if is_gone and not is_edited[row] and times[row, 4] >= limits[3]:
            found[0, gone] = row
            gone += 1
        is_there = existence[row] > limits[1] and not is_edited[row]
        if is_there and first > seen - limits[2]:  # ids that people have known for longer stay
            found[1, new] = row
            new += 1
    return gone, new


def _gone_since(tracks: TrackTable, gone: Sequence[int]) -> NDArray[np.float64]:
    """Return since when tracks are gone [s]; the newest stamp for those that may still be there."""
    since = tracks.times[gone, 3]
    return np.where(np.isnan(since), tracks.times[:, 1].max(), since)


def _began(tracks: TrackTable, row: int) -> float:
    """Return the stamp from which on there surely was the object of a track [s]."""
    return tracks.objects[row].buffer.surely_there[0]


def _leave_out_older(alike: NDArray[np.float64], gone_since: NDArray[np.float64]) -> None:
    """Set pairs to 0 whose gone track has been gone longer than another candidate.

    The other candidate is gone since the latest drive, or may be, because it was not looked at yet.

    Args:
        alike: similarity of each gone track and each new one, shape (N, M); changed.
        gone_since: stamps [s], the latest one for tracks that are not surely gone, shape (N,).
    """
    since = gone_since[:, np.newaxis]
    latest = np.where(alike > 0, since, -np.inf).max(axis=0)
    alike[since < latest - STALE] = 0


def _within_reach(
    tracks: TrackTable, gone: Sequence[int], there: Sequence[int]
) -> tuple[BoolArray, NDArray[np.float64]]:
    """Return which pairs are of one class, near and one after the other; and all distances [m].

    What a frame shows beside another one is not that one.

    Returns:
        For each gone track and each new one, shape (N, M) both.
    """
    centers = [shapely.centroid(tracks.shapes.geometries(rows)) for rows in (gone, there)]
    distances = np.asarray(shapely.distance(centers[0][:, None], centers[1][None, :]))
    names = [np.array([tracks.objects[row].name for row in rows]) for rows in (gone, there)]
    buffers = [tracks.objects[row].buffer for row in gone]
    left, last = np.array([(one.surely_there[1], one.last_seen) for one in buffers]).T
    first = np.array([_began(tracks, row) for row in there])
    is_same_class = names[0][:, None] == names[1][None, :]
    is_near = is_same_class & (first[None, :] > left[:, None]) & (distances <= FARTHEST)
    is_near &= np.array(gone)[:, None] != np.array(there)[None, :]  # one seen again
    for i, j in np.argwhere(is_near & (first[None, :] <= last[:, None])).tolist():
        track, other = tracks.objects[gone[i]], tracks.objects[there[j]]
        is_near[i, j] = not track.co_occurrences[other.id]
    return is_near, distances


def _possible(
    tracks: TrackTable,
    gone: Sequence[int],
    there: Sequence[int],
    is_near: BoolArray,
    stamp: float,
) -> BoolArray:
    """Return which pairs `is_near` can be one object, whatever their shapes, shape (N, M).

    The others differ in height, are not gone, or no view shows the new place empty before.
    """
    possible = np.zeros_like(is_near)
    views: Views | None = None
    for j, row in enumerate(there):
        was_empty: bool | None = None
        for i in np.flatnonzero(is_near[:, j]).tolist():
            if not may_be_as_high(tracks, gone[i], row):
                continue
            if tracks.existence[gone[i]] <= GONE and not _is_known(tracks, row, stamp):
                views = views_of_tracks(tracks) if views is None else views
                was_empty = was_without(tracks, row, views) if was_empty is None else was_empty
                possible[i, j] = was_empty
    return possible


def may_be_as_high(tracks: TrackTable, one: int, other: int) -> bool:
    """Return whether two tracks may be of one height; those that are not on the floor may.

    After few observations the top of an object may not have been seen.
    """
    (low, high), (other_low, other_high) = (
        tracks.objects[row].buffer.heights() for row in (one, other)
    )
    is_on_floor = max(low, other_low) <= _ON_FLOOR
    return not is_on_floor or min(high, other_high) >= _SAME_HEIGHT * max(high, other_high)


def _compared(
    tracks: TrackTable, gone: Sequence[int], there: Sequence[int], is_near: BoolArray
) -> NDArray[np.float64]:
    """Return the likeness of each pair `is_near`, and 0 for others, shape (N, M)."""
    shapes = tracks.shapes
    alike = np.zeros(is_near.shape)
    for i, j in np.argwhere(is_near).tolist():
        one, other = shapes.polygons[gone[i]], shapes.polygons[there[j]]
        alike[i, j] = likeness(one.geometry, other.geometry)
    return alike


class Views(NamedTuple):
    """The views of which tracks keep evidence.

    Attributes:
        stamps: of their frames [s], shape (N,).
        areas: polygons in the map frame [m] that each could have seen, shape (N,).
    """

    stamps: NDArray[np.float64]
    areas: ObjectArray


def views_of_tracks(tracks: TrackTable) -> Views:
    """Return the views of all tracks."""
    items = (item for track in tracks.objects for item in track.buffer.items)
    views = {(item.stamp, id(item.prepared_area)): item for item in items}.values()
    stamps = np.array([item.stamp for item in views], np.float64)
    return Views(stamps, as_objects(item.visible_area for item in views))


def _known_without_views(tracks: TrackTable, row: int) -> list[bool]:
    """Return a list that is not empty once `was_without` is known to be false."""
    known: list[bool] = tracks.shapes.polygons[row].cached(_nothing_known, _began(tracks, row))
    return known


def _is_known(tracks: TrackTable, row: int, stamp: float) -> bool:
    """Return whether `was_without` is known to be false.

    It remains so while the shape is the same, as frames from after the track's beginning add no
    views from before it.
    """
    is_later = stamp >= _began(tracks, row)
    return is_later and bool(_known_without_views(tracks, row))


def _nothing_known(_shape: PreparedPolygon, _begin: float) -> list[bool]:
    return []


def was_without(tracks: TrackTable, row: int, views: Views) -> bool:
    """Return whether the robot saw the place of a track before the track was seen there."""
    areas = views.areas[views.stamps < _began(tracks, row) - _BEFORE]
    shape = tracks.shapes.polygons[row].geometry
    if tracks.shapes.heights[row][0] > _ON_FLOOR:
        is_view = shapely.dwithin(areas, shape, _NEAR)
    else:
        areas = areas[shapely.intersects(areas, shape)]  # those of other rooms do not
        is_view = shapely.area(shapely.intersection(areas, shape)) >= _COVERED * shape.area
    found = int(np.count_nonzero(is_view)) >= _VIEWS
    _known_without_views(tracks, row)[:] = [] if found else [True]
    return found
