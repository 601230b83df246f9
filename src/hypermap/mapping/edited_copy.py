"""Takes over what people have changed in a saved copy of a map that is still being mapped."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from hypermap.core.hypermap import Hypermap
from hypermap.formats.backup import BY_HAND
from hypermap.mapping.by_hand import HandEdit
from hypermap.mapping.evidence import EvidenceMap
from hypermap.mapping.going_on import edits_of, layer_of_objects, state_of
from hypermap.mapping.mapper import Mapper
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
    mapper.go_on_in(edited)


def _edit(evidence: EvidenceMap, edits: Mapping[int, HandEdit], edited: Hypermap) -> None:
    tracks, layer = evidence.settled(), layer_of_objects(edited)
    free = max([tracks.next_id, *(number + 1 for number in edits)])
    found: dict[int, HandEdit] = {}
    for number, edit in sorted(edits.items()):
        if edit.drawn is not None and _is_of_mapping(tracks, number):
            found[free] = replace(edit, drawn=replace(edit.drawn, id=free))
            free += 1
        elif tracks.rows_of([number]) or edit.is_deleted or edit.drawn is not None:
            found[number] = edit
        elif layer is not None and number in layer:  # it is one with another by now
            item = layer.get(number)
            attributes = {**item.attributes, BY_HAND: ["drawn"]}
            found[number] = HandEdit(drawn=replace(item, attributes=attributes))
    evidence.go_on_with(evidence.tracks(), found)


def _is_of_mapping(tracks: TrackTable, number: int) -> bool:
    """Return whether there is an object of an id that nobody has drawn, changed or deleted."""
    return any(tracks.objects[row].by_hand is None for row in tracks.rows_of([number]))
