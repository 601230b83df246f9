"""The evidence map: observed shapes become tracks, whose existence rises and falls.

Source: section 3.4.5 of the thesis of 2019 for the profile "thesis"; docs/mapping.md describes
both profiles.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Collection, Mapping
from operator import itemgetter

import numpy as np
import shapely

from hypermap.core.embeddings import Embedding
from hypermap.core.pictures import ObjectPicture
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.history.likeness import MIN_MOVED
from hypermap.mapping.association import ASSOCIATIONS
from hypermap.mapping.by_hand import HandEdit, are_new
from hypermap.mapping.class_sizes import is_usual
from hypermap.mapping.completion import FreeShare
from hypermap.mapping.earlier_drives import EarlierDrives
from hypermap.mapping.evidence_buffer import (
    CONFIRMED,
    STALE,
    Evidence,
    FoundEvidence,
    SeenColor,
    evidence_from,
)
from hypermap.mapping.footprint_iou import footprint_ious
from hypermap.mapping.fusion import FUSIONS
from hypermap.mapping.merge_rules import MergeRules
from hypermap.mapping.missed_detections import penalize_missed, prune
from hypermap.mapping.moved import GONE, find_moves
from hypermap.mapping.protection import protected
from hypermap.mapping.published import PublishedTracks
from hypermap.mapping.stages import EvidenceConfig
from hypermap.mapping.track_shapes import Rows
from hypermap.mapping.tracks import Track, TrackTable, are_two
from hypermap.perception.observation import Observation, ObservedObject
from hypermap.perception.paint import Rgb

_log = logging.getLogger(__name__)

_SURELY_TWO = 0.5  # share of the frames with one track that show another object, too


class EvidenceMap:
    """Objects and the evidence for them.

    Each observed shape is associated with the tracks of its class. A track's shape is fused from
    its evidence, and its existence grows. Missed detections lower the existence of tracks that the
    frame should have shown. A track is published above one threshold of existence and pruned below
    another.

    Attributes:
        config: the settings.
        ignored: how many observed shapes were skipped because they have no area.
        shown: the objects of the last frame, each with the id of its track.
        is_free: returns the known free share of an area, 0..1, into which published shapes are not
            completed; None if nothing is known.
        left_out: ids of the published tracks that the last final layer left out; see `layer`.
    """

    def __init__(self, config: EvidenceConfig, is_free: FreeShare | None = None) -> None:
        self.config = config
        self.ignored = 0
        self.shown: list[tuple[ObservedObject, int]] = []
        self.is_free = is_free
        self.left_out: set[int] = set()
        self._associate = ASSOCIATIONS[config.association]
        self._fuse = FUSIONS[config.fusion]
        self._observed: set[int] = set()  # ids of the tracks that this frame shows
        self._met: list[tuple[int, int]] = []  # ids of known tracks, and of what is at their places
        self._touched: dict[int, tuple[Track, Track]] | None = None  # changed tracks, and copies
        self._outdated: set[int] = set()  # ids of tracks whose stamps in the table are outdated
        self._classes: dict[str, int] = {}
        self._tracks = TrackTable(config.max_existence)
        self._earlier = EarlierDrives(config)
        self._settled: TrackTable | None = None  # the tracks, one per object; None if unknown
        self._newest = -math.inf  # stamp of the last frame
        self._edited = False  # whether people have edited anything

    def __len__(self) -> int:
        """Return how many objects are published."""
        return len(self._as_published().rows())

    def update(self, observation: Observation, found: FoundEvidence | None = None) -> None:
        """Add one frame. If that fails, the map stays unchanged.

        Empty and invalid shapes, and those without area, are skipped and counted.

        Args:
            observation: the frame.
            found: what `evidence_from` returns for it, if that is known already.
        """
        self._note_times()
        before, ignored, newest = self._tracks.copy(), self.ignored, self._newest
        touched: dict[int, tuple[Track, Track]] = {}
        self._touched = touched
        try:
            self._add_frame(observation, found)
        except BaseException:  # for example, out of memory
            self._tracks, self.ignored, self._newest = before, ignored, newest
            self._settled = None
            for track, was in touched.values():
                track.become(was)
            raise

    def update_for_good(self, observation: Observation, found: FoundEvidence) -> None:
        """Add one frame as `update` does, but faster: if it fails, this map is of no use."""
        self._touched = None
        self._add_frame(observation, found)

    def _add_frame(self, observation: Observation, found: FoundEvidence | None) -> None:
        if self.config.moves:
            self._begin_drive(observation.stamp)
        self._settled = None
        self._observed.clear()
        self._met.clear()
        self.shown = []
        if found is None:
            found = evidence_from(observation, self.config.abstain)
        if len(found) < len(observation.objects):
            self.ignored += len(observation.objects) - len(found)
            _log.info("frame %.6f: skipped shapes without area", observation.stamp)
        if self.config.class_sizes == "usual":
            found = [(item, one) for item, one in found if is_usual(item.name, one)]
        # All are compared with the tracks before this frame, so their order does not matter.
        misclassified = [self._misclassified(item.name, evidence) for item, evidence in found]
        tracks = [
            self._add(item.name, evidence) if actual is None else actual
            for (item, evidence), actual in zip(found, misclassified, strict=True)
        ]
        observed = set(tracks)
        if self.config.exclusive:
            self._count_co_occurrences()
        self.shown = [(item, track) for (item, _), track in zip(found, tracks, strict=True)]
        penalize_missed(self._tracks, observation, observed, self.config)
        for track in prune(self._tracks, self.config):
            self._forget_co_occurrences(track)
        if self.config.moves:
            self._note_gone(observation.stamp)
            self._follow_moves(observation.stamp)

    def _begin_drive(self, stamp: float) -> None:
        """Let the frame with a stamp [s] begin another drive, if it is long after the last one."""
        is_another = abs(stamp - self._newest) > STALE and len(self._tracks.objects) > 0
        self._newest = stamp
        if is_another:
            self._tracks = self.settled().snapshot()
            self._tracks.first_id = self._tracks.next_id
            self._earlier.begin_drive()

    def settled(self) -> TrackTable:
        """Return the tracks, those of this drive joined to the known ones; must not be changed."""
        if self._settled is None:
            self._note_times()
            self._settled = self._earlier.settled(self._tracks)
        return self._settled

    def apart(self) -> frozenset[int]:
        """Return the ids of known tracks to whose pictures and embeddings this drive adds some."""
        own = {track.id: track.buffer for track in self._tracks.objects}
        looks = ((one.id, one.buffer) for one in self.settled().objects)
        return frozenset(
            number
            for number, buffer in looks
            if buffer.pictures is not own[number].pictures
            or buffer.embedding is not own[number].embedding
        )

    def _as_published(self) -> PublishedTracks:
        return PublishedTracks(self.settled(), self.config, self.is_free, self._edited)

    def tracks(self) -> TrackTable:
        """Return a copy of all tracks, which later frames do not change.

        Those of this drive are not joined to the known ones yet; see `settled`.
        """
        self._note_times()
        return self._tracks.snapshot()

    def go_on_with(self, tracks: TrackTable, by_hand: Mapping[int, HandEdit] | None = None) -> None:
        """Take over the tracks of an evidence map with the same configuration.

        Args:
            tracks: of that map; this one owns them from now on.
            by_hand: edits made by hand, by the objects' ids.
        """
        if are_new(by_hand or {}, tracks.hand_edits()):  # people have edited what they saw
            tracks = self._earlier.settled(tracks)
        self._tracks, self._settled = protected(tracks, by_hand or {}, self.config), None
        self._earlier.begin_drive()
        self._newest = self._tracks.last_stamp()
        self._edited = any(track.by_hand is not None for track in self._tracks.objects)
        for row, track in enumerate(self._tracks.objects):
            class_ = self._classes.setdefault(track.name, len(self._classes))
            self._tracks.shapes.classes[row] = class_
        if self.config.moves:
            self._follow_moves()

    def hand_edits(self) -> dict[int, HandEdit]:
        """Return the edits made by hand, by the objects' ids."""
        return self._tracks.hand_edits()

    def objects(self, ids: Collection[int] | None = None) -> list[SemanticObject]:
        """Return the objects with enough existence, in the order of their ids.

        An object keeps its id between calls. Merged objects keep the oldest id.

        Args:
            ids: only these; None for all. Only with None are objects landmarks for each other
                (`landmarks`), parts of one joined, do no two share floor (`exclusive`), and is
                there one class per place (`slip`).
        """
        return self._as_published().objects(ids)

    def summary(self) -> list[tuple[int, int, float]]:
        """Return the id, the number of pieces of evidence and the existence of each object.

        This is fast. An object's shape changes only when its evidence does.
        """
        return self._as_published().summary()

    def layer(
        self, name: str = "semantic", frame_id: str = "map", is_final: bool = True
    ) -> SemanticLayer:
        """Return the objects with enough existence as a layer, with their evidence.

        Args:
            name: of the layer.
            frame_id: its frame.
            is_final: whether objects are landmarks for each other (`landmarks`), no two share floor
                (`exclusive`), and of those in one place, one is left out. False is faster: only
                shapes whose evidence has changed are fused again, and what the last final layer
                left out stays so. Parts of one object are joined in both.
        """
        published = self._as_published()
        ids = {number for number, _, _ in published.summary()}
        if not is_final:
            return published.layer(name, frame_id, ids - self.left_out)
        layer = published.layer(name, frame_id)
        self.left_out = ids.difference(layer.table.ids.tolist())
        return layer

    def evidence(self, object_id: int) -> tuple[Evidence, ...]:
        """Return the kept evidence for an object, oldest first.

        Raises:
            KeyError: If there is no such object, or it was pruned or merged into another.
        """
        rows = self.settled().rows_of([object_id])
        if not rows:
            raise KeyError(object_id)
        return tuple(self.settled().objects[rows[0]].buffer.items)

    def pictures(self, object_id: int) -> tuple[ObjectPicture, ...]:
        """Return the pictures of an object, best first; none if its track was removed."""
        rows = self._tracks.rows_of([object_id])
        return self._tracks.objects[rows[0]].buffer.pictures if rows else ()

    def class_of(self, object_id: int) -> str:
        """Return the class of an object; empty if its track was removed."""
        rows = self._tracks.rows_of([object_id])
        return self._tracks.objects[rows[0]].name if rows else ""

    def keep_pictures(self, object_id: int, pictures: tuple[ObjectPicture, ...]) -> None:
        """Replace the pictures of an object, if its track still exists."""
        self._settled = None
        for row in self._tracks.rows_of([object_id]):
            self._tracks.objects[row].buffer.pictures = pictures

    def lacks_colors(self, stamp: float) -> bool:
        """Return whether the last frame shows a track with few colors of its drive so far.

        Args:
            stamp: of this frame [s].
        """
        rows = self._tracks.rows_of({number for _, number in self.shown})
        return any(self._tracks.objects[row].buffer.lacks_colors(stamp) for row in rows)

    def add_colors(self, stamp: float, colors: Mapping[ObservedObject, Rgb | None]) -> None:
        """Add the colors of objects that the last frame shows, which has this stamp [s].

        None, for an object of several colors, counts as one, so that it is not looked for forever.
        """
        self._settled = None
        for observed, number in self.shown if colors else ():
            for row in self._tracks.rows_of([number]) if observed in colors else ():
                track = self._tracks.objects[row]
                # Another name was misclassified.
                if track.name == observed.name and track.buffer.lacks_colors(stamp):
                    self._touch(row).buffer.add_color(SeenColor(stamp, colors[observed]))

    def add_embedding(self, object_id: int, embedding: Embedding) -> None:
        """Add the embedding of a view of an object, if its track still exists."""
        self._settled = None
        for row in self._tracks.rows_of([object_id]):
            buffer = self._tracks.objects[row].buffer
            buffer.embedding = embedding.plus(buffer.embedding)

    def embedding_model(self) -> str | None:
        """Return the name of the encoders that made the embeddings; None if there are none."""
        looks = (track.buffer.embedding for track in self._tracks.objects)
        return next((look.model for look in looks if look is not None), None)

    def _misclassified(self, name: str, evidence: Evidence) -> int | None:
        """Return the id of the confirmed track of another class that was misclassified here.

        None if there is none.
        """
        if self.config.slip >= 1:
            return None
        shapes, objects, shape = self._tracks.shapes, self._tracks.objects, evidence.prepared
        rows, heights = shapes.near(None, shape.box), (evidence.z_min, evidence.z_max)
        rows = [row for row in rows if self._takes_evidence(row)]
        others = [row for row in rows if objects[row].name != name]
        if not others:
            return None
        own = [row for row in rows if objects[row].name == name]
        if any(iou >= self.config.slip / 2 for iou in footprint_ious(shape, heights, shapes, own)):
            return None
        others = [row for row in others if objects[row].buffer.count >= CONFIRMED]
        ious = footprint_ious(shape, heights, shapes, others)
        enough = [
            (iou, row)
            for iou, row in zip(ious, others, strict=True)
            if iou >= self.config.slip and iou > 0 and self._is_there(row)
        ]
        return objects[max(enough, key=itemgetter(0))[1]].id if enough else None

    def _add(self, name: str, evidence: Evidence) -> int:
        """Add evidence to an existing or new track, and return the track's id."""
        class_ = self._classes.setdefault(name, len(self._classes))
        matches = self._associate(evidence.prepared, class_, self._tracks.shapes, self.config)
        if self.config.exclusive:
            matches = self._tracks.excluding(matches, self._observed)
        there = [row for row in matches if self._may_be(row)]
        if matches and not there:  # objects deleted by hand do not come back
            return self._tracks.objects[matches[0]].id
        known = [row for row in there if not self._takes_evidence(row)]
        there = [row for row in there if self._takes_evidence(row)]
        # What is gone comes back by `find_moves`, as another one may have moved to its place; but
        # what people have edited comes back here, as it never moves.
        matches = [row for row in there if not self._is_remembered(row)]
        matches = matches or [row for row in there if self._is_edited(row)]
        if len(matches) == 0:
            row = self._tracks.append(name, class_, evidence, self.config.max_evidence)
        elif self.config.combine == "matches":
            row = self._merge(matches)
        else:
            row = self._most_alike(matches, evidence)
        track = self._touch(row)
        track.buffer.add(evidence)
        track.pending += 1
        if self._is_remembered(row):
            self._tracks.change_existence(row, -float(self._tracks.existence[row]))  # it is back
            self._tracks.spared[row] = self._tracks.misses[row] = 0
        gain = self.config.gain * (evidence.score if self.config.gain_by_score else 1.0)
        self._tracks.change_existence(row, gain)
        if track.pending > self.config.renewal * len(track.buffer):
            self._refresh_shape(row)
            if self.config.combine == "overlapping":
                row = self._merge_overlapping(row)
        number = self._tracks.objects[row].id
        self._observed.add(number)
        self._met += [(self._tracks.objects[one].id, number) for one in known[:1]]
        return number

    def _most_alike(self, matches: Rows, evidence: Evidence) -> int:
        """Return the best match, or one more like the shape that is surely another object.

        The track of a chair that once reached over the next one, too, holds all of both.
        """
        shapes, objects = self._tracks.shapes, self._tracks.objects
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
            track = self._touch(row)
            track.buffer.merge(self._tracks.objects[other].buffer for other in others)
            track.pending = len(track.buffer)
            for other in others:
                self._transfer_co_occurrences(self._tracks.objects[other], track)
            self._tracks.misses[row] += self._tracks.misses[others].sum()
            existence, spared = self._tracks.existence[others], self._tracks.spared[others]
            self._tracks.change_existence(row, float(existence.sum()), float(spared.sum()))
            self._tracks.remove(others)
            (row,) = self._tracks.rows_of([track.id])
        return row

    def _merge_overlapping(self, row: int) -> int:
        """Merge a track with those that its fused shape matches, until there are none."""
        while True:
            shape, class_ = self._tracks.shapes.polygons[row], int(self._tracks.shapes.classes[row])
            matches = self._associate(shape, class_, self._tracks.shapes, self.config)
            matches = [one for one in matches if one == row or self._takes_evidence(one)]
            if len(matches) > 1 and self.config.exclusive:
                matches = [one for one in matches if one == row or self._are_one(row, one)]
            if len(matches) > 1 and self._edited:
                matches = self._merge_rules().mergeable(matches)
                matches = matches if row in matches else []
            if len(matches) <= 1:  # it matches itself
                return row
            row = self._merge(matches)
            self._refresh_shape(row)

    def _are_one(self, row: int, match: int) -> bool:
        """Return whether a track and one that it matches may be one object."""
        return not self._is_remembered(match) and self._merge_rules().are_one(row, match)

    def _merge_rules(self) -> MergeRules:
        tracks = PublishedTracks(self._tracks, self.config, self.is_free, self._edited)
        return MergeRules(tracks, self._observed)

    def _may_be(self, row: int) -> bool:
        """Return whether a track may exist: not if it was deleted by hand."""
        return not (self._edited and self._tracks.objects[row].is_deleted)

    def _takes_evidence(self, row: int) -> bool:
        """Return whether a track takes this drive's evidence: of earlier ones, only edited ones."""
        return self._tracks.objects[row].id >= self._tracks.first_id or self._is_edited(row)

    def _is_edited(self, row: int) -> bool:
        return self._edited and self._tracks.objects[row].by_hand is not None

    def _is_remembered(self, row: int) -> bool:
        """Return whether a track is gone, and kept only because its object may be elsewhere."""
        return self.config.moves and self._tracks.existence[row] <= self.config.forget_below

    def _is_there(self, row: int) -> bool:
        """Return whether a track may exist and is not gone."""
        return self._may_be(row) and self._tracks.existence[row] > self.config.forget_below

    def _count_co_occurrences(self) -> None:
        """Count the co-occurrences of tracks of one class in this frame."""
        shown = [self._touch(row) for row in self._tracks.rows_of(self._observed)]
        for track in shown:
            for other in shown:
                if other is not track and other.name == track.name:
                    track.co_occurrences[other.id] += 1
        for number, own in self._met:  # a known object, and others of its class beside it
            for row in self._tracks.rows_of([number]):
                known = self._touch(row)
                for other in shown:
                    if other.name == known.name and other.id not in (own, number):
                        known.co_occurrences[other.id] += 1
                        other.co_occurrences[number] += 1

    def _transfer_co_occurrences(self, merged: Track, kept: Track) -> None:
        """Move the co-occurrences of a merged track to the one that is kept, on both sides."""
        kept.co_occurrences.update(merged.co_occurrences)
        for row in self._tracks.rows_of(merged.co_occurrences):
            neighbor = self._touch(row)
            neighbor.co_occurrences[kept.id] += neighbor.co_occurrences.pop(merged.id)
        del kept.co_occurrences[kept.id]  # from frames that showed both

    def _forget_co_occurrences(self, pruned: Track) -> None:
        """Drop the co-occurrences with a pruned track."""
        for row in self._tracks.rows_of(pruned.co_occurrences):
            self._touch(row).co_occurrences.pop(pruned.id)

    def _refresh_shape(self, row: int) -> None:
        """Fuse a track's shape from its evidence."""
        track = self._touch(row)
        if track.by_hand is None or track.by_hand.shape is None:
            self._tracks.shapes.replace(row, self._fuse(track.buffer, self.config))
        if self.config.sight == "rays" or self.config.contested > 0:
            self._tracks.shapes.heights[row] = track.buffer.heights()
        track.pending = 0

    def _note_gone(self, stamp: float) -> None:
        """Note the stamp since which each track is gone."""
        self._note_times()
        is_gone = self._tracks.existence <= GONE
        was_there = np.isnan(self._tracks.times[:, 3])
        for row in (is_gone == was_there).nonzero()[0].tolist():
            self._touch(row).gone_since = stamp if is_gone[row] else None

    def _follow_moves(self, stamp: float = math.inf) -> None:
        """Give moved objects, which appear as new tracks, their old ids.

        Args:
            stamp: of the newest frame [s]; infinite if there is none since the last call.
        """
        self._note_times()
        for move in find_moves(self._tracks, self.config, stamp):
            (row,), (other,) = (self._tracks.rows_of([n]) for n in (move.gone, move.there))
            self._observed = {move.gone if n == move.there else n for n in self._observed}
            self.shown = [(one, move.gone if n == move.there else n) for one, n in self.shown]
            if self._is_in_place(row, other):
                self._rejoin(row, other)
                continue
            track, there = self._touch(row), self._touch(other)
            self._forget_co_occurrences(track)
            track.co_occurrences.clear()
            self._transfer_co_occurrences(there, track)
            track.buffer = there.buffer.since(track.buffer.first_seen)
            track.pending, track.moved = there.pending, move.confidence
            track.moved_since = there.buffer.surely_there[0]
            track.gone_since = None
            shapes = self._tracks.shapes
            shapes.replace(row, shapes.polygons[other])
            shapes.heights[row] = shapes.heights[other]
            for column in (self._tracks.existence, self._tracks.spared, self._tracks.misses):
                column[row] = column[other]
            self._tracks.remove([other])

    def _is_in_place(self, row: int, other: int) -> bool:
        """Return whether two tracks are so near that poses may be off by as much."""
        centers = [self._tracks.shapes.polygons[one].geometry.centroid for one in (row, other)]
        return bool(shapely.distance(*centers) < MIN_MOVED)

    def _rejoin(self, row: int, other: int) -> None:
        """Add the evidence of a new track to the one that is in its place, or was."""
        track, there = self._touch(row), self._touch(other)
        track.buffer.merge([there.buffer])
        track.pending, track.gone_since = len(track.buffer), None
        self._transfer_co_occurrences(there, track)
        existence, spared = self._tracks.existence, self._tracks.spared
        self._tracks.change_existence(row, max(0.0, -float(existence[row])))
        self._tracks.change_existence(row, float(existence[other]), float(spared[other]))
        self._tracks.remove([other])
        (row,) = self._tracks.rows_of([track.id])
        self._refresh_shape(row)

    def _note_times(self) -> None:
        """Update the stamps of the tracks that have changed since the last call."""
        if self._outdated:
            self._tracks.note_times(self._tracks.rows_of(self._outdated))
            self._outdated.clear()

    def _touch(self, row: int) -> Track:
        """Return a track that is about to change, and keep a copy from before this frame."""
        track = self._tracks.objects[row]
        self._outdated.add(track.id)
        if self._touched is not None and track.id not in self._touched:
            self._touched[track.id] = track, track.copy()
        return track
