"""The tracks of an evidence map while frames change them: a frame that fails can be undone."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from hypermap.mapping.fusion import FUSIONS
from hypermap.mapping.stages import EvidenceConfig
from hypermap.mapping.tracks import Track, TrackTable


class ChangingTracks:
    """A table of tracks, and all that must be done when one of them changes.

    Attributes:
        table: the tracks. Its `times` are up to date after `note_times`.
        config: of their map.
        are_edited: whether people have edited any track.
    """

    def __init__(self, config: EvidenceConfig) -> None:
        self.table = TrackTable(config.max_existence)
        self.config = config
        self.are_edited = False
        self._fuse = FUSIONS[config.fusion]
        self._classes: dict[str, int] = {}
        self._outdated: set[int] = set()  # ids of tracks whose stamps in the table are outdated
        self._touched: dict[int, tuple[Track, Track]] | None = None  # changed tracks, and copies

    def go_on_with(self, table: TrackTable) -> None:
        """Take over the tracks of a map with the same configuration."""
        self.table = table
        self.are_edited = any(track.by_hand is not None for track in table.objects)
        for row, track in enumerate(table.objects):
            table.shapes.classes[row] = self.class_number(track.name)

    def begin_drive(self, table: TrackTable) -> None:
        """Go on with other tracks of the same objects, which all are of earlier drives now."""
        self.table = table
        table.first_id = table.next_id

    def class_number(self, name: str) -> int:
        """Return the number of a class in the table."""
        return self._classes.setdefault(name, len(self._classes))

    def touch(self, row: int) -> Track:
        """Return a track that is about to change."""
        track = self.table.objects[row]
        self._outdated.add(track.id)
        if self._touched is not None and track.id not in self._touched:
            self._touched[track.id] = track, track.copy()
        return track

    def note_times(self) -> None:
        """Update the stamps of the tracks that have changed since the last call."""
        if self._outdated:
            self.table.note_times(self.table.rows_of(self._outdated))
            self._outdated.clear()

    @contextmanager
    def all_or_nothing(self) -> Iterator[None]:
        """Undo all changes if the block fails."""
        self.note_times()
        before, touched = self.table.copy(), dict[int, tuple[Track, Track]]()
        self._touched = touched
        try:
            yield
        except BaseException:  # for example, out of memory
            self.table = before
            for track, was in touched.values():
                track.become(was)
            raise
        finally:
            self._touched = None

    def may_be(self, row: int) -> bool:
        """Return whether a track may exist: not if it was deleted by hand."""
        return not (self.are_edited and self.table.objects[row].is_deleted)

    def is_edited(self, row: int) -> bool:
        """Return whether people have edited a track."""
        return self.are_edited and self.table.objects[row].by_hand is not None

    def takes_evidence(self, row: int) -> bool:
        """Return whether a track takes this drive's evidence: of earlier ones, only edited ones."""
        return self.table.objects[row].id >= self.table.first_id or self.is_edited(row)

    def is_gone(self, row: int) -> bool:
        """Return whether a track has less existence than those that are kept."""
        return bool(self.table.existence[row] <= self.config.forget_below)

    def is_remembered(self, row: int) -> bool:
        """Return whether a track is gone, and kept only because its object may be elsewhere."""
        return self.config.moves and self.is_gone(row)

    def refresh_shape(self, row: int) -> None:
        """Fuse a track's shape from its evidence."""
        track, shapes = self.touch(row), self.table.shapes
        if track.by_hand is None or track.by_hand.shape is None:
            shapes.replace(row, self._fuse(track.buffer, self.config))
        if self.config.sight == "rays" or self.config.contested > 0:
            shapes.heights[row] = track.buffer.heights()
        track.pending = 0

    def transfer_co_occurrences(self, merged: Track, kept: Track) -> None:
        """Move the co-occurrences of a merged track to the one that is kept, on both sides."""
        kept.co_occurrences.update(merged.co_occurrences)
        for row in self.table.rows_of(merged.co_occurrences):
            neighbor = self.touch(row)
            neighbor.co_occurrences[kept.id] += neighbor.co_occurrences.pop(merged.id)
        del kept.co_occurrences[kept.id]  # from frames that showed both

    def forget_co_occurrences(self, track: Track) -> None:
        """Drop the co-occurrences of other tracks with one."""
        for row in self.table.rows_of(track.co_occurrences):
            self.touch(row).co_occurrences.pop(track.id)
