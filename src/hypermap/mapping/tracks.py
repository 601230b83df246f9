"""The table of tracks of an evidence map: a row for each, in the order of their ids."""

from __future__ import annotations

import dataclasses
import math
from bisect import bisect_left
from collections import Counter
from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from hypermap._loops import inner_loop, loop
from hypermap.core.arrays import BoolArray, IntArray
from hypermap.mapping.by_hand import HandEdit
from hypermap.mapping.columns import Column
from hypermap.mapping.evidence_buffer import Evidence, EvidenceBuffer
from hypermap.mapping.prepared_polygon import PreparedPolygon
from hypermap.mapping.track_shapes import Rows, TrackShapes

_CO_OCCURRENCE_SHARE = 0.2  # share of a track's frames that also show another: then they are two


@dataclasses.dataclass(eq=False)
class Track:
    """The state of one track, apart from the columns of the table.

    Attributes:
        id: unique among all tracks that were ever in the table.
        name: its class.
        buffer: the evidence for it.
        co_occurrences: numbers of frames that showed both it and another track of its class, by the
            id of the other.
        pending: pieces of evidence since its shape was last fused.
        by_hand: edits made by hand; None for none.
        moved: confidence that its object was at another place before, 0..1; None if it was not
            moved.
        moved_since: stamp of the first observation at its present place [s]; None likewise.
        gone_since: stamp of the frame since which it is surely gone [s]; None if it is not.
    """

    id: int
    name: str
    buffer: EvidenceBuffer
    co_occurrences: Counter[int] = dataclasses.field(default_factory=Counter)
    pending: int = 0
    by_hand: HandEdit | None = None
    moved: float | None = None
    moved_since: float | None = None
    gone_since: float | None = None

    def copy(self) -> Track:
        """Return an independent copy."""
        return Track(
            self.id,
            self.name,
            self.buffer.copy(),
            self.co_occurrences.copy(),
            self.pending,
            self.by_hand,
            self.moved,
            self.moved_since,
            self.gone_since,
        )

    @property
    def is_deleted(self) -> bool:
        """Whether it was deleted by hand, so it must not come back."""
        return self.by_hand is not None and self.by_hand.is_deleted

    def become(self, other: Track) -> None:
        """Take over the state of another track."""
        vars(self).update(vars(other))


def are_two(one: Track, other: Track, fewest: int = 1, share: float = _CO_OCCURRENCE_SHARE) -> bool:
    """Return whether so many frames show both tracks that they are two objects.

    Args:
        one: a track.
        other: another one.
        fewest: so many frames do not count, whatever their share.
        share: of the frames that show the rarer one; more must show both.
    """
    most = share * min(one.buffer.count, other.buffer.count)
    return one.co_occurrences[other.id] > max(fewest, most)


class TrackTable:
    """A table of tracks: a list of objects, and columns for numbers.

    Attributes:
        objects: one track per row.
        shapes: the shapes, classes and heights of the tracks.
        next_id: id of the next new track.
        first_id: id of the first track of the present drive; smaller ones are of earlier drives.
    """

    def __init__(self, max_existence: float) -> None:
        """Prepare an empty table; existence never grows above `max_existence`."""
        self.objects: list[Track] = []
        self._ids: list[int] = []
        self.shapes = TrackShapes()
        self._existence = Column(np.empty(0))
        self._spared = Column(np.empty(0))
        self._misses = Column(np.empty(0, np.int64))
        self._times = Column(np.empty((0, 5)))
        self._is_edited = Column(np.empty(0, np.bool_))
        self._max_existence = max_existence
        self.next_id = self.first_id = 0

    def copy(self) -> TrackTable:
        """Return a table of the same `Track` objects; the columns are copied."""
        other = TrackTable(self._max_existence)
        other.objects, other._ids = list(self.objects), list(self._ids)
        other.shapes = self.shapes.copy()
        other._existence = self._existence.copy()
        other._spared = self._spared.copy()
        other._misses = self._misses.copy()
        other._times = self._times.copy()
        other._is_edited = self._is_edited.copy()
        other.next_id, other.first_id = self.next_id, self.first_id
        return other

    def snapshot(self) -> TrackTable:
        """Return an independent copy."""
        other = self.copy()
        other.objects = [track.copy() for track in self.objects]
        return other

    @property
    def existence(self) -> NDArray[np.float64]:
        """The existence of each track, float64, shape (N,)."""
        return self._existence.values

    @property
    def spared(self) -> NDArray[np.float64]:
        """How much less existence each track would have if every miss cost the same, shape (N,)."""
        return self._spared.values

    @property
    def misses(self) -> IntArray:
        """How often each track was missed, see-throughs apart, int64, shape (N,)."""
        return self._misses.values

    @property
    def times(self) -> NDArray[np.float64]:
        """The stamps of each track [s], and its number of observations, shape (N, 5).

        The stamps are those from when on and up to when it surely was there (`surely_there`), when
        it was last seen, and since when it is gone, NaN if it is not. `note_times` updates them.
        """
        return self._times.values

    @property
    def is_edited(self) -> BoolArray:
        """Whether people had edited each track when it was added, shape (N,)."""
        return self._is_edited.values

    def note_times(self, rows: Sequence[int]) -> None:
        """Update `times` after the evidence for some tracks, or their `gone_since`, changed."""
        for row in rows:
            self._times.values[row] = _times_of(self.objects[row])

    def append(self, name: str, class_: int, evidence: Evidence, max_evidence: int) -> int:
        """Add a track with the shape of some evidence, but without evidence; return its row."""
        track = Track(self.next_id, name, EvidenceBuffer(max_evidence))
        return self.add(track, class_, evidence.prepared, (evidence.z_min, evidence.z_max), 0.0)

    def add(
        self,
        track: Track,
        class_: int,
        shape: PreparedPolygon,
        heights: tuple[float, float],
        existence: float,
        missed: tuple[int, float] = (0, 0.0),
    ) -> int:
        """Add a track whose id is larger than those of all others; return its row.

        `missed` is what `missed` returns for its row in another table.
        """
        self.objects.append(track)
        self._ids.append(track.id)
        self._existence.append(existence)
        self._misses.append(missed[0])
        self._spared.append(missed[1])
        self._times.append(_times_of(track))
        self._is_edited.append(track.by_hand is not None)
        self.next_id = max(self.next_id, track.id + 1)
        return self.shapes.append(class_, shape, heights)

    def remove(self, rows: Sequence[int]) -> None:
        """Remove tracks; later rows move up."""
        wanted: BoolArray = np.ones(len(self.objects), dtype=bool)
        wanted[np.asarray(rows)] = False
        for row in sorted(rows, reverse=True):
            del self.objects[row], self._ids[row]
        self._keep(np.flatnonzero(wanted))

    def of_tracks(self, tracks: Sequence[Track], rows: Rows) -> TrackTable:
        """Return a table of other tracks, in the order of their ids.

        Args:
            tracks: one for each row.
            rows: of this table, whose columns they get.
        """
        other = self.copy()
        other.objects, other._ids = list(tracks), [track.id for track in tracks]
        other._keep(np.array(rows, np.int64))
        other.next_id = max([self.next_id, *(number + 1 for number in other._ids)])
        return other

    def _keep(self, rows: IntArray) -> None:
        """Keep some rows of all columns, in this order, shape (R,)."""
        self.shapes.keep(rows)
        columns = self._existence, self._spared, self._misses, self._times, self._is_edited
        for column in columns:
            column.keep(rows)

    def missed(self, row: int) -> tuple[int, float]:
        """Return how often a track was missed, and how much existence it was spared."""
        return self._misses.values.item(row), self._spared.values.item(row)

    def change_existence(self, row: int, by: float, spared: float = 0.0) -> None:
        """Change a track's existence, capped; rounded so that five times 0.2 is exactly 1.

        Args:
            row: of the track.
            by: what is added.
            spared: by how much more it would fall without an estimate of how often it is found.
        """
        _change(self.existence, self.spared, row, by, spared, self._max_existence)

    def rows_of(self, ids: Collection[int]) -> Rows:
        """Return the rows of the tracks with these ids, in ascending order."""
        rows = []
        for number in sorted(ids):
            row = bisect_left(self._ids, number)
            if row < len(self._ids) and self._ids[row] == number:
                rows.append(row)
        return rows

    def hand_edits(self) -> dict[int, HandEdit]:
        """Return the edits made by hand, by the ids of the tracks."""
        return {track.id: track.by_hand for track in self.objects if track.by_hand is not None}

    def last_stamp(self) -> float:
        """Return the newest stamp of the present drive [s], or else of earlier ones; -inf if none.

        The present drive may be older than others, which were mapped before it.
        """
        seen = [track for track in self.objects if len(track.buffer)]
        own = [track for track in seen if track.id >= self.first_id]
        return max((track.buffer.last_seen for track in own or seen), default=-math.inf)

    def excluding(self, rows: Rows, ids: Collection[int]) -> Rows:
        """Return the rows whose tracks have none of these ids."""
        return [row for row in rows if self.objects[row].id not in ids]


def _times_of(track: Track) -> tuple[float, float, float, float, int]:
    gone, buffer = math.nan if track.gone_since is None else track.gone_since, track.buffer
    return (*buffer.surely_there, buffer.last_seen, gone, buffer.count)


@loop()
def _change(
    existence: NDArray[np.float64],
    without: NDArray[np.float64],
    row: int,
    by: float,
    spared: float,
    most: float,
) -> None:
    """Do the work of `TrackTable.change_existence`.

    Args:
        existence: of each track, shape (N,).
        without: as `TrackTable.spared`.
        row: as in `change_existence`, as `by` and `spared`.
        by: likewise.
        spared: likewise.
        most: above which no existence grows.
    """
    rest = min(existence[row] - without[row] + by - spared, most)
    existence[row] = _rounded(min(existence[row] + by, most))
    without[row] = existence[row] - _rounded(rest)


@inner_loop()
def _rounded(existence: float) -> float:
    return float(np.rint(existence * 1e9) / 1e9 + 0.0)  # never the negative zero
