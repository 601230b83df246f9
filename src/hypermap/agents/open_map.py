"""An open map whose file may change, and which is edited step by step."""

from __future__ import annotations

import contextlib
import logging
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.viewer.live.changes import Draft
from hypermap.viewer.live.document import MapDocument

_log = logging.getLogger(__name__)


class OpenMap:
    """A map file, loaded again when it has changed on disk.

    Args:
        path: the file.
        is_editable: whether it can be edited.

    Raises:
        HypermapError: If the file is not a map.
    """

    def __init__(self, path: Path, is_editable: bool = False) -> None:
        self._document = MapDocument(path, is_editable)
        self._lock = threading.RLock()

    def current(self) -> Hypermap:
        """Return the present map; the last one that could be read, if the file is damaged."""
        with self._lock:
            self._document.look()
            if self._document.file.state == "changed":
                try:
                    self._document.reload()
                except HypermapError as error:
                    _log.warning("still using the map as it was: %s", error)
            return self._document.current.hypermap

    @contextlib.contextmanager
    def between_edits(self) -> Iterator[None]:
        """Wait until no edit is under way, and let none begin meanwhile."""
        with self._lock:
            yield

    def edit(self, change: Callable[[Draft], None]) -> None:
        """Make changes and save them: both, or neither.

        Raises:
            HypermapError: If a change is not possible, or the map cannot be saved.
        """
        with self._lock:
            self.current()
            self._document.edit(self._document.current.version, change)
            try:
                self._document.save()
            except HypermapError:
                self._document.undo(self._document.current.version)
                raise
