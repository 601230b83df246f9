"""Edit operations on notes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.core.notes import Attachment, Note, now
from hypermap.core.notes_layer import NotesLayer
from hypermap.viewer.live.changes import Draft
from hypermap.viewer.live.request_errors import Refused
from hypermap.viewer.live.requests import footprint_in, number_in, text_in, whole_number_in

NOTE_KINDS = ("add_note", "update_note", "remove_note")


def apply_to_note(
    draft: Draft, layer: str, operation: Mapping[str, Any], files: Mapping[str, Attachment]
) -> int:
    """Add, change or remove a note, and return its id; the first note makes the layer.

    Args:
        draft: the map.
        layer: of notes.
        operation: `point` or `polygon` in the base frame, `text`, `author`, `links`, and `files`:
            the hashes of all files that the note has.
        files: that were uploaded, by their hashes.

    Raises:
        Refused: If it is incomplete or wrong.
        NoteError: If there can be no such note.
        LayerNotFound, ObjectNotFound: If there is no such layer or note.
    """
    kind = operation["op"]
    if kind == "remove_note":
        number = whole_number_in(operation, "id")
        draft.remove_note(layer, number)
        return number
    if kind == "update_note":
        old = draft.get_note(layer, whole_number_in(operation, "id"))
        held = {each.sha256: each for each in old.attachments}
        changed = _given(draft, layer, operation, {**files, **held})
        return draft.put_note(layer, replace(old, **changed, changed=now()))
    if layer not in draft.hypermap:
        draft.add_notes_layer(layer)
    given = _given(draft, layer, operation, files)
    if "place" not in given:
        raise Refused("a new note needs a point or a polygon")
    return draft.put_note(layer, Note(**given))


def _given(
    draft: Draft, layer: str, operation: Mapping[str, Any], files: Mapping[str, Attachment]
) -> dict[str, Any]:
    """Return what an operation says of a note, its place in the layer's frame."""
    given: dict[str, Any] = {}
    for key in ("text", "author"):
        if operation.get(key) is not None:
            given[key] = text_in(operation, key) or ""
    if operation.get("links") is not None:
        given["links"] = tuple(_texts(operation, "links"))
    if operation.get("files") is not None:
        given["attachments"] = tuple(_attached(one, files) for one in _texts(operation, "files"))
    place = _place(operation)
    if place is not None:
        own = draft.hypermap.layer(layer, NotesLayer)
        layer_T_base = draft.hypermap.frames.lookup(own.frame_id, draft.hypermap.base_frame)
        given["place"] = layer_T_base.apply_geometry(place)
    return given


def _attached(sha256: str, files: Mapping[str, Attachment]) -> Attachment:
    if sha256 not in files:
        raise Refused(f"files: {sha256[:64]!r} was not uploaded, or long ago; upload it again")
    return files[sha256]


def _place(operation: Mapping[str, Any]) -> BaseGeometry | None:
    point = operation.get("point")
    if point is None:
        return footprint_in(operation)
    if not isinstance(point, list) or len(point) != 2:
        raise Refused("point: expected [x, y]")
    x, y = (number_in({"point": value}, "point") for value in point)
    return shapely.Point(x, y)


def _texts(operation: Mapping[str, Any], key: str) -> list[str]:
    texts = operation[key]
    if not isinstance(texts, list) or not all(isinstance(text, str) for text in texts):
        raise Refused(f"{key}: a list of texts is expected")
    return texts
