"""The files of notes over HTTP: uploads go to where the map keeps them, answers are inert.

A file may come from anyone who can leave a note. So its type is that of its content, a browser
neither guesses another type nor runs anything in it, and everything but pictures, sounds and videos
is only offered for download.
"""

from __future__ import annotations

import base64
from collections import OrderedDict
from collections.abc import AsyncIterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import quote

from starlette.concurrency import run_in_threadpool
from starlette.responses import FileResponse, Response

from hypermap.core.arrays import as_objects
from hypermap.core.errors import FileMissing, HypermapError
from hypermap.core.frames import Pose2D
from hypermap.core.hypermap import Hypermap
from hypermap.core.notes import Attachment, Note
from hypermap.core.notes_layer import INSIDE_UP_TO, NotesLayer
from hypermap.formats.atomic import unfinished_file, why_not_written
from hypermap.formats.beside import folder_beside
from hypermap.notes import as_html, attachment_of, attachment_of_bytes, described, find_notes
from hypermap.notes.attach import MAX_BYTES, may_be_shown
from hypermap.notes.media_types import HEAD, media_type_of
from hypermap.notes.on_map import point_of
from hypermap.viewer.live.request_errors import Refused
from hypermap.viewer.live.shapes import Polygons, polygons_in_base

_MOST_UPLOADS = 1000
_LARGEST_EMBEDDED, _MOST_EMBEDDED = 300_000, 20_000_000  # bytes
_POLICY = "sandbox; default-src 'none'"


class Uploads:
    """Files that windows have sent, and that no note may have yet.

    Small ones are in memory. Large ones are next to the map already, under the names that they have
    there; `hypermap notes --tidy` deletes those that no note got in the end.
    """

    def __init__(self) -> None:
        self._kept: OrderedDict[str, Attachment] = OrderedDict()

    @property
    def files(self) -> Mapping[str, Attachment]:
        """The files by their hashes."""
        return self._kept

    async def receive(self, content: AsyncIterator[bytes], name: str, path: Path) -> Attachment:
        """Take a file in, piece by piece.

        Args:
            content: its pieces.
            name: as the person calls it.
            path: of the map.

        Raises:
            NoteError: If it cannot be attached.
            HypermapError: If it cannot be written.
        """
        start = bytearray()
        async for piece in content:
            start += piece
            if len(start) > INSIDE_UP_TO:
                found = await _received_beside(bytes(start), content, name, path)
                break
        else:
            found = await run_in_threadpool(attachment_of_bytes, bytes(start), name)
        self._kept[found.sha256] = found
        while len(self._kept) > _MOST_UPLOADS:
            self._kept.popitem(last=False)
        return found


async def _received_beside(
    start: bytes, rest: AsyncIterator[bytes], name: str, path: Path
) -> Attachment:
    """Write a large file next to the map."""
    folder = path.with_name(folder_beside(path))
    try:
        folder.mkdir(exist_ok=True)
        size = len(start)
        with unfinished_file(folder) as unfinished:
            with unfinished.path.open("wb") as file:
                file.write(start)
                async for piece in rest:
                    size += len(piece)
                    if size > MAX_BYTES:
                        raise Refused(f"{name[:60]}: holds more than {MAX_BYTES >> 30} GB", 413)
                    await run_in_threadpool(file.write, piece)
            found = await run_in_threadpool(attachment_of, unfinished.path, name)
            kept = folder / found.sha256
            await run_in_threadpool(unfinished.become, kept)
    except OSError as error:
        raise HypermapError(f"{folder}: cannot be written: {why_not_written(error)}") from error
    return replace(found, content=kept)


def file_reply(attachment: Attachment) -> Response:
    """Return an attached file as a response that can do no harm.

    Raises:
        Refused: If it was next to the map and is not there.
    """
    try:
        with attachment.open() as file:
            media_type = media_type_of(file.read(HEAD))
    except FileMissing as error:
        raise Refused(str(error), 404) from error
    checked = replace(attachment, media_type=media_type)
    how = "inline" if may_be_shown(checked) else "attachment"
    headers = {
        "Content-Security-Policy": _POLICY,
        "Content-Disposition": f"{how}; filename*=UTF-8''{quote(attachment.name, safe='')}",
        "Cache-Control": "private, max-age=3600",
    }
    if isinstance(attachment.content, Path):
        return FileResponse(attachment.content, media_type=media_type, headers=headers)
    return Response(attachment.content, media_type=media_type, headers=headers)


def attached_file(hypermap: Hypermap, layer: str, number: int, sha256: str) -> Attachment:
    """Return a file of a note.

    Raises:
        LayerNotFound, ObjectNotFound: If there is no such layer or note.
        Refused: If the note has no such file.
    """
    note = hypermap.layer(layer, NotesLayer)[number]
    for each in note.attachments:
        if each.sha256 == sha256:
            return each
    raise Refused(f"note {number} has no such file", 404)


def describe_notes(hypermap: Hypermap) -> list[dict[str, Any]]:
    """Return all notes of a map as the page shows them, in the base frame."""
    return [
        {
            **described(found),
            "html": as_html(found.note.text),
            "polygons": _polygons(found.note),
            "at": list(point_of(found.note)),
            "files": [_file(found.layer, found.note, each) for each in found.note.attachments],
        }
        for found in find_notes(hypermap)
    ]


def embed_notes(hypermap: Hypermap) -> list[dict[str, Any]]:
    """Return all notes for a page in a file: pictures of at most 300 kB, 20 MB in all, in it."""
    notes, room = describe_notes(hypermap), _MOST_EMBEDDED
    held = {each.sha256: each for found in find_notes(hypermap) for each in found.note.attachments}
    for file in (file for note in notes for file in note["files"]):
        del file["url"]  # there is no server
        content = held[file["sha256"]].content
        if file["kind"] != "picture" or not isinstance(content, bytes):
            continue
        if len(content) <= min(_LARGEST_EMBEDDED, room):
            room -= len(content)
            media_type = media_type_of(content[:HEAD])
            file["url"] = f"data:{media_type};base64,{base64.b64encode(content).decode()}"
    return notes


def _polygons(note: Note) -> Polygons:
    """Return the outline of a note's area; nothing for a point."""
    if note.place.area == 0:
        return []
    return polygons_in_base(as_objects([note.place]), Pose2D(), decimals=None)[0]


def _file(layer: str, note: Note, each: Attachment) -> dict[str, Any]:
    return {
        "name": each.name,
        "kind": each.kind if may_be_shown(each) else "file",
        "size": each.size,
        "sha256": each.sha256,
        "is_there": each.is_there,
        "url": f"api/notes/{quote(layer, safe='')}/{note.id}/{each.sha256}",
    }
