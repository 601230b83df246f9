"""Notes that people or robots leave at places, and the files attached to them."""

from __future__ import annotations

import io
import re
import stat
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import BinaryIO
from urllib.parse import urlsplit

import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.core.errors import FileMissing, HypermapError, NoteError
from hypermap.core.frames import Pose2D
from hypermap.core.tangles import is_sound

MAX_TEXT_BYTES = 1_000_000
"""Size of a note's text in UTF-8."""

MAX_ATTACHED = 100
"""How many files, and how many links, a note may have."""

_LONGEST_LINE = 200  # letters of a name or an author
_LONGEST_LINK = 2000
_LONGEST_TITLE = 60
_SHA256 = re.compile(r"[0-9a-f]{64}")
_MEDIA_TYPE = re.compile(r"[a-z]+/[a-z0-9.+-]+")
_FAR = 1e9  # meters; farther out, places have no room in a number
_MARKS = re.compile(r"^\s*(?:#{1,6}|>|[-*+]|\d+[.)])\s+|[*_`]|\s+#+\s*$")  # of Markdown


@dataclass(frozen=True)
class Attachment:
    """A file attached to a note.

    Attributes:
        name: for people; never used as a path.
        media_type: by its content, such as "image/png"; "application/octet-stream" for all others.
        size: in bytes.
        sha256: of its content, in hexadecimal digits.
        content: its bytes, or where they are.

    Raises:
        NoteError: If the name is empty, longer than 200 letters or more than a line.
        ValueError: If another part is wrong.
    """

    name: str
    media_type: str
    size: int
    sha256: str
    content: bytes | Path = field(repr=False, compare=False)

    def __post_init__(self) -> None:
        _check_line("the name of a file", self.name)
        if not self.name:
            raise NoteError("an attached file needs a name")
        if not _SHA256.fullmatch(self.sha256) or not _MEDIA_TYPE.fullmatch(self.media_type):
            raise ValueError(f"{self.sha256!r} or {self.media_type!r} is not valid")
        is_whole = isinstance(self.content, Path) or len(self.content) == self.size
        if self.size < 0 or not is_whole:
            raise ValueError(f"the size of the file is not {self.size} bytes")

    @property
    def kind(self) -> str:
        """Its kind: "picture", "sound", "video" or "file"."""
        kinds = {"image": "picture", "audio": "sound", "video": "video"}
        return kinds.get(self.media_type.partition("/")[0], "file")

    @property
    def is_there(self) -> bool:
        """Whether the content can be read: a file next to the map may have been left behind.

        A link in its place does not count, whatever it leads to.
        """
        if isinstance(self.content, bytes):
            return True
        is_beside = self.content.name == self.sha256
        try:
            return stat.S_ISREG(self.content.stat(follow_symlinks=not is_beside).st_mode)
        except OSError:  # also where nobody may look, and for names that no file can have
            return False

    def open(self) -> BinaryIO:
        """Return the content, to be read.

        Raises:
            FileMissing: If it was next to the map and is not there.
            HypermapError: If it cannot be read.
        """
        if isinstance(self.content, bytes):
            return io.BytesIO(self.content)
        if not self.is_there:  # what is not a regular file might never answer
            raise FileMissing(
                f"{self.content}: the attached file {self.name!r} is missing; copy it next to the "
                "map, from where the map was"
            )
        try:
            return self.content.open("rb")
        except OSError as error:
            raise HypermapError(f"{self.content}: cannot be read: {error.strerror}") from error


def now() -> datetime:
    """Return the present time in this computer's zone, to the second."""
    return datetime.now().astimezone().replace(microsecond=0)


@dataclass(frozen=True)
class Note:
    r"""A text, files and links at a place.

    Attributes:
        place: a point or an area, in the frame of the layer [m].
        text: in Markdown; may be empty if something is attached.
        author: who wrote it; may be empty.
        time: when it was written, or the time that it is about, with a time zone.
        attachments: the files.
        links: addresses that begin with http:// or https://.
        id: within its layer; None before it is in one.
        changed: when it was last changed; None if never.

    Raises:
        NoteError: If the place is not a point or area, the text is larger than 1 MB, a link is
            another kind of address, or the note says nothing at all.

    >>> note = Note(shapely.Point(2, 1), "# Loose tile\nDo not drive *here*.", author="Ada")
    >>> note.title
    'Loose tile'
    """

    place: BaseGeometry
    text: str = ""
    author: str = ""
    time: datetime = field(default_factory=now)
    attachments: tuple[Attachment, ...] = ()
    links: tuple[str, ...] = ()
    id: int | None = None
    changed: datetime | None = None

    def __post_init__(self) -> None:
        _check_place(self.place)
        if self.place.has_z:
            object.__setattr__(self, "place", shapely.force_2d(self.place))
        _check_text(self.text)
        _check_line("an author", self.author)
        for moment in (self.time, self.changed):
            if moment is not None and moment.tzinfo is None:
                raise NoteError(f"the time {moment} of a note has no time zone")
        for held, kind in ((self.attachments, "files"), (self.links, "links")):
            if len(held) > MAX_ATTACHED:
                raise NoteError(f"a note has at most {MAX_ATTACHED} {kind}, not {len(held)}")
        for link in self.links:
            _check_link(link)
        if not (self.text.strip() or self.attachments or self.links):
            raise NoteError("a note needs a text, a file or a link")

    @property
    def title(self) -> str:
        """The first line of its text, without the marks of Markdown, or what is attached."""
        lines = filter(None, (_MARKS.sub("", line).strip() for line in self.text.splitlines()))
        attached = (*(each.name for each in self.attachments), *self.links)
        line = " ".join(next(iter((*lines, *attached)), "note").split())
        return line if len(line) <= _LONGEST_TITLE else line[: _LONGEST_TITLE - 1] + "…"

    def with_place(self, place: BaseGeometry) -> Note:
        """Return the note at another place."""
        return replace(self, place=place)

    def moved(self, pose: Pose2D) -> Note:
        """Return the note in another frame, in which the pose is that of the present one."""
        return self.with_place(pose.apply_geometry(self.place))

    def says(self, words: str) -> bool:
        """Return whether each word is in its text, its author or the names of what is attached."""
        attached = (*(each.name for each in self.attachments), *self.links)
        said = "\n".join((self.text, self.author, *attached)).casefold()
        return all(word in said for word in words.casefold().split())


def _check_place(place: BaseGeometry) -> None:
    if not isinstance(place, shapely.Point | shapely.Polygon | shapely.MultiPolygon):
        raise NoteError(f"a note is at a point or in an area, not in a {type(place).__name__}")
    if place.is_empty or not is_sound(place) or (place.geom_type != "Point" and place.area == 0):
        raise NoteError(
            "the place of a note is empty, has an empty hole, or its outline crosses itself"
        )
    if max(map(abs, place.bounds)) > _FAR:
        raise NoteError(f"a note is farther away than {_FAR:g} m")


def _check_text(text: str) -> None:
    try:
        size = len(text.encode())
    except UnicodeEncodeError:
        raise NoteError("the text of a note contains half a character") from None
    if size > MAX_TEXT_BYTES:
        raise NoteError(
            f"the text of a note has {size / 1e6:.1f} MB; at most {MAX_TEXT_BYTES / 1e6:g} MB are "
            "kept: attach it as a file instead"
        )


def _check_line(what: str, line: str) -> None:
    if len(line) > _LONGEST_LINE or not all(map(str.isprintable, line)):
        shown = ascii(line[:40])
        raise NoteError(f"{what} is one line of at most {_LONGEST_LINE} letters, not {shown}")


def _check_link(link: str) -> None:
    try:
        parts = urlsplit(link)
        is_good = parts.scheme in ("http", "https") and bool(parts.hostname)
    except ValueError:
        is_good = False
    if not is_good or len(link) > _LONGEST_LINK or not link.isprintable() or " " in link:
        raise NoteError(f"a link begins with http:// or https://, unlike {link[:60]!a}")
