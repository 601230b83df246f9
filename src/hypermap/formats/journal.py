"""Saves several files as one: the next reader or writer completes a save that was killed.

Before the first file is replaced, all new files are next to the old ones, and a journal
lists them. From then on the save is valid: whoever finds the journal replaces the rest. A
save without a journal has not happened.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import re
import secrets
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import TypeVar

from hypermap.core.errors import FormatError, HypermapError
from hypermap.formats.locks import turn_to_save

JOURNAL_NAME = ".hypermap-save.json"
_TOKEN = re.compile(r"[0-9a-f]{16}")
_MOST_BYTES = 4_000_000
_CANNOT_FLUSH = (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP)  # says a file system, not a disk
_TRIES = 20  # to read a map that is saved again and again

T = TypeVar("T")


@dataclass(frozen=True)
class Journal:
    """Files of a folder that are replaced together.

    Attributes:
        folder: their folder.
        names: of the files, in the order in which they are replaced.
        token: part of the names of the new files.
    """

    folder: Path
    names: Sequence[str]
    token: str = field(default_factory=lambda: secrets.token_hex(8))

    @property
    def path(self) -> Path:
        """The path of the journal."""
        return self.folder / JOURNAL_NAME

    def moves(self) -> list[tuple[Path, Path]]:
        """Return each temporary file, and the file that it replaces."""
        finals = [final_of(self.folder / name) for name in self.names]
        return [
            (final.with_name(f".hypermap-{self.token}-{number}.tmp"), final)
            for number, final in enumerate(finals)
        ]

    def write(self) -> None:
        """Commit the save: from now on it will be completed."""
        temporary = self.folder / f".hypermap-{self.token}.tmp"
        try:
            with temporary.open("xb") as file:
                file.write(json.dumps({"token": self.token, "names": list(self.names)}).encode())
                file.flush()
                flush_file(file.fileno())
            temporary.replace(self.path)
        finally:
            temporary.unlink(missing_ok=True)
        flush_folder(self.folder)

    def put_in_place(self, *, is_first: bool = False) -> None:
        """Replace all files not yet replaced; another program may do the same at the same time.

        Args:
            is_first: whether nobody else has begun: then the new files must exist.

        Raises:
            OSError: If one cannot be replaced.
        """
        moves = self.moves()
        in_place_already = () if is_first else (FileNotFoundError,)
        for temporary, final in moves:
            with contextlib.suppress(*in_place_already):
                temporary.replace(final)
        for folder in {final.parent for _, final in moves}:
            flush_folder(folder)


def final_of(target: Path) -> Path:
    """Return the file to replace: a link stays, and the file that it points at changes."""
    return Path(os.path.realpath(target)) if target.is_symlink() else target


def complete_saves(folder: Path) -> None:
    """Complete a save of several files that was cut off.

    Raises:
        HypermapError: If that is not possible.
    """
    journal = _journal_in(folder)
    if journal is None:
        return
    try:
        journal.put_in_place()
        journal.path.unlink(missing_ok=True)
    except OSError as error:
        raise HypermapError(
            f"{folder}: a save was interrupted here, and cannot be completed ({error.strerror}): "
            "open the map once with permission to write in this folder"
        ) from error


def read_as_saved(path: Path, read: Callable[[], T]) -> T:
    """Read several files, all of the same save.

    Args:
        path: one of the files, which each save replaces.
        read: reads them.

    Raises:
        HypermapError: If a save was cut off and cannot be completed, the files are saved again and
            again meanwhile, or `read` raises it.
    """
    journal = path.parent / JOURNAL_NAME
    for _ in range(_TRIES):
        before = _look_at(path)
        if os.path.lexists(journal):
            with turn_to_save([path.parent]) as turn:
                if turn == "busy":
                    raise HypermapError(f"{path}: is being saved; try again later")
                complete_saves(path.parent)
            continue
        try:
            value = read()
        except HypermapError:
            if not os.path.lexists(journal) and _look_at(path) == before:
                raise
            continue
        if not os.path.lexists(journal) and _look_at(path) == before:
            return value
    raise HypermapError(f"{path}: is being saved continuously; try again later")


def flush_file(handle: int) -> None:
    """Wait until the content of a file is on the disk, where the file system can do that.

    Raises:
        OSError: If the disk cannot take it.
    """
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in _CANNOT_FLUSH:
            raise


def flush_folder(folder: Path) -> None:
    """Wait until a rename is on the disk; some file systems cannot say."""
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _journal_in(folder: Path) -> Journal | None:
    path = folder / JOURNAL_NAME
    try:
        # Without O_NONBLOCK, opening a pipe would wait for a writer.
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
        with os.fdopen(handle, "rb") as file:
            document = json.loads(file.read(_MOST_BYTES))
        token, names = document["token"], [str(name) for name in document["names"]]
        if not _TOKEN.fullmatch(token) or not all(map(_is_within, names)):
            raise ValueError
    except FileNotFoundError:
        return None
    except OSError as error:
        raise HypermapError(f"{path}: cannot be read: {error.strerror}") from error
    except (ValueError, TypeError, LookupError, RecursionError):
        raise FormatError("is not a journal of a save; delete it", path=path) from None
    return Journal(folder, names, token)


def _is_within(name: str) -> bool:
    path = PurePosixPath(name)
    return bool(path.name) and not path.is_absolute() and ".." not in path.parts


def _look_at(path: Path) -> tuple[int, int, int] | None:
    """Return what distinguishes a file from its replacement."""
    try:
        found = path.stat()
    except (OSError, ValueError):  # whoever reads it says why
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino
