"""Changes of a map as values, each with the states before and after."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.core.notes import Note
from hypermap.core.notes_layer import NotesLayer
from hypermap.core.objects import SemanticObject
from hypermap.core.semantic import SemanticLayer


@dataclass(frozen=True)
class Change:
    """One object or note that was added, replaced or removed.

    Attributes:
        layer: name of the layer that holds it.
        id: the object's.
        before: None if it was added.
        after: None if it was removed.
    """

    layer: str
    id: int
    before: SemanticObject | Note | None
    after: SemanticObject | Note | None

    def inverse(self) -> Change:
        """Return the change that undoes this one."""
        return Change(self.layer, self.id, self.after, self.before)


@dataclass(frozen=True)
class LayerChange:
    """A layer without objects or notes that was added or removed.

    Attributes:
        layer: its name.
        is_there: whether it exists after the change.
        has_notes: whether it is a layer of notes, not of objects.
    """

    layer: str
    is_there: bool
    has_notes: bool = False

    def inverse(self) -> LayerChange:
        """Return the change that undoes this one."""
        return LayerChange(self.layer, not self.is_there, self.has_notes)


AnyChange: TypeAlias = Change | LayerChange


def undoing(changes: Sequence[AnyChange]) -> list[AnyChange]:
    """Return the inverse changes, the last one first."""
    return [change.inverse() for change in reversed(changes)]


def applied(hypermap: Hypermap, changes: Iterable[AnyChange]) -> Hypermap:
    """Return a map with the changes applied; the given one is unchanged.

    Raises:
        LayerNotFound, ObjectNotFound: If there is no such layer or object.
    """
    draft = Draft(hypermap)
    for change in changes:
        draft.apply(change)
    return draft.hypermap


class Draft:
    """A copy of a map that is being changed; the original is unchanged.

    Attributes:
        hypermap: the copy so far.
        changes: all changes so far, in order.
    """

    def __init__(
        self, hypermap: Hypermap, check: Callable[[str, int], None] = lambda _layer, _id: None
    ) -> None:
        """Start with a map; `check(layer, id)` raises for an object that must not be changed."""
        self.hypermap = hypermap
        self.changes: list[AnyChange] = []
        self._check = check
        self._own: dict[str, SemanticLayer] = {}
        self._notes: dict[str, NotesLayer] = {}

    def add(self, layer: str, item: SemanticObject) -> int:
        """Add an object, its footprint in the layer's frame, and return its id."""
        (number,) = self.layer(layer).add([item])
        self.changes.append(Change(layer, number, None, self.layer(layer).get(number)))
        return number

    def get(self, layer: str, number: int) -> SemanticObject:
        """Return an object in order to change it.

        Raises:
            ObjectNotFound: If it does not exist.
        """
        self._check(layer, number)
        return self.layer(layer).get(number)

    def update(self, layer: str, number: int, item: SemanticObject) -> None:
        """Replace an object; raises like `get`."""
        before = self.get(layer, number)
        self.layer(layer).update(number, item)
        after = self.layer(layer).get(number)
        self.changes.append(Change(layer, number, before, after))

    def remove(self, layer: str, number: int) -> None:
        """Remove an object; raises like `get`."""
        before = self.get(layer, number)
        self.layer(layer).remove([number])
        self.changes.append(Change(layer, number, before, None))

    def put_note(self, layer: str, note: Note) -> int:
        """Add a note, its place in the layer's frame, or replace the one with its id.

        Returns:
            Its id.

        Raises:
            ObjectNotFound: If it has an id, and the layer has no such note.
        """
        before = None if note.id is None else self.get_note(layer, note.id)
        if before is not None and before.id is not None:
            self.notes(layer).remove(before.id)
        number = self.notes(layer).add(note)
        self.changes.append(Change(layer, number, before, self.notes(layer)[number]))
        return number

    def get_note(self, layer: str, number: int) -> Note:
        """Return a note in order to change it; raises like `get`."""
        self._check(layer, number)
        return self.notes(layer)[number]

    def remove_note(self, layer: str, number: int) -> None:
        """Remove a note; raises like `get`."""
        before = self.get_note(layer, number)
        self.notes(layer).remove(number)
        self.changes.append(Change(layer, number, before, None))

    def add_notes_layer(self, name: str) -> None:
        """Add an empty layer of notes in the base frame.

        Raises:
            HypermapError: If there is a layer of that name.
        """
        if name in self.hypermap:
            raise HypermapError(f"layer {name!r} already exists; choose another name for notes")
        self._notes[name] = NotesLayer(name, self.hypermap.base_frame)
        self._replace_layers([*self.hypermap, self._notes[name]])
        self.changes.append(LayerChange(name, True, has_notes=True))

    def add_layer(self, name: str) -> None:
        """Add an empty semantic layer in the base frame, drawn beneath other objects.

        Raises:
            HypermapError: If there is one of that name.
        """
        if name in self.hypermap:
            raise HypermapError(
                f"layer {name!r} already exists; draw on it, or choose another name"
            )
        self._own[name] = SemanticLayer(name, self.hypermap.base_frame)
        layers = list(self.hypermap)
        kinds = [isinstance(layer, SemanticLayer) for layer in layers]
        layers.insert(kinds.index(True) if True in kinds else len(layers), self._own[name])
        self._replace_layers(layers)
        self.changes.append(LayerChange(name, True))

    def remove_layer(self, name: str) -> None:
        """Remove a layer that was added without objects.

        Raises:
            LayerNotFound: If there is none of that name.
        """
        removed = self.hypermap[name]
        self._own.pop(name, None)
        self._notes.pop(name, None)
        self._replace_layers([layer for layer in self.hypermap if layer is not removed])
        self.changes.append(LayerChange(name, False, isinstance(removed, NotesLayer)))

    def apply(self, change: AnyChange) -> None:
        """Make a change."""
        if isinstance(change, LayerChange):
            add = self.add_notes_layer if change.has_notes else self.add_layer
            (add if change.is_there else self.remove_layer)(change.layer)
        elif isinstance(change.before or change.after, Note):
            self._apply_to_note(change)
        elif change.after is None:
            self.remove(change.layer, change.id)
        elif isinstance(change.after, SemanticObject) and change.before is None:
            self.add(change.layer, change.after)
        elif isinstance(change.after, SemanticObject):
            self.update(change.layer, change.id, change.after)

    def _apply_to_note(self, change: Change) -> None:
        """Make a change of a note, so that it is as it was or will be, to the second."""
        if change.before is not None:
            self.notes(change.layer).remove(change.id)
        if isinstance(change.after, Note):
            self.notes(change.layer).add(change.after)
        self.changes.append(change)

    def notes(self, name: str) -> NotesLayer:
        """Return a copy of a layer of notes that may be changed.

        Raises:
            LayerNotFound: If there is none of that name.
            HypermapError: If it is of a different kind.
        """
        if name not in self._notes:
            self._notes[name] = self.hypermap.layer(name, NotesLayer).copy()
            self.hypermap = self.hypermap.with_layer(self._notes[name])
        return self._notes[name]

    def layer(self, name: str) -> SemanticLayer:
        """Return a copy of a layer that may be changed.

        Raises:
            LayerNotFound: If there is none of that name.
            HypermapError: If it has no objects.
        """
        if name not in self._own:
            layer = self.hypermap[name]
            if not isinstance(layer, SemanticLayer):
                raise HypermapError(f"layer {name!r} has no objects; only those can be edited")
            self._own[name] = layer.copy()
            self.hypermap = self.hypermap.with_layer(self._own[name])
        return self._own[name]

    def _replace_layers(self, layers: Iterable[Layer]) -> None:
        self.hypermap = self.hypermap.with_layers(layers)
