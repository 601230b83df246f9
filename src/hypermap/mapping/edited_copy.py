"""Takes over what people have changed in a saved copy of a map that is still being mapped."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import replace

from hypermap.core.hypermap import Hypermap
from hypermap.formats.backup import BY_HAND
from hypermap.mapping.by_hand import HandEdit
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.frame_log import FrameLog
from hypermap.mapping.going_on import edits_of, layer_of_objects, state_of
from hypermap.mapping.mapper import Mapper
from hypermap.mapping.merging.moving import renumbered
from hypermap.mapping.tracks import TrackTable


def take_edits(mapper: Mapper, edited: Hypermap) -> None:
    """Let mapping go on with the edits in a copy of its map, as `Mapper.onto` would.

    What was mapped since the copy was saved stays. Other layers, transforms and metadata become
    those of the copy.

    Args:
        mapper: mapping.
        edited: its map, as it was saved at some time and changed since; is not changed.

    Raises:
        CannotGoOn: If the state of the mapper or the semantic layer is not in the copy.
    """
    state = state_of(edited, mapper.config)
    edits = edits_of(edited, state, mapper.config.evidence)
    earlier = mapper.evidence.hand_edits()
    known = {track.id for track in state.tracks.objects if track.by_hand is not None}
    kept = {number: edit for number, edit in earlier.items() if number not in known}
    if edits or earlier:
        _edit(mapper.evidence, {**kept, **edits}, edited)
    mapper.go_on_in(edited, FrameLog(state.log))


def _edit(evidence: EvidenceMap, edits: Mapping[int, HandEdit], edited: Hypermap) -> None:
    settled, layer = evidence.settled(), layer_of_objects(edited)
    found: dict[int, HandEdit] = {}
    for number, edit in edits.items():
        if settled.rows_of([number]) or edit.is_deleted or edit.drawn is not None:
            found[number] = edit
        elif layer is not None and number in layer:  # it is one with another by now
            item = layer.get(number)
            attributes = {**item.attributes, BY_HAND: ["drawn"]}
            found[number] = HandEdit(drawn=replace(item, attributes=attributes))
    drawn = [number for number, edit in found.items() if edit.drawn is not None]
    evidence.go_on_with(_with_free_ids(evidence.tracks(), drawn), found)


def _with_free_ids(tracks: TrackTable, drawn: Collection[int]) -> TrackTable:
    """Return tracks of which none of this drive has the id of what people have drawn since."""
    objects = tracks.objects
    rows = [row for row in tracks.rows_of(drawn) if objects[row].by_hand is None]
    own = [objects[row].id for row in rows if objects[row].id >= tracks.first_id]
    free = max([tracks.next_id, *(number + 1 for number in drawn)])
    ids = {track.id: track.id for track in objects}
    ids |= {number: free + place for place, number in enumerate(own)}
    order = sorted(range(len(objects)), key=lambda row: ids[objects[row].id])
    found = [renumbered(objects[row], ids[objects[row].id]) for row in order]
    for track in found:
        counts = {ids[n]: count for n, count in track.co_occurrences.items() if n in ids}
        track.co_occurrences = Counter(counts)
    return tracks.of_tracks(found, order)
