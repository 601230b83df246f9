"""Locks between programs that save at the same time, where the system supports them."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

from hypermap.core.errors import HypermapError

try:
    import fcntl
except ImportError:  # Windows
    HAS_LOCKS = False
else:
    HAS_LOCKS = True

Turn = Literal["alone", "busy", "unknown"]
"""Nobody else saves in a folder, somebody still does after a while, or it is unknown."""

_PATIENCE, _PAUSE = 10.0, 0.02  # seconds
_READ_ONLY = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0)  # or a pipe waits for a writer


@contextmanager
def turn_to_save(folders: Iterable[Path]) -> Iterator[Turn]:
    """Wait until nobody else saves in some folders, then lock them.

    The wait is limited: anyone who can read a folder can lock it, for any time.
    """
    until = time.monotonic() + _PATIENCE
    with contextlib.ExitStack() as held:
        turns = {held.enter_context(_locked(folder, until)) for folder in _in_order(folders)}
        yield "busy" if "busy" in turns else "unknown" if "unknown" in turns else "alone"


@contextmanager
def turn_to_edit(*paths: Path) -> Iterator[None]:
    """Wait until no other program is between reading some files and replacing them.

    It reads them within, so it misses nothing that the others have saved. What cannot be read while
    it is locked, as a folder or a file on an SMB share, is not locked.

    Raises:
        HypermapError: If another program takes too long.
    """
    until = time.monotonic() + _PATIENCE
    with contextlib.ExitStack() as held:
        for path in _in_order(paths):
            with contextlib.ExitStack() as lock:
                if lock.enter_context(_locked(path, until)) == "busy":
                    raise HypermapError(f"{path}: another program is changing it; try again")
                if _is_readable(path):
                    held.enter_context(lock.pop_all())
        yield


def _in_order(paths: Iterable[Path]) -> list[Path]:
    """Return each file once, as nobody gets a second lock, in an order that is always the same."""
    return sorted({Path(os.path.realpath(path)) for path in paths})


def _is_readable(path: Path) -> bool:
    try:
        handle = os.open(path, _READ_ONLY)
        try:
            os.read(handle, 1)
        finally:
            os.close(handle)
    except OSError:
        return False
    return True


def lock_file(handle: int) -> None:
    """Let others know that a file is in use until it is closed."""
    if HAS_LOCKS:
        with contextlib.suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)


def is_locked(path: Path) -> bool:
    """Return whether a file may be in use; True if that is unknown."""
    if not HAS_LOCKS:
        return True
    try:
        handle = os.open(path, _READ_ONLY)
    except OSError:
        return True
    try:
        return _try_to_lock(handle) != "alone"
    finally:
        os.close(handle)


@contextmanager
def _locked(path: Path, until: float) -> Iterator[Turn]:
    if not HAS_LOCKS:
        yield "unknown"
        return
    try:
        handle, turn = _opened(path, until)
    except (OSError, ValueError):
        yield "unknown"
        return
    try:
        yield turn
        if turn == "alone":  # explicitly: a child process may have the handle, too
            fcntl.flock(handle, fcntl.LOCK_UN)
    finally:
        os.close(handle)


def _opened(path: Path, until: float) -> tuple[int, Turn]:
    """Return an open file or folder, and whether it is locked now."""
    while True:
        handle = os.open(path, _READ_ONLY)
        turn = _lock(handle, until)
        if turn != "alone" or not _is_replaced(path, handle) or time.monotonic() > until:
            return handle, turn
        os.close(handle)


def _is_replaced(path: Path, handle: int) -> bool:
    try:
        return not os.path.samestat(path.stat(), os.fstat(handle))
    except OSError:  # it is gone
        return False


def _lock(handle: int, until: float) -> Turn:
    while (turn := _try_to_lock(handle)) == "busy" and time.monotonic() < until:
        time.sleep(_PAUSE)
    return turn


def _try_to_lock(handle: int) -> Turn:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return "busy"
    except OSError:  # as on some network drives
        return "unknown"
    return "alone"
