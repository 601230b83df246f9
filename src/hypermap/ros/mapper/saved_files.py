"""The files of a live map: what the node has read or saved there, and whether others have since."""

from __future__ import annotations

import hashlib
import os
from collections import deque
from collections.abc import Iterable
from pathlib import Path

from hypermap.core.hypermap import Hypermap

_Look = tuple[int, int, int]

_MOST = 1000  # saves that are remembered: of 8 hours, at one each 30 s


class SavedFiles:
    """Remembers how files were when the node looked at them, and what it has saved itself.

    A path in it is one in which the node has saved its map.
    """

    def __init__(self, paths: Iterable[str]) -> None:
        """Look at files that the node is about to read, or will save in; empty paths are none."""
        self._looks = {path: _look_at(path) for path in map(_real, filter(None, paths))}
        self._own: set[str] = set()
        self._instead: dict[str, Path] = {}
        self._states: deque[bytes] = deque(maxlen=_MOST)

    def __contains__(self, path: Path) -> bool:
        return _real(path) in self._own

    def add(self, path: Path, hypermap: Hypermap) -> None:
        """Remember a file in which the node has just saved its map."""
        self._own.add(_real(path))
        self._looks[_real(path)] = _look_at(path)
        self.know(hypermap)

    def leave(self, path: Path, instead: Path) -> None:
        """Leave a file to another program: what was to be saved there is saved elsewhere."""
        self._instead[_real(path)] = instead

    def in_place_of(self, path: Path) -> Path:
        """Return where to save what was to be saved in a file: there, if it was not left."""
        while (instead := self._instead.get(_real(path))) is not None:
            path = instead
        return path

    def know(self, hypermap: Hypermap) -> None:
        """Remember a map that the node goes on with, or has saved, to tell edited copies of it."""
        if (state := _state_of(hypermap)) is not None:
            self._states.append(state)

    def forget(self) -> None:
        """Let no map be an edited copy, as once the live map was cleared."""
        self._states.clear()

    def is_changed(self, path: Path) -> bool:
        """Return whether others have written a file since the node looked at it."""
        now = _look_at(path)
        return now is not None and now != self._looks.get(_real(path), now)

    def is_copy(self, hypermap: Hypermap) -> bool:
        """Return whether a map is one of this node, which others may have edited."""
        return _state_of(hypermap) in self._states


def _state_of(hypermap: Hypermap) -> bytes | None:
    """Return what is the same for a map and its edited copies, and for no others."""
    kept = hypermap.mapper_state
    if kept is None:
        return None
    return hashlib.sha256(kept() if callable(kept) else kept).digest()


def _look_at(path: str | Path) -> _Look | None:
    """Return what tells a file from the one that replaces it; None if there is none."""
    try:
        found = Path(path).stat()
    except (OSError, ValueError):
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino


def _real(path: str | Path) -> str:
    return os.path.realpath(path)
