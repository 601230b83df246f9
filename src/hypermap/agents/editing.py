"""The tools that edit a map."""

# Annotations are values here, out of which the schemas of the tools are made.

from collections.abc import Callable
from typing import Annotated, Any

from pydantic import Field

from hypermap.agents.looking import Name, Point
from hypermap.agents.open_map import OpenMap
from hypermap.agents.shown import layer_of_object
from hypermap.core.notes_layer import NotesLayer
from hypermap.notes.on_map import NOTES
from hypermap.viewer.live.changes import Draft
from hypermap.viewer.live.editing import apply_operation

_ZONES = "zones"  # the layer of zones, where no other is named

Id = Annotated[int, Field(ge=0, description="of the object")]
LayerName = Annotated[Name | None, Field(description="if several layers have such an object")]


class Editing:
    """The tools that edit a map; each public method is one, and saves the map at once.

    Objects that were edited are marked, so that mapping leaves them as they are. The file before
    the first edit is kept as MAP.bak.

    Args:
        opened: the map.
    """

    def __init__(self, opened: OpenMap) -> None:
        self._opened = opened

    def add_zone(
        self,
        *,
        name: Name,
        corners: Annotated[
            list[Point], Field(min_length=3, max_length=200, description="as [[x, y], ...] [m]")
        ],
        layer: Annotated[Name, Field(description="added to the map if missing")] = _ZONES,
    ) -> dict[str, Any]:
        """Add a zone, such as a keepout, and save the map."""
        made: list[int | None] = []

        def change(draft: Draft) -> None:
            if layer not in draft.hypermap:
                draft.add_layer(layer)
            polygon = [list(corner) for corner in corners]
            operation = {"op": "add", "layer": layer, "name": name, "polygon": polygon}
            made.append(apply_operation(draft, operation))

        self._opened.edit(change)
        return {"id": made[0], "layer": layer, "name": name}

    def add_note(
        self,
        *,
        text: Annotated[str, Field(min_length=1, max_length=20_000, description="in Markdown")],
        point: Annotated[Point, Field(description="where, as [x, y] [m]")],
        author: Annotated[Name, Field(description="who writes it")] = "agent",
    ) -> dict[str, Any]:
        """Leave a note at a place for people and robots, and save the map."""
        made: list[tuple[str, int | None]] = []

        def change(draft: Draft) -> None:
            layers = [each.name for each in draft.hypermap if isinstance(each, NotesLayer)]
            layer = layers[0] if layers else NOTES
            note = {"text": text, "author": author, "point": list(point)}
            operation = {"op": "add_note", "layer": layer, **note}
            made.append((layer, apply_operation(draft, operation)))

        self._opened.edit(change)
        return {"layer": made[0][0], "id": made[0][1]}

    def rename(self, *, id: Id, name: Name, layer: LayerName = None) -> dict[str, Any]:  # noqa: A002
        """Give an object or a room another name, and save the map."""
        before = self._update(id, layer, lambda where: {"op": "update", "name": name} | where)
        return before | {"renamed_to": name}

    def mark_gone(self, *, id: Id, layer: LayerName = None) -> dict[str, Any]:  # noqa: A002
        """Remove an object that is no longer there, and save the map."""
        return self._update(id, layer, lambda where: {"op": "remove"} | where) | {"removed": True}

    def _update(
        self, number: int, layer: str | None, operation: Callable[[dict[str, Any]], dict[str, Any]]
    ) -> dict[str, Any]:
        """Apply an operation to one object, and return what it was."""
        known: dict[str, Any] = {}

        def change(draft: Draft) -> None:
            where = layer or layer_of_object(draft.hypermap, number)
            known.update(id=number, layer=where, name=draft.get(where, number).name)
            apply_operation(draft, operation({"layer": where, "id": number}))

        self._opened.edit(change)
        return known
