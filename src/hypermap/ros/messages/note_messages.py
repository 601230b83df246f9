"""Notes as messages and back."""

from __future__ import annotations

from hypermap.core.errors import NoteError
from hypermap.core.notes import Attachment
from hypermap.notes import FoundNote, attachment_of_bytes
from hypermap.notes.on_map import point_of
from hypermap.ros.messages.geometry_messages import Types, octets, point, polygons_of
from hypermap.ros.messages.semantic_messages import polygon_with_holes
from hypermap.ros.port import Message

MOST_CONTENT = 4_000_000
"""Size of the largest file whose content is in a message [bytes]."""


def note_message(found: FoundNote, types: Types, *, with_content: bool) -> Message:
    """Return a note as `hypermap_msgs/Note`, in the frame that it has."""
    note = found.note
    area = polygons_of(note.place) if note.place.area > 0 else []
    return types.message("hypermap_msgs/Note")(
        id=note.id,
        layer=found.layer,
        title=note.title,
        text=note.text,
        author=note.author,
        time=note.time.isoformat(),
        position=point(*point_of(note), types),
        area=[polygon_with_holes(part, types) for part in area],
        links=list(note.links),
        files=[_file_message(each, types, with_content) for each in note.attachments],
    )


def attachment_of_message(message: Message) -> Attachment:
    """Return the file in a `hypermap_msgs/NoteFile`.

    Raises:
        NoteError: If it cannot be attached, or is too large for a message.
    """
    content = bytes(message.content)
    if len(content) > MOST_CONTENT:
        raise NoteError(
            f"{message.name}: a message can contain files of at most {MOST_CONTENT} bytes"
        )
    return attachment_of_bytes(content, str(message.name))


def _file_message(each: Attachment, types: Types, with_content: bool) -> Message:
    content = b""
    if with_content and each.size <= MOST_CONTENT and each.is_there:
        with each.open() as file:
            content = file.read()
    file_class = types.message("hypermap_msgs/NoteFile")
    return file_class(
        name=each.name,
        media_type=each.media_type,
        size=each.size,
        sha256=each.sha256,
        content=octets(file_class, content),
    )
