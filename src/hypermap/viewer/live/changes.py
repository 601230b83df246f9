"""Changes of a map as values: what was before, and what is after."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.core.objects import SemanticObject
from hypermap.core.semantic import SemanticLayer


@dataclass(frozen=True)
class Change:
    """One object that was added, replaced or removed.

    Attributes:
        layer: name of the layer that holds it.
        id: the object's.
        before: None if it was not there.
        after: None if it is there no more.
    """

    layer: str
    id: int
    before: SemanticObject | None
    after: SemanticObject | None

    def inverse(self) -> Change:
        """Return the change that undoes this one."""
        return Change(self.layer, self.id, self.after, self.before)


@dataclass(frozen=True)
class LayerChange:
    """A layer without objects that was added or removed.

    Attributes:
        layer: its name.
        is_there: after the change.
    """

    layer: str
    is_there: bool

    def inverse(self) -> LayerChange:
        """Return the change that undoes this one."""
        return LayerChange(self.layer, not self.is_there)


AnyChange: TypeAlias = Change | LayerChange


def undoing(changes: Sequence[AnyChange]) -> list[AnyChange]:
    """Return the changes that undo some, the last one first."""
    return [change.inverse() for change in reversed(changes)]


def applied(hypermap: Hypermap, changes: Iterable[AnyChange]) -> Hypermap:
    """Return a map with changes made; the given one stays as it is.

    Raises:
        LayerNotFound, ObjectNotFound: If there is no such layer or object.
    """
    draft = Draft(hypermap)
    for change in changes:
        draft.apply(change)
    return draft.hypermap


class Draft:
    """A map that is being changed beside the one from which it began.

    Attributes:
        hypermap: as it is so far.
        changes: all that were made, in their order.
    """

    def __init__(
        self, hypermap: Hypermap, check: Callable[[str, int], None] = lambda _layer, _id: None
    ) -> None:
        """Begin with a map; `check` raises for the layer and id of what must not be changed."""
        self.hypermap = hypermap
        self.changes: list[AnyChange] = []
        self._check = check
        self._own: dict[str, SemanticLayer] = {}

    def add(self, layer: str, item: SemanticObject) -> int:
        """Add an object, its footprint in the layer's frame, and return its id."""
        (number,) = self.layer(layer).add([item])
        self.changes.append(Change(layer, number, None, self.layer(layer).get(number)))
        return number

    def get(self, layer: str, number: int) -> SemanticObject:
        """Return an object that is about to be changed.

        Raises:
            ObjectNotFound: If it is not there.
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

    def add_layer(self, name: str) -> None:
        """Add a layer without objects, in the base frame, to be drawn beneath other objects.

        Raises:
            HypermapError: If there is one of that name.
        """
        if name in self.hypermap:
            raise HypermapError(f"there is a layer {name!r} already; draw on it, or name another")
        self._own[name] = SemanticLayer(name, self.hypermap.base_frame)
        layers = list(self.hypermap)
        kinds = [isinstance(layer, SemanticLayer) for layer in layers]
        layers.insert(kinds.index(True) if True in kinds else len(layers), self._own[name])
        self._replace_layers(layers)
        self.changes.append(LayerChange(name, True))

    def remove_layer(self, name: str) -> None:
        """Take a layer away that was added without objects.

        Raises:
            LayerNotFound: If there is none of that name.
        """
        gone = self.hypermap[name]
        self._own.pop(name, None)
        self._replace_layers([layer for layer in self.hypermap if layer is not gone])
        self.changes.append(LayerChange(name, False))

    def apply(self, change: AnyChange) -> None:
        """Make a change."""
        if isinstance(change, LayerChange):
            (self.add_layer if change.is_there else self.remove_layer)(change.layer)
        elif change.after is None:
            self.remove(change.layer, change.id)
        elif change.before is None:
            self.add(change.layer, change.after)
        else:
            self.update(change.layer, change.id, change.after)

    def layer(self, name: str) -> SemanticLayer:
        """Return a layer that may be changed.

        Raises:
            LayerNotFound: If there is none of that name.
            HypermapError: If it holds no objects.
        """
        if name not in self._own:
            layer = self.hypermap[name]
            if not isinstance(layer, SemanticLayer):
                raise HypermapError(f"layer {name!r} holds no objects; only those can be edited")
            self._own[name] = layer.copy()
            self.hypermap = self.hypermap.with_layer(self._own[name])
        return self._own[name]

    def _replace_layers(self, layers: Iterable[Layer]) -> None:
        self.hypermap = Hypermap(layers, self.hypermap.frames, self.hypermap.metadata)
