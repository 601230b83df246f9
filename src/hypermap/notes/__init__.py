"""Notes with attachments at places on a map: make them, attach files, find them."""

from typing import TYPE_CHECKING, Any

from hypermap._lazy import attribute

if TYPE_CHECKING:
    from hypermap.core.notes import Attachment, Note
    from hypermap.core.notes_layer import NotesLayer
    from hypermap.notes.attach import attachment_of, attachment_of_bytes
    from hypermap.notes.markdown import as_html
    from hypermap.notes.on_map import FoundNote, add_note, described, find_notes, notes_layer

_HOMES = {
    "Attachment": "hypermap.core.notes",
    "FoundNote": "hypermap.notes.on_map",
    "Note": "hypermap.core.notes",
    "NotesLayer": "hypermap.core.notes_layer",
    "add_note": "hypermap.notes.on_map",
    "as_html": "hypermap.notes.markdown",
    "attachment_of": "hypermap.notes.attach",
    "attachment_of_bytes": "hypermap.notes.attach",
    "described": "hypermap.notes.on_map",
    "find_notes": "hypermap.notes.on_map",
    "notes_layer": "hypermap.notes.on_map",
}

__all__ = [
    "Attachment",
    "FoundNote",
    "Note",
    "NotesLayer",
    "add_note",
    "as_html",
    "attachment_of",
    "attachment_of_bytes",
    "described",
    "find_notes",
    "notes_layer",
]


def __getattr__(name: str) -> Any:
    return attribute(__name__, name, _HOMES)
