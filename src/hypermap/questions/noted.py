"""Notes in answers: what a layer of notes says at a place."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import PointsLike
from hypermap.core.hypermap import Hypermap
from hypermap.core.notes_layer import NotesLayer
from hypermap.notes import FoundNote, described, find_notes
from hypermap.questions.cells import Cell


def notes_at(hypermap: Hypermap, layer: NotesLayer, point_xy: PointsLike) -> list[Cell]:
    """Return the notes at a point of the base frame, the first ones first."""
    base_T_layer = hypermap.frames.lookup(hypermap.base_frame, layer.frame_id)
    notes = layer.notes_at(base_T_layer.inverse().apply(point_xy))
    placed = (note.moved(base_T_layer) for note in notes)
    return list(_cells(FoundNote(layer.name, note) for note in placed))


def notes_in(
    hypermap: Hypermap,
    layer: NotesLayer,
    what: Sequence[str | float],
    area: BaseGeometry | None,
    start: NDArray[np.float64] | None,
) -> Iterator[Cell]:
    """Yield the notes with some titles or ids, or all of an area; arguments as of `cells_in`."""
    if what or area is not None:
        found = find_notes(hypermap, area=area, near=start, layer=layer.name)
        yield from _cells(
            each for each in found if not what or {each.note.title, each.note.id} & set(what)
        )


def _cells(found: Iterable[FoundNote]) -> Iterator[Cell]:
    for each in found:
        note = described(each)
        at = np.array([note["x"], note["y"]])
        yield Cell(each.layer, note["title"], note["id"], at, each.distance, {"note": note})
