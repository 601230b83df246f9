"""Edits made by hand to two maps, in the merged one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from hypermap.mapping.by_hand import HandEdit
from hypermap.mapping.merging.logged import Side
from hypermap.mapping.merging.moving import renumbered
from hypermap.mapping.prepared_polygon import PreparedPolygon, shared_area
from hypermap.mapping.protection import protected
from hypermap.mapping.stages import EvidenceConfig
from hypermap.mapping.tracks import TrackTable

_SAME_PLACE = 0.5
"""Share of the smaller of two shapes that the other one covers where they are of one object."""


def with_edits(
    tracks: TrackTable, sides: tuple[Side, Side], numbers: Mapping[int, int], config: EvidenceConfig
) -> tuple[TrackTable, frozenset[int]]:
    """Return tracks with all edits made by hand, and the ids of what was edited in both maps.

    What has none of the evidence, such as objects drawn by hand, is added. A piece that people have
    deleted in the second map stays if it is a part of another object by now.

    Args:
        tracks: the merged ones.
        sides: both maps.
        numbers: the ids of the second map's tracks in `tracks`, by their own; of those of one
            object, the one with most of its evidence comes first.
        config: of both.
    """
    mine, other = (_edited(side.tracks) for side in sides)
    theirs: dict[int, int] = {}  # rows, by ids in `tracks`
    whole = set[int]()
    for own, number in numbers.items():
        is_piece = number in whole
        whole.add(number)
        if own in other and not (is_piece and sides[1].tracks.objects[other[own]].is_deleted):
            theirs.setdefault(number, other[own])
    twins = set[int]()  # deleted in the second map, and left without evidence of the first
    deleted = Deleted.of(tracks)
    for number in mine:
        twin = deleted.at(sides[0].tracks, number)
        if twin in theirs and twin not in mine:
            theirs[number] = theirs.pop(twin)
            twins.add(twin)
    edited = {n: (sides[1].tracks, row) for n, row in theirs.items()}
    edited |= {n: (sides[0].tracks, row) for n, row in mine.items()}
    if not edited:
        return tracks, frozenset()
    found = enumerate(tracks.objects)
    present = {track.id: (tracks, row) for row, track in found if track.id not in twins}
    table, edits = TrackTable(config.max_existence), dict[int, HandEdit]()
    for number, (source, row) in sorted((edited | present).items()):
        track = renumbered(source.objects[row], number)
        if source is not tracks:
            track.co_occurrences = Counter()  # counted by other ids
        low, high = source.shapes.heights[row].tolist()
        existence, shape = source.existence.item(row), source.shapes.polygons[row]
        table.add(track, 0, shape, (low, high), existence, source.missed(row))
        if number in edited:
            its, own_row = edited[number]
            edit = renumbered(its.objects[own_row], number).by_hand
            assert edit is not None
            edits[number] = edit
    table.next_id = max(table.next_id, tracks.next_id)
    table = protected(table, edits, config)
    table.first_id = table.next_id
    return table, frozenset(mine.keys() & theirs.keys())


@dataclass(frozen=True)
class Deleted:
    """Tracks that people have deleted: their ids, names and shapes.

    Frames that are mapped again leave them without evidence, so that only their places tell which
    tracks of another map are the same.
    """

    rows: list[tuple[int, str, PreparedPolygon]]

    @classmethod
    def of(cls, tracks: TrackTable) -> Deleted:
        """Return those of a table."""
        pairs = zip(tracks.objects, tracks.shapes.polygons, strict=True)
        return cls([(track.id, track.name, shape) for track, shape in pairs if track.is_deleted])

    def at(self, tracks: TrackTable, number: int) -> int | None:
        """Return the id of the one at the place of a track of another table; None if there is none.

        Args:
            tracks: the other table, in the same frame.
            number: the id of its track.
        """
        for row in tracks.rows_of([number]) if self.rows else ():
            shape = tracks.shapes.polygons[row]
            for own, name, there in self.rows:
                least = _SAME_PLACE * min(shape.area, there.area)
                if name == tracks.objects[row].name and shared_area(shape, there) >= least:
                    return own
        return None


def _edited(tracks: TrackTable) -> dict[int, int]:
    """Return the rows of the tracks that people have edited, by their ids."""
    return {t.id: row for row, t in enumerate(tracks.objects) if t.by_hand is not None}
