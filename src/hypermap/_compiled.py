"""Where compiled loops are kept when numba would find no place for them."""

from __future__ import annotations

import os
import stat
from pathlib import Path

_GIVEN = "NUMBA_CACHE_DIR" in os.environ


def find_a_cache() -> None:
    """Name a private temporary folder to numba if neither the package nor the home is writable.

    Without any folder, each process compiles the loops that it needs.
    """
    if "NUMBA_CACHE_DIR" in os.environ or os.access(Path(__file__).parent, os.W_OK):
        return
    if not hasattr(os, "getuid"):
        return  # Windows, where every user has a folder for such files
    caches = Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"))  # noqa: PTH111
    if os.access(next(p for p in (caches, *caches.parents) if p.exists()), os.W_OK):
        return
    import tempfile  # not needed on most machines

    user = os.getuid()
    try:
        folder = Path(tempfile.gettempdir()) / f"hypermap-{user}"
        folder.mkdir(mode=0o700, exist_ok=True)
        status = folder.lstat()
    except OSError:
        return
    # What lies there will be executed, so nobody else may write there.
    if stat.S_ISDIR(status.st_mode) and status.st_uid == user and not status.st_mode & 0o077:
        os.environ["NUMBA_CACHE_DIR"] = str(folder)


def has_own_place() -> bool:
    """Return whether the user has named a folder for compiled loops, by NUMBA_CACHE_DIR."""
    return _GIVEN
