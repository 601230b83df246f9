"""What one frame shows is associated with tracks: it adds evidence to them, or begins new ones."""

from __future__ import annotations

from operator import itemgetter

from hypermap.mapping.association import ASSOCIATIONS
from hypermap.mapping.changing_tracks import ChangingTracks
from hypermap.mapping.completion import FreeShare
from hypermap.mapping.evidence_buffer import CONFIRMED, Evidence, FoundEvidence
from hypermap.mapping.footprint_iou import footprint_ious
from hypermap.mapping.merge_rules import MergeRules
from hypermap.mapping.published import PublishedTracks
from hypermap.mapping.track_shapes import Rows
from hypermap.mapping.tracks import are_two

_SURELY_TWO = 0.5  # share of the frames with one track that show another object, too


class FrameUpdate:
    """The update of the tracks by the shapes of one frame.

    Attributes:
        observed: ids of the tracks that the frame shows.
    """

    def __init__(self, tracks: ChangingTracks, is_free: FreeShare | None) -> None:
        """Prepare to update tracks.

        Args:
            tracks: changed.
            is_free: as in `EvidenceMap`.
        """
        self.observed: set[int] = set()
        self._tracks, self._config, self._is_free = tracks, tracks.config, is_free
        self._associate = ASSOCIATIONS[self._config.association]
        self._met: list[tuple[int, int]] = []  # ids of known tracks, and of what is at their places

    def add(self, found: FoundEvidence) -> list[int]:
        """Add the evidence of the frame, and return the ids of the tracks that get it."""
        # All are compared with the tracks before this frame, so their order does not matter.
        misclassified = [self._misclassified(item.name, evidence) for item, evidence in found]
        numbers = [
            self._add(item.name, evidence) if actual is None else actual
            for (item, evidence), actual in zip(found, misclassified, strict=True)
        ]
        if self._config.exclusive:
            self._count_co_occurrences()
        self.observed.update(numbers)  # also those that were misclassified, or deleted by hand
        return numbers

    def _misclassified(self, name: str, evidence: Evidence) -> int | None:
        """Return the id of the confirmed track of another class that was misclassified here.

        None if there is none.
        """
        if self._config.slip >= 1:
            return None
        tracks, slip = self._tracks, self._config.slip
        shapes, objects, shape = tracks.table.shapes, tracks.table.objects, evidence.prepared
        rows, heights = shapes.near(None, shape.box), (evidence.z_min, evidence.z_max)
        rows = [row for row in rows if tracks.takes_evidence(row)]
        others = [row for row in rows if objects[row].name != name]
        if not others:
            return None
        own = [row for row in rows if objects[row].name == name]
        if any(iou >= slip / 2 for iou in footprint_ious(shape, heights, shapes, own)):
            return None
        others = [row for row in others if objects[row].buffer.count >= CONFIRMED]
        enough = [
            (iou, row)
            for iou, row in zip(footprint_ious(shape, heights, shapes, others), others, strict=True)
            if iou >= slip and iou > 0 and tracks.may_be(row) and not tracks.is_gone(row)
        ]
        return objects[max(enough, key=itemgetter(0))[1]].id if enough else None

    def _add(self, name: str, evidence: Evidence) -> int:
        """Add evidence to an existing or new track, and return the track's id."""
        tracks, table, config = self._tracks, self._tracks.table, self._config
        class_ = tracks.class_number(name)
        matches = self._associate(evidence.prepared, class_, table.shapes, config)
        if config.exclusive:
            matches = table.excluding(matches, self.observed)
        there = [row for row in matches if tracks.may_be(row)]
        if matches and not there:  # objects deleted by hand do not come back
            return table.objects[matches[0]].id
        known = [row for row in there if not tracks.takes_evidence(row)]
        there = [row for row in there if tracks.takes_evidence(row)]
        # What is gone comes back by `find_moves`, as another one may have moved to its place; but
        # what people have edited comes back here, as it never moves.
        matches = [row for row in there if not tracks.is_remembered(row)]
        matches = matches or [row for row in there if tracks.is_edited(row)]
        if len(matches) == 0:
            row = table.append(name, class_, evidence, config.max_evidence)
        elif config.combine == "matches":
            row = self._merge(matches)
        else:
            row = self._most_alike(matches, evidence)
        track = tracks.touch(row)
        track.buffer.add(evidence)
        track.pending += 1
        if tracks.is_remembered(row):
            table.change_existence(row, -float(table.existence[row]))  # it is back
            table.spared[row] = table.misses[row] = 0
        gain = config.gain * (evidence.score if config.gain_by_score else 1.0)
        table.change_existence(row, gain)
        if track.pending > config.renewal * len(track.buffer):
            tracks.refresh_shape(row)
            if config.combine == "overlapping":
                row = self._merge_overlapping(row)
        number = table.objects[row].id
        self.observed.add(number)
        self._met += [(table.objects[one].id, number) for one in known[:1]]
        return number

    def _most_alike(self, matches: Rows, evidence: Evidence) -> int:
        """Return the best match, or one more like the shape that is surely another object.

        The track of a chair that once reached over the next one, too, holds all of both.
        """
        shapes, objects = self._tracks.table.shapes, self._tracks.table.objects
        first, *others = matches
        fewest, share = CONFIRMED - 1, _SURELY_TWO
        rows = [row for row in others if are_two(objects[first], objects[row], fewest, share)]
        if not rows:
            return first
        heights = evidence.z_min, evidence.z_max
        ious = footprint_ious(evidence.prepared, heights, shapes, [first, *rows])
        return max(zip(ious, [first, *rows], strict=True), key=lambda found: found[0])[1]

    def _merge(self, rows: Rows) -> int:
        """Merge tracks into the one that is to be kept, and return its row."""
        row, *others = self._merge_rules().mergeable(rows)
        if others:
            table, track = self._tracks.table, self._tracks.touch(row)
            track.buffer.merge(table.objects[other].buffer for other in others)
            track.pending = len(track.buffer)
            for other in others:
                self._tracks.transfer_co_occurrences(table.objects[other], track)
            table.misses[row] += table.misses[others].sum()
            existence, spared = table.existence[others], table.spared[others]
            table.change_existence(row, float(existence.sum()), float(spared.sum()))
            table.remove(others)
            (row,) = table.rows_of([track.id])
        return row

    def _merge_overlapping(self, row: int) -> int:
        """Merge a track with those that its fused shape matches, until there are none."""
        tracks, shapes = self._tracks, self._tracks.table.shapes
        while True:
            shape, class_ = shapes.polygons[row], int(shapes.classes[row])
            matches = self._associate(shape, class_, shapes, self._config)
            matches = [one for one in matches if one == row or tracks.takes_evidence(one)]
            if len(matches) > 1 and self._config.exclusive:
                matches = [one for one in matches if one == row or self._are_one(row, one)]
            if len(matches) > 1 and tracks.are_edited:
                matches = self._merge_rules().mergeable(matches)
                matches = matches if row in matches else []
            if len(matches) <= 1:  # it matches itself
                return row
            row = self._merge(matches)
            tracks.refresh_shape(row)

    def _are_one(self, row: int, match: int) -> bool:
        """Return whether a track and one that it matches may be one object."""
        return not self._tracks.is_remembered(match) and self._merge_rules().are_one(row, match)

    def _merge_rules(self) -> MergeRules:
        table, are_edited = self._tracks.table, self._tracks.are_edited
        published = PublishedTracks(table, self._config, self._is_free, are_edited)
        return MergeRules(published, self.observed)

    def _count_co_occurrences(self) -> None:
        """Count the co-occurrences of tracks of one class that got evidence in this frame."""
        tracks, rows_of = self._tracks, self._tracks.table.rows_of
        shown = [tracks.touch(row) for row in rows_of(self.observed)]
        for track in shown:
            for other in shown:
                if other is not track and other.name == track.name:
                    track.co_occurrences[other.id] += 1
        for number, own in self._met:  # a known object, and others of its class beside it
            for row in rows_of([number]):
                known = tracks.touch(row)
                for other in shown:
                    if other.name == known.name and other.id not in (own, number):
                        known.co_occurrences[other.id] += 1
                        other.co_occurrences[number] += 1
