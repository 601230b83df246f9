"""The map document: the open map with its versions, its undo history and its file."""

from __future__ import annotations

import copy
import itertools
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from hypermap.core.history import MAP_VERSION
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.formats import open_map
from hypermap.formats.backup import (
    EDITED_WITH,
    backup_of,
    is_from_before_today,
    save_with_backup,
)
from hypermap.formats.locks import turn_to_edit
from hypermap.viewer.live.changes import AnyChange, Change, Draft, applied, undoing
from hypermap.viewer.live.map_file import MapFile
from hypermap.viewer.live.request_errors import Refused
from hypermap.viewer.live.shown_map import MapVersion

_MOST_STEPS = 1000  # that can be undone
_EDITOR = "hypermap view"  # the editor's name in a saved file
_OPENED = 0  # the number of the content that was opened


@dataclass(frozen=True)
class _Step:
    """Changes that are undone together, and a number for the content before and after them."""

    changes: tuple[AnyChange, ...]
    before: int
    after: int


class MapDocument:
    """A map that several browser windows view and edit.

    A map without a semantic layer gets an empty one in the base frame, so that rooms and zones can
    be drawn. Like every change, it is in the file only after saving.

    Each change names the version that its window has seen (optimistic locking). It is refused if
    one of its objects has changed since then, so that no window overwrites another's work.

    Attributes:
        file: where the map is saved.
        is_editable: whether the map can be changed.
        event_count: grows with every event that windows should know of.
        saves: how often the map was saved.

    Raises:
        HypermapError: If the file is not a map.
    """

    def __init__(self, path: Path, is_editable: bool = True) -> None:
        hypermap = open_map(path)
        self.file = MapFile.of(path, hypermap)
        hypermap = _with_objects(hypermap) if is_editable else hypermap
        self.is_editable = is_editable
        self.event_count = 0
        self.saves = 0
        self._changing = threading.Lock()
        self._content = self._saved_content = _OPENED
        # Milliseconds, so that no version is given again when the server starts again.
        self._open(hypermap, time.time_ns() // 1_000_000)

    @property
    def name(self) -> str:
        """The name of the file."""
        return self.file.path.name

    @property
    def address(self) -> str:
        """The path of the file."""
        return str(self.file.path)

    @property
    def current(self) -> MapVersion:
        """The present map."""
        return self._current

    @property
    def is_unsaved(self) -> bool:
        """Whether there are unsaved changes."""
        return self._content != self._saved_content

    def status(self) -> dict[str, Any]:
        """Return the state of editing, as windows show it."""
        state = self.file.state
        status = {
            "version": self._current.version,
            "opened": self._first_version,
            "can_undo": self.is_editable and bool(self._done),
            "can_redo": self.is_editable and bool(self._undone),
            "unsaved": self.is_unsaved,
        }
        return status if state == "same" else {**status, "disk": state}

    def edit(self, version: int, change: Callable[[Draft], None]) -> Draft:
        """Make several changes as one step: all of them or none.

        Args:
            version: the version that the client has seen.
            change: makes the changes.

        Returns:
            The changes.

        Raises:
            Refused: If the map is read-only, or another window has changed one of the objects.
            HypermapError: If a change is not possible.
        """
        with self._changing:
            self._check_editable()
            if not self._first_version <= version <= self._current.version:
                self._refuse_behind("the map has been reloaded")
            draft = Draft(self._current.hypermap, partial(self._check_seen, version))
            change(draft)
            if draft.changes:
                step = _Step(tuple(draft.changes), self._content, self._next_content())
                self._done.append(step)
                self._undone.clear()
                self._take(draft.hypermap, draft.changes, step.after)  # notifies windows
            return draft

    def undo(self, version: int) -> Sequence[AnyChange]:
        """Undo the last step, and return what changed; raises like `redo`."""
        return self._go(version, self._done, self._undone, is_undo=True)

    def redo(self, version: int) -> Sequence[AnyChange]:
        """Redo the step that was undone last, and return what changed.

        Raises:
            Refused: If the map is read-only, has changed since that version, or there is no step.
        """
        return self._go(version, self._undone, self._done, is_undo=False)

    def save(self, name: str | None = None, overwrite: bool = False) -> None:
        """Save the map to its file or, from then on, to another one in the same folder.

        Edited maps are marked, so that mapping does not replace them without asking. A map_server
        map is not overwritten: without a name, the map is saved as NAME.hmap next to it.

        Raises:
            Refused: If the map is read-only, the file has changed on disk since the map was opened
                or saved, or the other name is in use, unless `overwrite`; or if the name leads
                out of the folder.
            HypermapError: If it cannot be written.
        """
        with self._changing:
            self._check_editable()
            if name is None and self.file.is_plain_grid:
                name = self.file.path.with_suffix(".hmap").name
            file = self.file if name is None else self.file.sibling(name)
            with turn_to_edit(file.path):
                self._save(file, overwrite)

    def _save(self, file: MapFile, overwrite: bool) -> None:
        file.check_before_saving(overwrite)
        hypermap = self._current.hypermap
        is_edited = self._content != _OPENED
        if is_edited:
            from hypermap.mapping.going_on import with_marks  # imported with the mapper's loops

            hypermap = copy.copy(with_marks(hypermap))
            hypermap.metadata[EDITED_WITH] = _EDITOR
            known = hypermap.metadata.get(MAP_VERSION)
            opened = known if type(known) is int else 0
            hypermap.metadata[MAP_VERSION] = opened + self._edited_saves + 1
        has_backup = self._has_backup(file)
        if save_with_backup(hypermap, file.path, spare=has_backup) is not None or has_backup:
            self._backed_up.add(file.path)
        self._current.hypermap.history = hypermap.history
        self._edited_saves += is_edited
        self.file = MapFile.of(file.path, hypermap)
        self._saved_content = self._content
        self.saves += 1
        self.event_count += 1

    def _has_backup(self, file: MapFile) -> bool:
        """Return whether the copy beside a file is what was there before today's edits.

        That is the one made by the first save, or by a live node whose map this is.
        """
        if not file.is_own or file.state != "same":
            return False
        if file.path in self._backed_up:
            return True
        return is_from_before_today(backup_of(file.path), self._current.hypermap)

    def reload(self) -> None:
        """Reload the file; unsaved changes and the undo history are lost.

        Raises:
            HypermapError: If the file is no longer a map; then everything is unchanged.
        """
        with self._changing:
            hypermap = open_map(self.file.path)
            self.file = MapFile.of(self.file.path, hypermap)
            hypermap = _with_objects(hypermap) if self.is_editable else hypermap
            self._open(hypermap, self._current.version + 1)
            self.event_count += 1

    def look(self) -> None:
        """Check whether the file has changed on disk or was deleted, and notify windows."""
        with self._changing:  # a file that is being saved has not changed by itself
            if self.file.look():
                self.event_count += 1

    def _open(self, hypermap: Hypermap, version: int) -> None:
        self._first_version = version
        self._edited_saves = 0
        self._backed_up: set[Path] = set()
        self._current = MapVersion(version, hypermap, {layer.name: version for layer in hypermap})
        self._touched: dict[tuple[str, int], int] = {}
        self._done: deque[_Step] = deque(maxlen=_MOST_STEPS)
        self._undone: deque[_Step] = deque(maxlen=_MOST_STEPS)
        self._contents = self._content = self._saved_content = _OPENED

    def _go(
        self, version: int, taken: deque[_Step], given: deque[_Step], is_undo: bool
    ) -> Sequence[AnyChange]:
        with self._changing:
            self._check_editable()
            if version != self._current.version:
                self._refuse_behind("the map has changed, perhaps in another window")
            if not taken:
                raise Refused(f"there is nothing to {'undo' if is_undo else 'redo'}")
            step = taken[-1]
            changes = undoing(step.changes) if is_undo else list(step.changes)
            hypermap = applied(self._current.hypermap, changes)
            given.append(taken.pop())
            self._take(hypermap, changes, step.before if is_undo else step.after)
            return changes

    def _take(self, hypermap: Hypermap, changes: Sequence[AnyChange], content: int) -> None:
        version = self._current.version + 1
        changed_in = {**self._current.changed_in, **{change.layer: version for change in changes}}
        objects = [change for change in changes if isinstance(change, Change)]
        self._touched.update({(change.layer, change.id): version for change in objects})
        self._current = MapVersion(version, hypermap, changed_in)
        self._content = content
        self.event_count += 1

    def _next_content(self) -> int:
        self._contents += 1
        return self._contents

    def _check_editable(self) -> None:
        if not self.is_editable:
            raise Refused("the map is read-only", 403)

    def _check_seen(self, version: int, layer: str, number: int) -> None:
        """Refuse to change an object that has changed after a version."""
        if self._touched.get((layer, number), version) > version:
            self._refuse_behind(
                f"object {number} of layer {layer!r} has been changed in another window; "
                "check it and try again"
            )

    def _refuse_behind(self, message: str) -> None:
        raise Refused(message, 409, "behind", version=self._current.version)


def _with_objects(hypermap: Hypermap) -> Hypermap:
    """Return a map that has a layer of objects."""
    if any(isinstance(layer, SemanticLayer) for layer in hypermap):
        return hypermap
    others = (f"semantic_{number}" for number in itertools.count(2))
    name = next(name for name in itertools.chain(["semantic"], others) if name not in hypermap)
    added = SemanticLayer(name, hypermap.base_frame)
    return hypermap.with_layers([*hypermap, added])
