"""Large files next to a map, in a folder named after it; each is named by the hash of its content.

So a file never changes: it is written before the map that names it, and all maps saved before still
find theirs.
"""

from __future__ import annotations

import hashlib
import logging
import os
import re
import stat
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import BinaryIO

from hypermap.core.errors import HypermapError
from hypermap.core.notes import Attachment, Note
from hypermap.formats.atomic import file_beside, make_folder, refuse_link_out

logger = logging.getLogger(__name__)

_ENDING = ".media"
_PIECE = 1 << 20  # bytes
_HASH = re.compile(r"[0-9a-f]{64}")
_UNFIT = re.compile(r"[^\w .()-]")  # in names of files


def folder_beside(path: Path) -> str:
    """Return the name of the folder for the large files of a map.

    >>> folder_beside(Path("maps/office.hmap"))
    'office.hmap.media'
    """
    return path.name + _ENDING


def put_beside(folder: Path, files: Iterable[Attachment]) -> None:
    """Copy files into a folder, which is made for the first one; those that are there stay.

    A file that was next to the map already, and is missing there, is logged.

    Raises:
        FileMissing: If a file that was attached is not there any more.
        HypermapError: If it has changed since, the copy cannot be written, or a link is there.
    """
    for each in files:
        target = folder / each.sha256
        if _is_whole(target, each.size):
            continue
        if not each.is_there and is_kept(each):
            logger.warning("%s is missing: the attached file %r", each.content, each.name)
            continue
        make_folder(folder, parents=False)
        refuse_link_out(target, folder)
        copy_to(target, each)


def _is_whole(path: Path, size: int) -> bool:
    """Return whether there is a regular file of a size."""
    try:
        status = path.stat()
    except OSError:  # also where nobody may look
        return False
    return stat.S_ISREG(status.st_mode) and status.st_size == size


def _holds(path: Path, attachment: Attachment) -> bool:
    """Return whether a file has the content of an attachment."""
    if not _is_whole(path, attachment.size):
        return False
    digest = hashlib.sha256()
    try:
        with path.open("rb") as file:
            while piece := file.read(_PIECE):
                digest.update(piece)
    except OSError:
        return False
    return digest.hexdigest() == attachment.sha256


def is_kept(attachment: Attachment) -> bool:
    """Return whether a file is next to a map already, or was."""
    content = attachment.content
    return isinstance(content, Path) and content.name == attachment.sha256


def copy_to(target: Path, attachment: Attachment) -> None:
    """Write the content of an attachment to a file, wholly or not at all, piece by piece.

    Raises:
        FileMissing: If it is not there.
        HypermapError: If it has changed since it was attached, or cannot be written.
    """
    with attachment.open() as source, file_beside(target) as temporary, temporary.open("wb") as to:
        if _copied(source, to) != attachment.sha256:
            where = attachment.content if isinstance(attachment.content, Path) else attachment.name
            raise HypermapError(f"{where}: the file has changed since it was attached")


def export_files(notes: Iterable[Note], folder: Path) -> list[Path]:
    """Write the files attached to notes into a folder, and return their paths.

    They get the names that people know, with the id of the note in front, without what could lead
    elsewhere. A file that was next to the map and is missing there is logged and left out.

    Raises:
        HypermapError: If a file cannot be written, or is there already with another content.
    """
    make_folder(folder)
    written: list[Path] = []
    for note in notes:
        for name, each in zip(_names(note), note.attachments, strict=True):
            if not each.is_there:
                logger.warning("%s is missing: the attached file %r", each.content, each.name)
                continue
            target = folder / name
            if not os.path.lexists(target):
                copy_to(target, each)
            elif not _holds(target, each):
                raise HypermapError(
                    f"{target}: already exists with different content; export to another folder"
                )
            written.append(target)
    return written


def unused_beside(folder: Path, used: Iterable[Attachment]) -> list[Path]:
    """Return the files in a folder next to a map to which no note refers any more.

    Raises:
        HypermapError: If the folder is a link, as the files of another program may be there.
    """
    if folder.is_symlink():
        raise HypermapError(f"{folder}: is a link, so nothing in it is deleted")
    names = {each.sha256 for each in used}
    if not folder.is_dir():
        return []
    found = (path for path in folder.iterdir() if _HASH.fullmatch(path.name))
    return sorted(path for path in found if path.name not in names)


def _copied(source: BinaryIO, target: BinaryIO) -> str:
    """Copy a file, and return the SHA-256 of what was copied."""
    digest = hashlib.sha256()
    while piece := source.read(_PIECE):
        digest.update(piece)
        target.write(piece)
    return digest.hexdigest()


def _names(note: Note) -> Sequence[str]:
    """Return a different name for each file of a note."""
    names: list[str] = []
    for number, each in enumerate(note.attachments, 1):
        name = _UNFIT.sub("_", each.name).lstrip(". ") or "file"
        full = f"{note.id}-{name}"
        names.append(f"{note.id}-{number}-{name}" if full in names else full)
    return names
