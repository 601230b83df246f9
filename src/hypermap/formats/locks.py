"""Locks between programs that save at the same time, where the system supports them."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal

try:
    import fcntl
except ImportError:  # Windows
    HAS_LOCKS = False
else:
    HAS_LOCKS = True

Turn = Literal["alone", "busy", "unknown"]
"""Nobody else saves in a folder, somebody still does after a while, or it is unknown."""

_PATIENCE, _PAUSE = 10.0, 0.02  # seconds


@contextmanager
def turn_to_save(folders: Iterable[Path]) -> Iterator[Turn]:
    """Wait until nobody else saves in some folders, then lock them.

    The wait is limited: anyone who can read a folder can lock it, for any time.
    """
    until = time.monotonic() + _PATIENCE
    with contextlib.ExitStack() as held:
        turns = {held.enter_context(_locked(folder, until)) for folder in sorted(set(folders))}
        yield "busy" if "busy" in turns else "unknown" if "unknown" in turns else "alone"


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
        with path.open("rb") as file:
            return _try_to_lock(file.fileno()) != "alone"
    except OSError:
        return True


@contextmanager
def _locked(folder: Path, until: float) -> Iterator[Turn]:
    if not HAS_LOCKS:
        yield "unknown"
        return
    try:
        handle = os.open(folder, os.O_RDONLY)
    except OSError:
        yield "unknown"
        return
    try:
        turn = _lock(handle, until)
        yield turn
        if turn == "alone":  # explicitly: a child process may have the handle, too
            fcntl.flock(handle, fcntl.LOCK_UN)
    finally:
        os.close(handle)


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
