"""Makes attachments of files: their kind is found in their content, and pictures are checked."""

from __future__ import annotations

import hashlib
import io
import os
import stat
import warnings
from pathlib import Path, PurePath
from typing import BinaryIO

from PIL import Image, UnidentifiedImageError

from hypermap.core.errors import FileMissing, HypermapError, NoteError
from hypermap.core.notes import Attachment
from hypermap.core.notes_layer import INSIDE_UP_TO
from hypermap.core.pictures import MOST_SCANS, scans_of
from hypermap.notes.media_types import HEAD, OTHER, claimed_kind, described, media_type_of

MAX_BYTES = 16 << 30
"""Size of an attached file."""

_MOST_PIXELS = 64_000_000
_PIECE = 1 << 20  # bytes
_LONGEST_NAME = 200


def attachment_of(path: str | Path, name: str | None = None) -> Attachment:
    """Return a file as an attachment.

    A file of more than 2 MB is not read into memory: it must stay where it is until the map is
    saved, which copies it.

    Args:
        path: of the file.
        name: as people call it; None takes the name of the file.

    Raises:
        FileMissing: If there is no such file.
        NoteError: If its name says that it is a picture, a sound or a video and its content does
            not, a picture is damaged, or the file is empty or too large.
        HypermapError: If it cannot be read.
    """
    path = Path(path)
    try:
        with os.fdopen(os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0)), "rb") as file:
            status = os.fstat(file.fileno())
            if not stat.S_ISREG(status.st_mode):
                raise NoteError(f"{path}: is not a regular file")
            if status.st_size <= INSIDE_UP_TO:
                return attachment_of_bytes(file.read(INSIDE_UP_TO + 1), name or path.name)
            return _attachment(file, status.st_size, name or path.name, path.absolute())
    except FileNotFoundError:
        raise FileMissing(f"{path}: there is no such file") from None
    except OSError as error:
        raise HypermapError(f"{path}: cannot be read: {error.strerror}") from error


def attachment_of_bytes(content: bytes, name: str) -> Attachment:
    """Return the content of a file as an attachment; raises like `attachment_of`."""
    return _attachment(io.BytesIO(content), len(content), name, content)


def _attachment(file: BinaryIO, size: int, name: str, content: bytes | Path) -> Attachment:
    name = _plain(name)
    if not 0 < size <= MAX_BYTES:
        much = "is empty" if size == 0 else f"holds {size} bytes; at most {MAX_BYTES} are kept"
        raise NoteError(f"{name}: {much}")
    head = file.read(HEAD)
    media_type = media_type_of(head)
    claim = claimed_kind(name)
    if claim is not None and media_type.partition("/")[0] not in ("image", "audio", "video"):
        raise NoteError(
            f"{name}: its name says that it is a {claim}, but its content is {described(head)}; "
            "to attach it as a file, give it another name"
        )
    if media_type.startswith("image/"):
        file.seek(0)
        _check_picture(file, name, media_type)
    file.seek(0)
    digest = hashlib.sha256()
    while piece := file.read(_PIECE):
        digest.update(piece)
    return Attachment(name, media_type, size, digest.hexdigest(), content)


def _plain(name: str) -> str:
    """Return the last part of a file's name in one line, as people read it."""
    last = PurePath(name.replace("\\", "/")).name
    line = " ".join("".join(c if c.isprintable() else " " for c in last).split())
    return line[-_LONGEST_NAME:] or "file"


def _check_picture(file: BinaryIO, name: str, media_type: str) -> None:
    """Raise a NoteError unless a picture can be shown."""
    if media_type == "image/jpeg":
        if sum(map(scans_of, iter(lambda: file.read(_PIECE), b""))) > MOST_SCANS:
            raise NoteError(f"{name}: the picture has more than {MOST_SCANS} scans; save it again")
        file.seek(0)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about size, which is checked here, and oddities
            with Image.open(file, formats=("PNG", "JPEG", "GIF", "WEBP")) as image:
                pixels = image.width * image.height
                if pixels <= _MOST_PIXELS:
                    image.load()
                    return
    except Image.DecompressionBombError:
        pixels = 2 * _MOST_PIXELS
    except UnidentifiedImageError:  # its message shows our buffer
        raise NoteError(f"{name}: the picture is damaged: its header cannot be read") from None
    except Exception as error:  # the decoders raise nearly anything for damaged files
        raise NoteError(f"{name}: the picture is damaged: {error}") from None
    raise NoteError(
        f"{name}: the picture has more than {_MOST_PIXELS // 1_000_000} megapixels; make it smaller"
    )


def may_be_shown(attachment: Attachment) -> bool:
    """Return whether a browser may show or play the file; all others are for download."""
    return attachment.media_type != OTHER and attachment.kind != "file"
