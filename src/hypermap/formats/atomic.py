"""Files are replaced as a whole or not at all."""

from __future__ import annotations

import contextlib
import os
import secrets
import stat
from collections.abc import Mapping
from pathlib import Path

from hypermap.core.errors import FileMissing, HypermapError


def write_file(path: str | Path, content: bytes) -> None:
    """Write a file so that at any moment either the old or the new content is there.

    Raises:
        FileMissing: If the folder does not exist.
        HypermapError: If it cannot be written; the old file is untouched then.
    """
    target = Path(path)
    write_files(target.parent, {target.name: content})


def write_files(folder: str | Path, files: Mapping[str, bytes]) -> None:
    """Write several files of a folder; each is replaced as a whole, the last one last.

    All contents are on the disk before the first file is replaced, so that a full disk leaves
    everything as it was.

    Args:
        folder: an existing folder.
        files: content by name; a name may lie in a folder below, which is made.

    Raises:
        FileMissing: If the folder does not exist.
        HypermapError: If a file cannot be written.
    """
    root = Path(folder)
    if not is_folder(root):
        raise FileMissing(f"{root}: there is no such folder to save in")
    staged: list[tuple[Path, Path]] = []
    target = root
    try:
        for name, content in files.items():
            target = root / name
            if target.is_dir():
                raise HypermapError(f"{target}: is a folder; choose another name to save under")
            # A link keeps pointing at the file, which is what changes.
            final = Path(os.path.realpath(target)) if target.is_symlink() else target
            final.parent.mkdir(parents=True, exist_ok=True)
            staged.append((_write_beside(final, content), final))
        for temporary, target in staged:
            temporary.replace(target)
        for parent in {target.parent for _, target in staged}:
            _flush_folder(parent)
    except OSError as error:
        raise HypermapError(f"{target}: cannot be saved: {error.strerror}") from error
    except ValueError:  # a NUL character
        raise HypermapError(f"{str(target)!r}: cannot be saved: it is no name of a file") from None
    finally:
        for temporary, _ in staged:
            with contextlib.suppress(OSError):
                temporary.unlink()


def is_folder(path: Path) -> bool:
    """Return whether it is a folder; what cannot be looked at, as a name too long, is none."""
    try:
        return path.is_dir()
    except OSError:
        return False


def _write_beside(target: Path, content: bytes) -> Path:
    """Write to a new file in the target's folder, and wait until it is on the disk."""
    temporary = target.with_name(f".hypermap-{secrets.token_hex(8)}.tmp")
    try:
        # Not the tempfile module: its files are readable by their owner alone.
        handle = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
        with os.fdopen(handle, "wb") as file:
            if target.exists():
                os.fchmod(file.fileno(), stat.S_IMODE(target.stat().st_mode))
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
    except BaseException:
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise
    return temporary


def _flush_folder(folder: Path) -> None:
    """Wait until a rename is on the disk; some file systems cannot say."""
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
