"""The evidence map: observed shapes become tracks, whose existence rises and falls.

Source: section 3.4.5 of the thesis of 2019 for the profile "thesis"; docs/mapping.md describes
both profiles.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Collection, Mapping

from hypermap.core.embeddings import Embedding
from hypermap.core.pictures import ObjectPicture
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.mapping.by_hand import HandEdit, are_new
from hypermap.mapping.changing_tracks import ChangingTracks
from hypermap.mapping.class_sizes import is_usual
from hypermap.mapping.completion import FreeShare
from hypermap.mapping.earlier_drives import EarlierDrives
from hypermap.mapping.evidence_buffer import (
    STALE,
    Evidence,
    FoundEvidence,
    SeenColor,
    evidence_from,
)
from hypermap.mapping.followed_moves import follow_moves, note_gone
from hypermap.mapping.frame_update import FrameUpdate
from hypermap.mapping.missed_detections import penalize_missed, prune
from hypermap.mapping.protection import protected
from hypermap.mapping.published import PublishedTracks
from hypermap.mapping.stages import EvidenceConfig
from hypermap.mapping.tracks import TrackTable
from hypermap.perception.observation import Observation, ObservedObject
from hypermap.perception.paint import Rgb

_log = logging.getLogger(__name__)


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
        self._tracks = ChangingTracks(config)
        self._earlier = EarlierDrives(config)
        self._settled: TrackTable | None = None  # the tracks, one per object; None if unknown
        self._newest = -math.inf  # stamp of the last frame

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
        ignored, newest = self.ignored, self._newest
        try:
            with self._tracks.all_or_nothing():
                self._add_frame(observation, found)
        except BaseException:
            self.ignored, self._newest, self._settled = ignored, newest, None
            raise

    def update_for_good(self, observation: Observation, found: FoundEvidence) -> None:
        """Add one frame as `update` does, but faster: if it fails, this map is of no use."""
        self._add_frame(observation, found)

    def _add_frame(self, observation: Observation, found: FoundEvidence | None) -> None:
        if self.config.moves:
            self._begin_drive(observation.stamp)
        self._settled = None
        self.shown = []
        if found is None:
            found = evidence_from(observation, self.config.abstain)
        if len(found) < len(observation.objects):
            self.ignored += len(observation.objects) - len(found)
            _log.info("frame %.6f: skipped shapes without area", observation.stamp)
        if self.config.class_sizes == "usual":
            found = [(item, one) for item, one in found if is_usual(item.name, one)]
        frame = FrameUpdate(self._tracks, self.is_free)
        numbers = frame.add(found)
        penalize_missed(self._tracks.table, observation, frame.observed, self.config)
        for track in prune(self._tracks.table, self.config):
            self._tracks.forget_co_occurrences(track)
        moved: dict[int, int] = {}
        if self.config.moves:
            note_gone(self._tracks, observation.stamp)
            moved = follow_moves(self._tracks, observation.stamp)
        numbers = [moved.get(number, number) for number in numbers]
        self.shown = [(item, number) for (item, _), number in zip(found, numbers, strict=True)]

    def _begin_drive(self, stamp: float) -> None:
        """Let the frame with a stamp [s] begin another drive, if it is long after the last one."""
        is_another = abs(stamp - self._newest) > STALE and len(self._tracks.table.objects) > 0
        self._newest = stamp
        if is_another:
            self.begin_drive()

    def begin_drive(self) -> None:
        """Let the next frame begin another drive, however soon it comes."""
        self._tracks.begin_drive(self.settled().snapshot())
        self._earlier.begin_drive()
        self._settled = None

    def settled(self) -> TrackTable:
        """Return the tracks, those of this drive joined to the known ones; must not be changed."""
        if self._settled is None:
            self._tracks.note_times()
            self._settled = self._earlier.settled(self._tracks.table)
        return self._settled

    def apart(self) -> frozenset[int]:
        """Return the ids of known tracks to whose pictures and embeddings this drive adds some."""
        own = {track.id: track.buffer for track in self._tracks.table.objects}
        looks = ((one.id, one.buffer) for one in self.settled().objects)
        return frozenset(
            number
            for number, buffer in looks
            if buffer.pictures is not own[number].pictures
            or buffer.embedding is not own[number].embedding
        )

    def _as_published(self) -> PublishedTracks:
        return PublishedTracks(self.settled(), self.config, self.is_free, self._tracks.are_edited)

    def tracks(self) -> TrackTable:
        """Return a copy of all tracks, which later frames do not change.

        Those of this drive are not joined to the known ones yet; see `settled`.
        """
        self._tracks.note_times()
        return self._tracks.table.snapshot()

    def go_on_with(self, tracks: TrackTable, by_hand: Mapping[int, HandEdit] | None = None) -> None:
        """Take over the tracks of an evidence map with the same configuration.

        Args:
            tracks: of that map; this one owns them from now on.
            by_hand: edits made by hand, by the objects' ids.
        """
        if are_new(by_hand or {}, tracks.hand_edits()):  # people have edited what they saw
            tracks = self._earlier.settled(tracks)
        self._tracks.go_on_with(protected(tracks, by_hand or {}, self.config))
        self._earlier.begin_drive()
        self._settled, self._newest = None, self._tracks.table.last_stamp()
        if self.config.moves:
            follow_moves(self._tracks)

    def hand_edits(self) -> dict[int, HandEdit]:
        """Return the edits made by hand, by the objects' ids."""
        return self._tracks.table.hand_edits()

    def objects(self, ids: Collection[int] | None = None) -> list[SemanticObject]:
        """Return the objects with enough existence, in the order of their ids.

        An object keeps its id between calls. Merged objects keep the oldest id.

        Args:
            ids: only these; None for all. Only with None are objects landmarks for each other
                (`landmarks`), parts of one joined, do no two share floor (`exclusive`), and is
                there one class per place (`slip`).
        """
        return self._as_published().objects(ids)

    def summary(self) -> list[tuple[int, int, float, float]]:
        """Return the id, the number of pieces of evidence, their last stamp and the existence.

        Of each object; this is fast. An object's shape changes only when its evidence does: when
        one of these numbers does, as what was moved may have as many pieces as before.
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
        ids = {number for number, *_ in published.summary()}
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
        rows = self._tracks.table.rows_of([object_id])
        return self._tracks.table.objects[rows[0]].buffer.pictures if rows else ()

    def class_of(self, object_id: int) -> str:
        """Return the class of an object; empty if its track was removed."""
        rows = self._tracks.table.rows_of([object_id])
        return self._tracks.table.objects[rows[0]].name if rows else ""

    def keep_pictures(self, object_id: int, pictures: tuple[ObjectPicture, ...]) -> None:
        """Replace the pictures of an object, if its track still exists."""
        self._settled = None
        for row in self._tracks.table.rows_of([object_id]):
            self._tracks.table.objects[row].buffer.pictures = pictures

    def lacks_colors(self, stamp: float) -> bool:
        """Return whether the last frame shows a track with few colors of its drive so far.

        Args:
            stamp: of this frame [s].
        """
        rows = self._tracks.table.rows_of({number for _, number in self.shown})
        return any(self._tracks.table.objects[row].buffer.lacks_colors(stamp) for row in rows)

    def add_colors(self, stamp: float, colors: Mapping[ObservedObject, Rgb | None]) -> None:
        """Add the colors of objects that the last frame shows, which has this stamp [s].

        None, for an object of several colors, counts as one, so that it is not looked for forever.
        """
        self._settled = None
        for observed, number in self.shown if colors else ():
            for row in self._tracks.table.rows_of([number]) if observed in colors else ():
                track = self._tracks.table.objects[row]
                # Another name was misclassified.
                if track.name == observed.name and track.buffer.lacks_colors(stamp):
                    self._tracks.touch(row).buffer.add_color(SeenColor(stamp, colors[observed]))

    def add_embedding(self, object_id: int, embedding: Embedding) -> None:
        """Add the embedding of a view of an object, if its track still exists."""
        self._settled = None
        for row in self._tracks.table.rows_of([object_id]):
            buffer = self._tracks.table.objects[row].buffer
            buffer.embedding = embedding.plus(buffer.embedding)

    def embedding_model(self) -> str | None:
        """Return the name of the encoders that made the embeddings; None if there are none."""
        looks = (track.buffer.embedding for track in self._tracks.table.objects)
        return next((look.model for look in looks if look is not None), None)
