"""Which tracks of a drive are known objects: the assignment of least cost.

A known object has stayed, was moved, has left, or was not seen; a track of the drive is one of
them, or new. Each of these has a cost, the negative logarithm of how likely it is: 1 more is less
likely by a factor of e. Their values were chosen on simulated series of drives, with seeds of
development (`hypermap experiment days`, benchmarks/RESULTS.md).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Set
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray
from hypermap.history.likeness import FARTHEST, MIN_SHIFT
from hypermap.mapping.compared_tracks import ComparedTracks, likeness_of_tracks, sides
from hypermap.mapping.evidence_buffer import CONFIRMED, MAPPED, STALE
from hypermap.mapping.moved import GONE, Views, views_of_tracks, was_without
from hypermap.mapping.prepared_polygon import PreparedPolygon
from hypermap.mapping.stages import EvidenceConfig
from hypermap.mapping.track_colors import SAME_COLOR, color_distances
from hypermap.mapping.track_shapes import Rows
from hypermap.mapping.tracks import TrackTable, are_two

_NEVER = 1e6  # of what is impossible

# A known object that no track of the drive is
_LEFT = 4.0
_UNSEEN = 1.0  # it may still be there
_KEPT = 0.8  # share of the existence that as many sure detections give; with more, hardly missed

# A track that is none of the known objects
_CAME = 4.0
_MAY_HAVE_BEEN = 2.0  # its place was not seen before
_DOUBTFUL = 1.0  # it is not probable enough for the map
_ALSO = 0.5  # pseudocount of objects: of a class that the map does not have, too

# An object that has stayed
_UNLIKE = 3.0  # of another shape
_AWAY = 2.0  # per meter of distance
_HIGHER = 4.0  # per share of the height by which it differs
_BACK = 3.0  # it was gone when the last drive ended
_ONCE = 4.0  # it was detected only once before, which may have been wrong, and often now
_PART = 0.8  # how alike a part and its whole are, of 1
_BESIDE = 0.5  # how alike two are that are in the same place, at least
_SAME_PLACE = 0.25  # [m] within which a small object is in its place
_SURELY = 1.0  # cost up to which it surely has

# An object that was moved
_MOVED = 2.2
_FAR = 1.0  # per factor of e in the distance
_NEAREST = 0.3  # [m] from which on distances count
_ACROSS = 5.0  # [m] from which on they count twice: few things are moved to another room
_TURNED = 4.0  # of another shape
_RAISED = 20.0  # per share of the height by which it differs
_STILL_THERE = 0.8  # its old place may still be taken
_LONG_GONE = 1.0  # it was gone when the last drive ended
_UNKNOWN = 1.0  # its new place was not seen before
_LEAST_LIKE = 0.1  # likeness of two shapes of one object
_BY_CHANCE = 1  # frames that seem to show it beside itself: what is next to it was taken for it
_REPAINTED = 0.07  # share of the objects that have another color in another drive, to begin with
_BEFORE_ANY = 0.3  # objects that this counts as much as

_TINY = 1e-12
_OVER = 0.2  # share of the smaller one from which two objects take one place


SeenBefore: TypeAlias = dict[int, tuple[PreparedPolygon, bool]]
"""Whether the robot saw the place of a shape empty before, by the ids of the tracks with them."""


@dataclass(frozen=True)
class Pair:
    """A known track, and the track of the drive that is the same object.

    Attributes:
        known: row of the known one.
        fresh: row of the other one.
        confidence: how likely it was moved there, over all it may be, 0..1; None if it has stayed.
    """

    known: int
    fresh: int
    confidence: float | None


def parted(tracks: TrackTable) -> tuple[Rows, Rows]:
    """Return the rows of the tracks of earlier drives, and of those of the present one.

    What people have edited since this drive began is what it is, and in neither of the two.
    """
    ids = [track.id for track in tracks.objects]
    known = int(np.searchsorted(ids, tracks.first_id))
    fresh = [row for row in range(known, len(ids)) if tracks.objects[row].by_hand is None]
    return list(range(known)), fresh


class Reunion:
    """The tracks of earlier drives and of the present one, to be assigned to each other."""

    def __init__(self, tracks: TrackTable, config: EvidenceConfig, seen_before: SeenBefore) -> None:
        """Prepare to assign tracks.

        Args:
            tracks: not changed.
            config: of their map.
            seen_before: what is known of the places of tracks; changed.
        """
        self._tracks, self._config = tracks, config
        self._seen_before = seen_before
        self._known, self._fresh = parted(tracks)
        self._costs_of_colors: dict[ComparedTracks, NDArray[np.float64]] = {}

    def pairs(self) -> list[Pair]:
        """Return all pairs, class by class, in the order of the names."""
        return [pair for one in self._classes for pair in self._pairs(one)]

    @cached_property
    def _classes(self) -> list[ComparedTracks]:
        """The classes that both earlier drives and this one have found."""
        objects, found = self._tracks.objects, []
        for name in sorted({objects[row].name for row in self._fresh}):
            some = [row for row in self._known if objects[row].name == name]
            some = [row for row in some if not objects[row].is_deleted]
            if some:
                others = [row for row in self._fresh if objects[row].name == name]
                found.append(ComparedTracks.of(self._tracks, some, others))
        return found

    def _pairs(self, one: ComparedTracks) -> list[Pair]:
        # The import takes a quarter of a second, and most drives begin a map.
        from scipy.optimize import linear_sum_assignment

        leaving = self._costs_of_leaving(one)
        stays = self._stays[one] + self._costs_of_replacing(one)
        moves = self._costs_of_moving(one, leaving)
        coming = np.array([self._cost_of_coming(row) for row in one.fresh])
        n, m = stays.shape
        costs = np.full((n + m, n + m), _NEVER)
        costs[:n, :m] = np.minimum(stays, moves)
        costs[np.arange(n), m + np.arange(n)] = leaving
        costs[n + np.arange(m), np.arange(m)] = coming
        costs[n:, m:] = 0
        rows, cols = linear_sum_assignment(costs)
        found = []
        for i, j in zip(rows.tolist(), cols.tolist(), strict=True):
            if i < n and j < m and costs[i, j] < _NEVER:
                has_stayed = stays[i, j] <= moves[i, j]
                confidence = None if has_stayed else _confidence(moves, i, j)
                found.append(Pair(one.known[i], one.fresh[j], confidence))
        return found

    @cached_property
    def _stays(self) -> dict[ComparedTracks, NDArray[np.float64]]:
        """What it costs that the known objects of each class have stayed, shapes (N, M)."""
        return {one: self._costs_of_staying(one) for one in self._classes}

    def _costs_of_staying(self, one: ComparedTracks) -> NDArray[np.float64]:
        """Return what it costs that each known object is each of the others, shape (N, M)."""
        objects, is_near = self._tracks.objects, one.distances < _SAME_PLACE
        least = np.minimum(one.areas[0][:, None], one.areas[1])
        most = np.maximum(one.areas[0][:, None], one.areas[1])
        ious = one.shared / np.maximum(least + most - one.shared, _TINY)
        parts = one.shared / np.maximum(least, _TINY)
        alike = np.maximum(np.maximum(ious, _PART * parts), np.where(is_near, _BESIDE, 0))
        costs = _UNLIKE * (1 - alike) + _AWAY * one.distances + _HIGHER * one.height_gaps
        is_often_seen = np.array([objects[row].buffer.count >= CONFIRMED for row in one.fresh])
        for i, row in enumerate(one.known):
            if objects[row].buffer.count == 1:
                costs[i] += np.where(is_often_seen, _ONCE, 0)
            elif self._was_gone(row):
                costs[i] += _BACK
        return np.where((one.shared > 0) | is_near, costs, _NEVER)

    def _costs_of_replacing(self, one: ComparedTracks) -> NDArray[np.float64]:
        """Return what else it costs that what is gone is each of the others, shape (N, M).

        If it is one in its place, it has moved within it. Or another one stands there instead, so
        both must be as alike in height and color as if it were elsewhere.
        """
        gone = np.array([self._is_gone(row) for row in one.known])[:, None]
        if not (gone & (self._stays[one] < _NEVER)).any():
            return np.zeros(gone.shape)
        costs = (_RAISED - _HIGHER) * one.height_gaps + self._costs_of_color(one)
        return np.where(gone, costs, 0.0)

    def _costs_of_moving(
        self, one: ComparedTracks, leaving: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return what it costs that each known object was moved to each of the others, (N, M).

        Only where that may be less than that the one has left, and the other one came.
        """
        costs = _MOVED + _FAR * (
            _log_ratios(one.distances, _NEAREST) + _log_ratios(one.distances, _ACROSS)
        )
        costs += _RAISED * one.height_gaps
        for i, row in enumerate(one.known):
            if not self._is_gone(row):
                costs[i] += _STILL_THERE * (1 - self._missed(row))
            elif self._was_gone(row):
                costs[i] += _LONG_GONE
        coming = _CAME + self._rarity(self._tracks.objects[one.fresh[0]].name)
        possible = self._may_have_moved(one) & (costs < leaving[:, None] + coming)
        if possible.any():
            costs += self._costs_of_color(one)
        for i, j in np.argwhere(possible).tolist():
            row, other = one.known[i], one.fresh[j]
            alike = likeness_of_tracks(self._tracks, row, other)
            frames_with_both = self._tracks.objects[row].co_occurrences[self._id(other)]
            possible[i, j] = alike >= _LEAST_LIKE and frames_with_both <= _BY_CHANCE
            costs[i, j] += _TURNED * (1 - alike)
            costs[i, j] += 0.0 if self._was_without(other) else _UNKNOWN
        return np.where(possible, costs, _NEVER)

    def _costs_of_color(self, one: ComparedTracks) -> NDArray[np.float64]:
        """Return what it costs that known objects have the colors of the others, shape (N, M).

        Another color costs the more, the more objects of the class have kept theirs: chairs do, but
        a board or a person may show another side. The rate is the mean of a beta distribution.
        """
        if (known := self._costs_of_colors.get(one)) is not None:
            return known
        same = self._surely_same
        away = color_distances(self._tracks, one.known, one.fresh, same)
        pairs = [(i, one.fresh.index(same[row])) for i, row in enumerate(one.known) if row in same]
        kept = np.array([away[pair] for pair in pairs])
        kept = kept[~np.isnan(kept)]
        changed = np.count_nonzero(kept > SAME_COLOR)
        rate = (changed + _BEFORE_ANY * _REPAINTED) / (len(kept) + _BEFORE_ANY)
        costs = np.where(away > SAME_COLOR, -math.log(rate), 0.0)
        self._costs_of_colors[one] = costs
        return costs

    def _may_have_moved(self, one: ComparedTracks) -> BoolArray:
        """Return which known objects may be which others, as far as times and places tell."""
        objects, same = self._tracks.objects, self._surely_same
        stayed = set(same.values())
        last = np.array([objects[row].buffer.surely_there[1] for row in one.known])
        first = np.array([objects[row].buffer.surely_there[0] for row in one.fresh])
        is_known = np.array([self._can_move(row) and row not in same for row in one.known])
        is_sure = np.array(
            [
                self._is_published(row) and row not in stayed and not self._is_second(row, stayed)
                for row in one.fresh
            ]
        )
        found: BoolArray = (one.distances >= MIN_SHIFT) & (one.distances <= FARTHEST)
        found &= (first > last[:, None]) & is_known[:, None] & is_sure
        return found

    def _is_second(self, row: int, stayed: Set[int]) -> bool:
        """Return whether a thin track of this drive is hardly apart from one of what has stayed.

        Then poses have put that thing into two places, unless frames show both.
        """
        objects, shapes = self._tracks.objects, self._tracks.shapes
        track, shape = objects[row], shapes.polygons[row]
        if shape.cached(sides)[0] > self._config.tolerance:
            return False
        return any(
            objects[other].name == track.name
            and shapely.dwithin(shapes.polygons[other].geometry, shape.geometry, _SAME_PLACE)
            and not are_two(track, objects[other], 0)
            for other in stayed
        )

    def _can_move(self, row: int) -> bool:
        """Return whether a known object may have been in the map, and no one has edited it."""
        track = self._tracks.objects[row]
        return track.by_hand is None and track.buffer.count >= MAPPED

    def _costs_of_leaving(self, one: ComparedTracks) -> NDArray[np.float64]:
        """Return what it costs that each known object is none of the others, shape (N,)."""
        is_sure = np.array([self._is_published(row) for row in one.fresh])
        least = np.minimum(one.areas[0][:, None], one.areas[1])
        is_replaced = ((one.shared > 0) & (one.shared >= _OVER * least) & is_sure).any(axis=1)
        rows = zip(one.known, is_replaced.tolist(), strict=True)
        return np.array([self._cost_of_leaving(row, replaced) for row, replaced in rows])

    def _cost_of_leaving(self, row: int, is_replaced: bool) -> float:
        if self._was_gone(row) or self._tracks.objects[row].buffer.count == 1:
            return 0.0
        if self._is_gone(row) or is_replaced:
            return _LEFT
        return _UNSEEN + (_LEFT - _UNSEEN) * self._missed(row)

    def _cost_of_coming(self, row: int) -> float:
        """Return what it costs that a track of the drive is no known object."""
        if not self._is_published(row):
            return _DOUBTFUL
        came = _CAME if self._was_without(row) else _MAY_HAVE_BEEN
        return came + self._rarity(self._tracks.objects[row].name)

    def _rarity(self, name: str) -> float:
        """Return how much rarer a class is than that of most objects, as a logarithm; 0 if not.

        Where there are ten chairs and one person, what comes anew is hardly another person.
        """
        usual = sum(n * n for n in self._numbers.values()) / max(self._numbers.total(), 1)
        return max(math.log(max(usual, _ALSO) / (self._numbers[name] + _ALSO)), 0.0)

    @cached_property
    def _numbers(self) -> Counter[str]:
        """How many objects of each class there were when this drive began."""
        objects = self._tracks.objects
        there = [objects[row] for row in self._known if not self._was_gone(row)]
        return Counter(track.name for track in there if track.buffer.count >= MAPPED)

    @cached_property
    def _surely_same(self) -> dict[int, int]:
        """The rows of this drive that surely show known objects in their places, by these."""
        found = {}
        for one in self._classes:
            costs = self._stays[one]
            for i, j in enumerate(costs.argmin(axis=1).tolist()):
                if costs[i, j] < _SURELY and costs[:, j].argmin() == i:
                    found[one.known[i]] = one.fresh[j]
        return found

    def _id(self, row: int) -> int:
        return self._tracks.objects[row].id

    def _is_published(self, row: int) -> bool:
        return bool(self._tracks.existence[row] > self._config.publish_above)

    def _is_gone(self, row: int) -> bool:
        return bool(self._tracks.existence[row] <= GONE)

    def _was_gone(self, row: int) -> bool:
        """Return whether a known object was gone before this drive began."""
        since = self._tracks.objects[row].gone_since
        return self._is_gone(row) and (since is None or since < self._began - STALE)

    @cached_property
    def _began(self) -> float:
        """The stamp of the first observation of this drive [s]."""
        return min(self._tracks.objects[row].buffer.first_seen for row in self._fresh)

    def _missed(self, row: int) -> float:
        """Return how far a known object has been missed, 0..1."""
        given = self._tracks.objects[row].buffer.count * self._config.gain  # none to what was drawn
        sure = max(_KEPT * min(given, self._config.max_existence), _TINY)
        return 1 - float(np.clip(self._tracks.existence[row] / sure, 0, 1))

    def _was_without(self, row: int) -> bool:
        """Return whether the robot saw the place of a track of this drive before it was there."""
        number, shape = self._id(row), self._tracks.shapes.polygons[row]
        known = self._seen_before.get(number)  # each view of this drive would not change it
        if known is None or known[0] is not shape:
            known = shape, was_without(self._tracks, row, self._views)
            self._seen_before[number] = known
        return known[1]

    @cached_property
    def _views(self) -> Views:
        return views_of_tracks(self._tracks)


def _log_ratios(distances: NDArray[np.float64], least: float) -> NDArray[np.float64]:
    """Return the logarithms of distances over a least one [m]; 0 for shorter ones."""
    return np.asarray(np.log(np.maximum(distances, least) / least))


def _confidence(moves: NDArray[np.float64], i: int, j: int) -> float:
    """Return how likely a move is, over all others of its object or to its new place, 0..1."""
    others = moves[i], moves[:, j]
    return float(1 / max(np.exp(moves[i, j] - costs).sum() for costs in others))
