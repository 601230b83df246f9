"""A `Store`, the files of a map: in memory (the members of an archive) or in a folder."""

from __future__ import annotations

import contextlib
import os
import re
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import BinaryIO

from hypermap.core.errors import FileMissing, FormatError, HypermapError
from hypermap.core.notes import Attachment
from hypermap.formats import limits
from hypermap.formats.atomic import is_folder, write_files

_UNSAFE = re.compile(r"[\x00-\x1f\\]|^/|^[A-Za-z]:|(^|/)(\.git(/|$)|\.hypermap-)", re.IGNORECASE)
"""In names: what leads elsewhere, into a repository's own files, or to those of a save."""

_START_OF_POINTER = b"version https://git-lfs.github.com/spec/"
_LONGEST_POINTER = 1023  # bytes


class MemoryStore:
    """Files in memory: those of an archive that was read or will be written.

    Attributes:
        where: name of the whole in messages, such as "office.hmap"; may be empty.
        files: content by name, in the order of writing.
        folder: the folder of the archive that was read; None without one.
        beside: name of the folder, next to the archive that will be written, for large files;
            None if all must be in the archive.
        large: the files that belong there.
        damaged: what is wrong with files that a map can do without, by name.

    >>> store = MemoryStore(where="office.hmap")
    >>> store.write("semantic", b"[]")
    >>> store.read("./semantic"), store.path_of("semantic")
    (b'[]', 'office.hmap/semantic')
    """

    def __init__(
        self,
        files: Mapping[str, bytes] | None = None,
        where: str = "",
        *,
        folder: Path | None = None,
        beside: str | None = None,
    ) -> None:
        self.where = where
        self.files = dict(files or {})
        self.folder = folder
        self.beside = beside
        self.large: list[Attachment] = []
        self.damaged: dict[str, str] = {}

    def read(self, name: str) -> bytes:
        """Return the content of a file.

        Raises:
            FormatError: If there is no such file, or it is damaged.
        """
        content = self.files.get(safe_name(name, self.where))
        if name in self.damaged:
            raise FormatError(f"is damaged: {self.damaged[name]}", path=self.path_of(name))
        if content is None:
            held = ", ".join(self.files) or "nothing"
            raise FormatError(f"there is no such file, only {held}", path=self.path_of(name))
        return content

    def write(self, name: str, content: bytes) -> None:
        """Hold a file."""
        self.files[safe_name(name, self.where)] = content

    def path_of(self, name: str) -> str:
        """Return how messages name a file."""
        return f"{self.where}/{name}" if self.where else name

    def names_of(self, file: str) -> list[str]:
        """Return the names that belong to `file`: itself, `file.*` and all in a folder `file`."""
        file = safe_name(file, self.where)
        return [name for name in self.files if _belongs(name, file)]


class FolderStore:
    """The files in a folder; names that lead out of it are refused, through links too."""

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder)

    def read(self, name: str) -> bytes:
        """Return the content of a file.

        Raises:
            FormatError: If there is no such file, or it is too large or outside the folder.
        """
        path = self.folder / safe_name(name, str(self.folder))
        if not Path(os.path.realpath(path)).is_relative_to(os.path.realpath(self.folder)):
            raise FormatError("is a link that leads out of the folder", path=path)
        try:
            return read_file(path)
        except FileMissing:
            raise FormatError("there is no such file", path=path) from None

    def write(self, name: str, content: bytes) -> None:
        """Write a file completely, or keep the old one."""
        write_files(self.folder, {safe_name(name, str(self.folder)): content})

    def path_of(self, name: str) -> str:
        """Return how messages name a file."""
        return str(self.folder / name)

    def names_of(self, file: str) -> list[str]:
        """Return the names that belong to `file`: itself, `file.*` and all in a folder `file`."""
        base = self.folder / safe_name(file, str(self.folder))
        if not is_folder(base.parent):
            return []
        found = [path for path in base.parent.iterdir() if _belongs(path.name, base.name)]
        if base.is_dir():
            found += base.rglob("*")
        if len(found) > limits.MAX_MEMBERS:
            raise FormatError(f"has more than {limits.MAX_MEMBERS} files", path=base)
        return sorted(p.relative_to(self.folder).as_posix() for p in found if p.is_file())


def read_file(path: Path, max_bytes: int | None = None) -> bytes:
    """Return the content of a regular file of bounded size; raises what `open_file` raises."""
    bound = limits.MAX_FILE_BYTES if max_bytes is None else max_bytes
    with open_file(path, bound) as file:
        try:
            return file.read(bound)
        except OSError as error:
            raise HypermapError(f"{path}: cannot be read: {error.strerror}") from error


def open_file(path: Path, max_bytes: int) -> BinaryIO:
    """Return a regular file of bounded size, open for reading.

    Raises:
        FileMissing: If there is no such file.
        FormatError: If it is a folder, a device, too large, or Git LFS left its pointer here.
        HypermapError: If it cannot be read.
    """
    try:
        # Without O_NONBLOCK, opening a pipe would wait for a writer.
        file = os.fdopen(os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0)), "rb")
    except (FileNotFoundError, NotADirectoryError):
        raise FileMissing(f"{path}: there is no such file") from None
    except IsADirectoryError:
        raise FormatError("is a folder, not a file", path=path) from None
    except OSError as error:
        raise HypermapError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError:  # a NUL character
        raise FileMissing(f"{str(path)!r}: there is no such file") from None
    status = os.fstat(file.fileno())
    if stat.S_ISREG(status.st_mode) and status.st_size <= max_bytes:
        try:
            refuse_pointer(path)
        except FormatError:
            file.close()
            raise
        return file
    file.close()
    if not stat.S_ISREG(status.st_mode):
        raise FormatError("is not a regular file", path=path)
    raise FormatError(
        f"holds {status.st_size} bytes, more than the {max_bytes} that are allowed", path=path
    )


def refuse_pointer(path: Path) -> None:
    """Refuse the pointer that Git LFS leaves in place of a file that it has not fetched.

    Source: Git LFS specification, "The Pointer".

    Raises:
        FormatError: Saying how to fetch the file.
    """
    with contextlib.suppress(OSError):
        if path.stat().st_size > _LONGEST_POINTER or not path.is_file():
            return
        if path.read_bytes().startswith(_START_OF_POINTER):
            raise FormatError(
                "is only Git LFS' pointer to the file; `git lfs pull` fetches the file itself",
                path=path,
            )


def safe_name(name: str, where: str = "") -> str:
    """Return a file's name in normal form, or refuse one that leads out of the map.

    Raises:
        FormatError: If it is empty, absolute, has `..`, a backslash or a control character, or
            is a file of Git or of a save.

    >>> safe_name("./maps//floor.yaml")
    'maps/floor.yaml'
    """
    parts = [part for part in name.split("/") if part not in ("", ".")]
    if not parts or ".." in parts or _UNSAFE.search(name):
        raise FormatError(
            f"the file name {name!r} is not allowed; it must be within the map's files",
            path=where or None,
        )
    return "/".join(parts)


def place_for(folder: Path, name: str) -> Path:
    """Return the path of a file in a folder, by an untrusted name.

    Raises:
        FormatError: If the name leads out of the folder, as `safe_name` says.
        HypermapError: If the system can have no file of that name, as one too long.
    """
    path = folder / safe_name(name)
    try:
        with contextlib.suppress(FileNotFoundError):
            path.lstat()
    except OSError as error:
        raise HypermapError(f"{name[:60]!r} is not a valid file name: {error.strerror}") from None
    except ValueError:  # half of a character
        raise HypermapError(f"{name[:60]!r} is not a valid file name") from None
    return path


def _belongs(name: str, file: str) -> bool:
    return name == file or name.startswith((f"{file}.", f"{file}/"))
