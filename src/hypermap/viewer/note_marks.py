"""Notes in a picture: a mark with the note's number at each place, and its title in the legend."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from shapely.geometry.base import BaseGeometry

from hypermap.core.hypermap import Hypermap
from hypermap.core.layer import Layer
from hypermap.core.notes_layer import NotesLayer
from hypermap.notes.on_map import point_of


@dataclass(frozen=True)
class Mark:
    """A note in the picture's frame.

    Attributes:
        layer: heading in the legend.
        number: the note's id.
        title: shown next to the number in the legend.
        x: of the mark [m].
        y: of the mark [m].
        area: which the note is about; None for a point.
    """

    layer: str
    number: int
    title: str
    x: float
    y: float
    area: BaseGeometry | None


def marks_of(hypermap: Hypermap, shown: Iterable[Layer]) -> tuple[Mark, ...]:
    """Return the notes of some layers of a map, brought into its base frame."""
    marks = []
    for layer in shown:
        if not isinstance(layer, NotesLayer):
            continue
        base_T_layer = hypermap.frames.lookup(hypermap.base_frame, layer.frame_id)
        for note in layer:
            placed = note.moved(base_T_layer)
            x, y = point_of(placed)
            area = placed.place if placed.place.area > 0 else None
            marks.append(Mark(layer.name, note.id or 0, note.title, x, y, area))
    return tuple(marks)
