"""Notes of a whole map, in its base frame."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.core.arguments import check_kind
from hypermap.core.arrays import PointsLike, as_point_xy
from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.notes import Note
from hypermap.core.notes_layer import NotesLayer

NOTES = "notes"
"""Name of the layer that is made for the first note of a map."""


@dataclass(frozen=True)
class FoundNote:
    """A note that was found.

    Attributes:
        layer: name of its layer.
        note: with its place in the base frame.
        distance: from its place to the point of the query [m]; None without one.
    """

    layer: str
    note: Note
    distance: float | None = None


def find_notes(
    hypermap: Hypermap,
    words: str = "",
    *,
    area: BaseGeometry | None = None,
    near: PointsLike | None = None,
    within: float | None = None,
    since: datetime | None = None,
    until: datetime | None = None,
    author: str = "",
    layer: str | None = None,
    frame_id: str | None = None,
) -> list[FoundNote]:
    """Return the notes that meet all conditions.

    Args:
        hypermap: the map.
        words: each is in the text, the author or the names of what is attached, in any case.
        area: which the place meets.
        near: a point from which distances are measured.
        within: the largest distance to it [m]; None for any.
        since: the time of the note is not before.
        until: the time of the note is not after.
        author: in any case.
        layer: only notes of this layer; None for all that are connected to the base frame.
        frame_id: frame of the area and the point; None for the base frame.

    Returns:
        With `near` the nearest first, otherwise in the order of the layers and ids.

    Raises:
        LayerNotFound, FrameError: If the layer or the frame is unknown.
        HypermapError: If the layer is of a different kind.
        TypeError: If it is not a map.
    """
    check_kind(hypermap, Hypermap)
    base = hypermap.base_frame
    base_T_asked = hypermap.frames.lookup(base, frame_id or base)
    in_base = None if area is None else base_T_asked.apply_geometry(area)
    point = None
    if near is not None:
        point = shapely.Point(base_T_asked.apply(as_point_xy(near))[0])
    found = []
    for each in _layers(hypermap, layer):
        base_T_layer = hypermap.frames.lookup(base, each.frame_id)
        asked = None if in_base is None else base_T_layer.inverse().apply_geometry(in_base)
        for note in each.search(words, area=asked, since=since, until=until, author=author):
            placed = note.moved(base_T_layer)
            distance = None if point is None else float(placed.place.distance(point))
            if within is None or (distance is not None and distance <= within):
                found.append(FoundNote(each.name, placed, distance))
    return found if point is None else sorted(found, key=lambda hit: hit.distance or 0.0)


def notes_layer(hypermap: Hypermap, name: str | None = None) -> NotesLayer:
    """Return the layer of notes with this name, or the only one.

    Raises:
        LayerNotFound: If there is none of that name.
        HypermapError: If it is of a different kind, or the map has none, or several without a name.
    """
    if name is not None:
        return hypermap.layer(name, NotesLayer)
    layers = [layer for layer in hypermap if isinstance(layer, NotesLayer)]
    if len(layers) != 1:
        names = ", ".join(layer.name for layer in layers)
        hint = f"name one of {names}" if names else "there is none"
        raise HypermapError(f"the map has {len(layers)} layers of notes; {hint}")
    return layers[0]


def add_note(
    hypermap: Hypermap, note: Note, layer: str | None = None, frame_id: str | None = None
) -> FoundNote:
    """Add a note to a map; its first one makes the layer "notes".

    Args:
        hypermap: the map.
        note: what to add; it gets an id.
        layer: to which; None for the only layer of notes, or a new one.
        frame_id: frame of its place; None for the base frame.

    Returns:
        The note as it was found afterwards, in the base frame.

    Raises:
        FrameError: If the frame is unknown.
        HypermapError: If the layer is of a different kind, or there are several and none is named.
        TypeError: If it is not a map, or not a note.
    """
    check_kind(hypermap, Hypermap)
    check_kind(note, Note)
    base = hypermap.base_frame
    base_T_asked = hypermap.frames.lookup(base, frame_id or base)
    in_base = note.moved(base_T_asked)
    target = layer_to_add_to(hypermap, layer)
    layer_T_base = hypermap.frames.lookup(target.frame_id, base)
    number = target.add(in_base.moved(layer_T_base))
    kept = target[number]
    return FoundNote(target.name, kept.with_place(in_base.place))


def layer_to_add_to(hypermap: Hypermap, name: str | None = None) -> NotesLayer:
    """Return the layer of that name, or the only one; where there is none, it is made.

    Raises:
        HypermapError: If the layer is of a different kind, or there are several and none is named.
    """
    has_none = not any(isinstance(layer, NotesLayer) for layer in hypermap)
    if (has_none and name is None) or (name is not None and name not in hypermap):
        hypermap.add(NotesLayer(name or NOTES, hypermap.base_frame))
        return hypermap.layer(name or NOTES, NotesLayer)
    return notes_layer(hypermap, name)


def _layers(hypermap: Hypermap, name: str | None) -> list[NotesLayer]:
    if name is not None:
        return [hypermap.layer(name, NotesLayer)]
    return [layer for layer in hypermap.placed_layers() if isinstance(layer, NotesLayer)]


def point_of(note: Note) -> tuple[float, float]:
    """Return where a note is marked: at its point, or at a point within its area [m]."""
    point = note.place.representative_point()
    x, y = np.round([point.x, point.y], 9).tolist()
    return x, y


def described(found: FoundNote) -> dict[str, Any]:
    """Return a note as programs take it, its place in the base frame of the map."""
    note = found.note
    x, y = point_of(note)
    return {
        "id": note.id,
        "layer": found.layer,
        "title": note.title,
        "text": note.text,
        "author": note.author,
        "time": note.time.isoformat(),
        "changed": None if note.changed is None else note.changed.isoformat(),
        "x": x,
        "y": y,
        "place": shapely.to_wkt(note.place, rounding_precision=6),
        "links": list(note.links),
        "files": [
            {
                "name": each.name,
                "kind": each.kind,
                "media_type": each.media_type,
                "size": each.size,
                "sha256": each.sha256,
                "is_there": each.is_there,
            }
            for each in note.attachments
        ],
        **({} if found.distance is None else {"distance": found.distance}),
    }
