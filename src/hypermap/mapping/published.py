"""Which tracks are published, and how: the objects of a semantic layer, with their evidence."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import BoolArray
from hypermap.core.embeddings import Embeddings
from hypermap.core.objects import ObjectTable
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.history.differences import MOVE
from hypermap.mapping.class_posterior import one_class_per_place
from hypermap.mapping.completion import FreeShare, completed
from hypermap.mapping.contested import own_floor
from hypermap.mapping.doubles import without_doubles
from hypermap.mapping.evidence_buffer import EvidenceBuffer
from hypermap.mapping.evidence_table import lazy_evidence_table
from hypermap.mapping.fusion import FUSIONS, votes
from hypermap.mapping.landmarks import landmark_moves
from hypermap.mapping.misnamed_parts import without_misnamed_parts
from hypermap.mapping.parts import joined_parts
from hypermap.mapping.probability import probability
from hypermap.mapping.stages import EvidenceConfig
from hypermap.mapping.tracks import TrackTable, are_two
from hypermap.mapping.votes import votes_at

_BEYOND_DOUBT = 10.0  # objects with more existence than this are always probable
_OFTEN_MISSED = 0.5  # least probability of those that are in the map although they are often missed


@dataclass(frozen=True, eq=False)
class PublishedTracks:
    """The tracks of an evidence map, as users of the map see them; it changes none of them.

    Attributes:
        tracks: all tracks.
        config: which of them are published, and with which footprints.
        is_free: returns the known free share of an area; None if nothing is known.
        is_edited: whether people have edited any track.
    """

    tracks: TrackTable
    config: EvidenceConfig
    is_free: FreeShare | None
    is_edited: bool

    def rows(self) -> list[int]:
        """Return the rows of the tracks that are published."""
        is_published: BoolArray = self.tracks.existence > self.config.publish_above
        for row in np.flatnonzero(is_published).tolist():
            is_published[row] = self.is_probable(row)
        if self.is_edited:
            edits = [track.by_hand for track in self.tracks.objects]
            is_published |= [edit is not None for edit in edits]
            is_published &= [edit is None or not edit.is_deleted for edit in edits]
        rows: list[int] = np.flatnonzero(is_published).tolist()
        return rows

    def is_probable(self, row: int) -> bool:
        """Return whether mapping would publish a track: enough existence, and probable enough."""
        existence, least = self.tracks.existence.item(row), self.config.min_probability
        if not existence > self.config.publish_above or least == 0:
            return existence > self.config.publish_above
        is_sure = existence - self.tracks.spared.item(row) > self.config.publish_above
        if is_sure and existence > _BEYOND_DOUBT:
            return True
        return self._probability(row) >= (least if is_sure else max(least, _OFTEN_MISSED))

    def _probability(self, row: int) -> float:
        shape = self.tracks.shapes.polygons[row]
        existence = float(self.tracks.existence[row])
        return probability(existence, self.tracks.objects[row].buffer, shape)

    def objects(self, ids: Collection[int] | None = None) -> list[SemanticObject]:
        """Return the objects with these ids, or all; see `EvidenceMap.objects`."""
        rows = self.rows()
        if ids is not None:
            return [self._published(row) for row in rows if self.tracks.objects[row].id in ids]
        tracks = self.tracks.objects
        if self.config.landmarks and self.config.fusion == "votes":
            shifts = landmark_moves([track.buffer for track in tracks])
            found = [self._published(row, shifts[row]) for row in rows]
            if any(shift.any() for shift in shifts):
                found = self._without_doubles(found)
        else:
            shifts = [np.zeros((len(track.buffer), 2)) for track in tracks]
            found = [self._published(row) for row in rows]
        found = self._on_own_floor(self._joined(found), found, shifts)
        if self.config.slip >= 1:
            return found
        edited = self.tracks.hand_edits()
        return without_misnamed_parts(one_class_per_place(found, self.config.slip, edited), edited)

    def _joined(self, found: list[SemanticObject]) -> list[SemanticObject]:
        """Return the objects with parts of one joined; see `joined_parts`.

        What people have renamed stays whole: it takes in its parts, but nothing takes it in.
        """
        if self.config.max_growth == math.inf:
            return found
        edits = self.tracks.hand_edits()
        fixed = {n for n, edit in edits.items() if edit.is_deleted or edit.shape is not None}
        names = {item.id: item.name for item in found if item.id in edits}
        mapped = {track.id: track.name for track in self.tracks.objects if track.id in names}
        found = [replace(i, name=mapped[i.id]) if i.id in mapped else i for i in found]

        def may_be_one(one: int, other: int) -> bool:
            return other not in edits and self._may_be_one(one, other)

        joined = joined_parts(found, may_be_one, self.config.max_growth, fixed)
        return [replace(i, name=names[i.id]) if i.id in names else i for i in joined]

    def _without_doubles(self, found: list[SemanticObject]) -> list[SemanticObject]:
        """Return the objects without second ones in the same places; see `without_doubles`."""
        edited = self.tracks.hand_edits()
        return without_doubles(found, self._may_be_one, self.config.min_overlap, edited)

    def _on_own_floor(
        self,
        joined: list[SemanticObject],
        found: list[SemanticObject],
        shifts: Sequence[NDArray[np.float64]],
    ) -> list[SemanticObject]:
        """Return the objects, of which no two share floor; see `own_floor`.

        Args:
            joined: the objects.
            found: the same before parts were joined; what has taken in others does not change.
            shifts: translations of the evidence of each track [m], shapes (N, 2).
        """
        if not (self.config.exclusive and self.config.fusion == "votes"):
            return joined
        buffers = {
            track.id: (track.buffer, shift)
            for track, shift in zip(self.tracks.objects, shifts, strict=True)
        }

        def votes_of(one: int, points_xy: NDArray[np.float64]) -> NDArray[np.float64]:
            buffer, shift = buffers[one]
            return votes_at(buffer, self.config, shift, points_xy)

        as_found = set(map(id, found))
        whole = {item.id for item in joined if id(item) not in as_found}
        fixed = whole.union(self.tracks.hand_edits())
        own = own_floor(joined, self._may_be_one, votes_of, self.config.vote_share, fixed)
        return [
            replace(item, footprint=self._completed(own[item.id], item.name, buffers[item.id][0]))
            if item.id in own
            else item
            for item in joined
        ]

    def _may_be_one(self, one: int, other: int) -> bool:
        """Return whether two ids may be one object: not if many frames show both tracks."""
        first, second = (self.tracks.objects[row] for row in self.tracks.rows_of((one, other)))
        return not are_two(first, second, fewest=0)

    def summary(self) -> list[tuple[int, int, float, float]]:
        """Return what `EvidenceMap.summary` does."""
        objects, existence = self.tracks.objects, self.tracks.existence
        buffers = ((row, objects[row].id, objects[row].buffer) for row in self.rows())
        return [
            (number, buffer.count, buffer.last_seen, float(existence[row]))
            for row, number, buffer in buffers
        ]

    def layer(
        self, name: str, frame_id: str, wanted: Collection[int] | None = None
    ) -> SemanticLayer:
        """Return `objects` as a layer, with their evidence.

        Args:
            name: of the layer.
            frame_id: its frame.
            wanted: ids of the objects, which take in their parts of other ids; None for all.
        """
        if wanted is None:
            objects = self.objects()
        else:
            whole = self._joined([self._published(row) for row in self.rows()])
            objects = [item for item in whole if item.id in wanted]
        ids = {item.id for item in objects}
        kept = {o.id: tuple(o.buffer.items) for o in self.tracks.objects if o.id in ids}
        table, evidence = ObjectTable.of(objects), lazy_evidence_table(kept)
        next_id = self.tracks.next_id
        layer = SemanticLayer.of_table(name, frame_id, table, evidence=evidence, next_id=next_id)
        pictures = {track.id: track.buffer.pictures for track in self.tracks.objects}
        layer.kept_pictures = {n: kept for n, kept in pictures.items() if kept and n in ids}
        looks = {t.id: t.buffer.embedding for t in self.tracks.objects if t.id in ids}
        layer.kept_embeddings = Embeddings.of({n: e for n, e in looks.items() if e is not None})
        return layer

    def footprint(self, row: int, shifts: NDArray[np.float64] | None = None) -> BaseGeometry:
        """Return a track's footprint as it is published.

        Args:
            row: of the track.
            shifts: translations applied to its evidence first [m], shape (N, 2); None for none.
        """
        track = self.tracks.objects[row]
        # The stale shape stays: a query must not change the map.
        if shifts is not None and shifts.any():
            fused = votes(track.buffer, self.config, shifts)
        elif track.pending > 0:
            fused = FUSIONS[self.config.fusion](track.buffer, self.config)
        else:
            fused = self.tracks.shapes.polygons[row]
        return self._completed(fused.geometry, track.name, track.buffer)

    def _completed(self, shape: BaseGeometry, name: str, buffer: EvidenceBuffer) -> BaseGeometry:
        """Return a shape with what was not seen of it, if the configuration says so."""
        if self.config.completion != "class_depth":
            return shape
        cameras_xy = np.array([item.map_T_camera[:2, 3] for item in buffer.items])
        return completed(shape, name, cameras_xy, self.is_free, self.config.class_depths)

    def _published(self, row: int, shifts: NDArray[np.float64] | None = None) -> SemanticObject:
        """Return a track as users of the map see it, its footprints moved by `shifts`."""
        track = self.tracks.objects[row]
        buffer, edit = track.buffer, track.by_hand
        if edit is not None and edit.drawn is not None:
            return edit.drawn
        z_min, z_max = buffer.heights()
        attributes: dict[str, Any] = {"evidence": buffer.count, "z_min": z_min, "z_max": z_max}
        if track.moved is not None:
            attributes[MOVE] = {"confidence": round(track.moved, 3)}
            if track.moved_since is not None:  # unknown in files of earlier versions
                attributes[MOVE]["since"] = track.moved_since
        found = SemanticObject(
            name=track.name,
            footprint=self.footprint(row, shifts),
            id=track.id,
            tags=(track.name,),
            confidence=(self._confidence(row),),
            existence=float(self.tracks.existence[row]),
            first_seen=buffer.first_seen,
            last_seen=buffer.last_seen,
            attributes=attributes,
        )
        return found if edit is None else edit.applied_to(found)

    def _confidence(self, row: int) -> float:
        """Return the confidence of a track, 0..1: its probability, or the mean score."""
        buffer = self.tracks.objects[row].buffer
        if self.config.confidence == "score":
            return buffer.score_sum / buffer.count
        return self._probability(row)
