"""Atomic writes of one file, or of several files together."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import secrets
import stat
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from hypermap.core.errors import FileMissing, HypermapError
from hypermap.formats.journal import (
    JOURNAL_NAME,
    Journal,
    complete_saves,
    final_of,
    flush_file,
    flush_folder,
)
from hypermap.formats.locks import HAS_LOCKS, is_locked, lock_file, turn_to_save

_TEMPORARY = re.compile(r"\.hypermap-[0-9a-f]{16}(-[0-9]+)?\.tmp")
_REMEDIES = {
    errno.ENOSPC: "free space there, or save elsewhere",
    errno.EDQUOT: "free some of your space there, or save elsewhere",
    errno.EFBIG: "allow larger files (ulimit -f), or save elsewhere",
}
_PART = re.compile(r"\.hypermap-[0-9a-f]{16}\.part(\.\w+)?")

Undo = Callable[[], None]
Before = Callable[[], Undo]
"""What is done once the new content is on the disk, just before it replaces the old; what it
returns is called if the old stays after all."""


def nothing_before() -> Undo:
    """Do nothing, which needs no undoing."""
    return lambda: None


def write_file(path: str | Path, content: bytes, before: Before = nothing_before) -> None:
    """Write a file so that at any moment either the old or the new content is there.

    Raises:
        FileMissing: If the folder does not exist.
        HypermapError: If it cannot be written; the old file then remains.
    """
    target = Path(path)
    _write_files(target.parent, {target.name: content}, before)


def write_files(
    folder: str | Path, files: Mapping[str, bytes], before: Before = nothing_before
) -> None:
    """Write several files of a folder: replace all, in order, or none.

    All contents are on the disk before the first file is replaced, so a full disk changes
    nothing. If the program is killed in between, the next reader (by `read_as_saved`) or writer
    in the folder first replaces the rest. Unfinished files of killed programs are removed.

    Args:
        folder: an existing folder.
        files: content by name; a name may be in a subfolder, which is created.
        before: see `Before`.

    Raises:
        FileMissing: If the folder does not exist.
        HypermapError: If a file cannot be written, or is a link that leads out of the folder.
    """
    for name in files:
        refuse_link_out(Path(folder) / name, Path(folder))
    _write_files(folder, files, before)


def make_folder(folder: Path, *, parents: bool = True) -> None:
    """Create a folder, unless it exists.

    Args:
        folder: the folder.
        parents: whether to create those that it is in, too.

    Raises:
        HypermapError: If it cannot be created.
    """
    try:
        folder.mkdir(parents=parents, exist_ok=True)
    except OSError as error:
        raise HypermapError(f"{folder}: cannot be created: {why_not_written(error)}") from error


def why_not_written(error: OSError) -> str:
    """Return what the system says, and what to do where there is no room."""
    remedy = _REMEDIES.get(error.errno or 0)
    said = error.strerror or str(error)
    return f"{said}; {remedy}" if remedy else said


def refuse_link_out(path: Path, folder: Path) -> None:
    """Refuse to write a file that lies elsewhere, by a link that whoever made the folder left.

    Only a path that the user names may be such a link.

    Raises:
        HypermapError: If it lies elsewhere.
    """
    with contextlib.suppress(OSError, ValueError):  # whoever writes it says why
        if not Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder)):
            raise HypermapError(
                f"{path}: cannot be saved: it is a link that leads out of the folder; remove it"
            )


def _write_files(folder: str | Path, files: Mapping[str, bytes], before: Before) -> None:
    root = Path(folder)
    if not is_folder(root):
        raise FileMissing(f"{root}: there is no such folder to save in")
    if not files:
        return
    target = root
    try:
        for name in files:
            target = root / name
            if target.is_dir():
                raise HypermapError(f"{target}: is a folder; choose another name to save under")
            final_of(target).parent.mkdir(parents=True, exist_ok=True)
        _save(Journal(root, list(files)), list(files.values()), before)
    except OSError as error:
        where = getattr(error, "filename2", None) or target  # the target of a rename
        raise HypermapError(f"{where}: cannot be saved: {why_not_written(error)}") from error
    except ValueError:  # a NUL character, or half of a character
        raise HypermapError(
            f"{str(target)!r}: cannot be saved: it is not a valid file name"
        ) from None


@contextmanager
def file_beside(path: str | Path) -> Iterator[Path]:
    """Yield a path where another library can write a file, which then replaces the old one.

    Such files that killed programs left are removed.

    Raises:
        FileMissing: If the folder does not exist.
        HypermapError: If the file cannot be written; the old one then remains.
    """
    target = Path(path)
    if not is_folder(target.parent):
        raise FileMissing(f"{target.parent}: there is no such folder to save in")
    final = final_of(target)
    try:
        # With its extension, from which a library may choose the format
        with unfinished_file(final.parent, final.suffix) as unfinished:
            yield unfinished.path
            unfinished.become(final)
    except OSError as error:
        raise HypermapError(f"{target}: cannot be saved: {why_not_written(error)}") from error
    except ValueError:
        raise HypermapError(
            f"{str(target)!r}: cannot be saved: it is not a valid file name"
        ) from None


@dataclass(frozen=True)
class Unfinished:
    """A file that others write by its path.

    Attributes:
        path: where it is.
        file: the same, open and locked, so that no program removes it meanwhile.
    """

    path: Path
    file: BinaryIO

    def become(self, final: Path, like: Path | None = None) -> None:
        """Replace a file of the same folder, as soon as the content is on the disk.

        Args:
            final: the file.
            like: the file whose permissions and owner it gets; else those of the one it replaces.

        Raises:
            OSError: If that is not possible; the old file then remains.
        """
        _look_like(like or final, self.file.fileno())
        flush_file(self.file.fileno())
        if not HAS_LOCKS:  # on Windows, which does not rename open files
            self.file.close()
        self.path.replace(final)
        flush_folder(final.parent)

    def become_for_now(self, final: Path, like: Path) -> Undo:
        """Do what `become` does, and return what puts the old file back until this one is closed.

        Raises:
            OSError: If that is not possible; the old file then remains.
        """
        if final.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(final))
        old, has_old = _set_aside(self.path), final.exists()
        if has_old:
            try:
                os.link(final, old, follow_symlinks=False)  # so that a killed program leaves it
            except (OSError, NotImplementedError):  # on FAT
                final.replace(old)

        def put_back() -> None:
            with contextlib.suppress(OSError):
                if has_old:
                    old.replace(final)
                else:
                    final.unlink()

        try:
            self.become(final, like)
        except BaseException:
            put_back()
            raise
        return put_back


@contextmanager
def unfinished_file(folder: Path, suffix: str = "", mode: int = 0o666) -> Iterator[Unfinished]:
    """Yield a new file in a folder, which may get its name when it is written, and else is removed.

    Such files that killed programs left are removed.

    Args:
        folder: the folder.
        suffix: how the file's name ends.
        mode: who may read and write it meanwhile, as far as the umask allows.

    Raises:
        OSError: If it cannot be created.
    """
    _sweep_parts(folder)
    path = folder / f".hypermap-{secrets.token_hex(8)}.part{suffix}"
    try:
        with os.fdopen(_created(path, mode), "wb") as file:
            lock_file(file.fileno())
            yield Unfinished(path, file)
    finally:
        _remove([path, _set_aside(path)])


def _set_aside(unfinished: Path) -> Path:
    """Return where the file is that an unfinished one has replaced for now."""
    return unfinished.with_name(unfinished.name + ".old")


def is_folder(path: Path) -> bool:
    """Return whether it is a folder; False if that is unknown, as for a name that is too long."""
    try:
        return path.is_dir()
    except OSError:
        return False


def is_write_protected(path: Path) -> bool:
    """Return whether a file is read-only; replacing it would need no permission."""
    try:
        return not path.stat().st_mode & (stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH)
    except OSError:
        return False


def _save(journal: Journal, contents: Sequence[bytes], before: Before) -> None:
    moves, root = journal.moves(), journal.folder
    folders = {root, *(final.parent for _, final in moves)}
    is_one, is_committed = len(moves) == 1, False
    undo = nothing_before()
    with turn_to_save(folders) as turn:
        if turn == "busy" and not is_one:
            raise HypermapError(f"{root}: another program is saving here; try again")
        # A single file does not depend on unfinished saves here.
        with contextlib.suppress(*([HypermapError] if is_one else [])):
            complete_saves(root)
        if turn == "alone":
            _sweep(folders)
        try:
            for (temporary, final), content in zip(moves, contents, strict=True):
                _write(temporary, final, content)
            if not is_one:
                for folder in folders:
                    flush_folder(folder)
                for temporary, _ in moves:
                    temporary.stat()  # nobody has removed it
            undo = before()
            is_committed = True  # or nearly so
            if not is_one:
                journal.write()
            journal.put_in_place(is_first=is_one or turn == "alone")
        except BaseException:
            if not is_committed or moves[0][0].exists():  # then nothing is replaced yet
                _remove([*([] if is_one else [journal.path]), *(move[0] for move in moves)])
                undo()
            raise
        if not is_one:
            journal.path.unlink()


def _write(temporary: Path, final: Path, content: bytes) -> None:
    """Write a new file, and wait until it is on the disk."""
    with os.fdopen(_created(temporary), "wb") as file:
        _look_like(final, file.fileno())
        file.write(content)
        file.flush()
        flush_file(file.fileno())


def _created(temporary: Path, mode: int = 0o666) -> int:
    # Not the tempfile module: its files are readable by their owner alone.
    return os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)


def _look_like(final: Path, handle: int) -> None:
    """Give a new file the old one's permissions, and its owner as far as the system allows."""
    try:
        old = final.stat()
    except FileNotFoundError:
        return
    if hasattr(os, "fchown"):
        for owner, group in ((old.st_uid, -1), (-1, old.st_gid)):
            with contextlib.suppress(OSError):
                os.fchown(handle, owner, group)
    # On FAT, all files have the same permissions, and none may be changed.
    if hasattr(os, "fchmod") and os.fstat(handle).st_mode != old.st_mode:
        os.fchmod(handle, stat.S_IMODE(old.st_mode))


def _sweep(folders: Iterable[Path]) -> None:
    """Remove leftovers of killed programs; nobody else saves in these folders now."""
    for folder in folders:
        absolute = folder.absolute()
        if any((place / JOURNAL_NAME).exists() for place in (absolute, *absolute.parents)):
            continue  # which may name them
        with contextlib.suppress(OSError), os.scandir(folder) as entries:
            names = [entry.name for entry in entries if _TEMPORARY.fullmatch(entry.name)]
            _remove(folder / name for name in names)
        _sweep_parts(folder)


def _sweep_parts(folder: Path) -> None:
    """Remove unfinished files of other libraries, left by killed programs."""
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        parts = [folder / entry.name for entry in entries if _PART.fullmatch(entry.name)]
        _remove(part for part in parts if not is_locked(part))


def _remove(paths: Iterable[Path]) -> None:
    for path in paths:
        with contextlib.suppress(OSError, ValueError):
            path.unlink()
