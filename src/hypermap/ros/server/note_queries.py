"""The services about notes; see hypermap_msgs/srv/FindNotes.srv and AddNote.srv."""

from __future__ import annotations

from datetime import datetime

import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.core.errors import HypermapError, NoteError
from hypermap.core.hypermap import Hypermap
from hypermap.core.iso_times import time_from_iso
from hypermap.core.layer import Layer
from hypermap.core.notes import Note, now
from hypermap.core.notes_layer import NotesLayer
from hypermap.notes import find_notes
from hypermap.notes.on_map import NOTES, notes_layer
from hypermap.ros.messages.from_messages import is_empty_area
from hypermap.ros.messages.note_messages import attachment_of_message, note_message
from hypermap.ros.port import Message, Port
from hypermap.ros.server.current_map import CurrentMap
from hypermap.ros.server.layer_topics import is_set
from hypermap.ros.server.requests import Requests


class NoteQueries:
    """Finds notes, and adds some; all raise HypermapError."""

    def __init__(self, port: Port, current: CurrentMap, requests: Requests) -> None:
        self._port = port
        self._current = current
        self._requests = requests

    def find(self, request: Message) -> Message:
        """Answer `hypermap_msgs/FindNotes`."""
        hypermap = self._current.hypermap
        near, within = None, None
        if request.origin.header.frame_id:
            near = self._requests.point(hypermap, request.origin)[0]
            within = float(request.within) or None
        found = find_notes(
            hypermap,
            str(request.words),
            area=self._requests.area_or_all(hypermap, request.area),
            near=near,
            within=within,
            since=_time(request.since),
            until=_time(request.until),
            author=str(request.author),
            layer=str(request.layer) or None,
        )
        with_content = bool(request.with_content)
        return self._port.response("hypermap_msgs/FindNotes")(
            success=True,
            message="",
            frame_id=hypermap.base_frame,
            notes=[note_message(each, self._port, with_content=with_content) for each in found],
        )

    def add(self, request: Message) -> Message:
        """Answer `hypermap_msgs/AddNote`; the map gets a new layer, so that none sees half of it.

        Raises:
            HypermapError: If the layer takes no updates, as its `enable_update` says, or there can
                be no such note.
        """
        made: list[tuple[str, int]] = []

        def added(hypermap: Hypermap) -> Layer:
            layer = _layer_of(hypermap, str(request.layer) or None)
            note = self._note(hypermap, layer, request)
            made.append((layer.name, layer.add(note)))
            return layer

        self._current.put(added)
        layer, number = made[0]
        response = self._port.response("hypermap_msgs/AddNote")
        return response(success=True, message="", id=number, layer=layer)

    def _note(self, hypermap: Hypermap, layer: NotesLayer, request: Message) -> Note:
        if is_empty_area(request.area):
            point = self._requests.point(hypermap, request.location)[0]
            place: BaseGeometry = shapely.Point(point)
        else:
            place = self._requests.area(hypermap, request.area)
        layer_T_base = hypermap.frames.lookup(layer.frame_id, hypermap.base_frame)
        return Note(
            layer_T_base.apply_geometry(place),
            str(request.text),
            str(request.author),
            _time(request.time) or now(),
            tuple(map(attachment_of_message, request.files)),
            tuple(map(str, request.links)),
        )


def _layer_of(hypermap: Hypermap, name: str | None) -> NotesLayer:
    """Return a copy of the layer that a note goes to, or a new one."""
    has_none = not any(isinstance(layer, NotesLayer) for layer in hypermap)
    if (name is None and has_none) or (name is not None and name not in hypermap):
        return NotesLayer(name or NOTES, hypermap.base_frame)
    layer = notes_layer(hypermap, name)
    if not is_set(layer, "enable_update"):
        raise HypermapError(
            f"layer {layer.name!r} takes no notes because its enable_update is false"
        )
    return layer.copy()


def _time(text: str) -> datetime | None:
    """Return a time of a request; None where it is empty."""
    if not text:
        return None
    try:
        moment = time_from_iso(text)
    except ValueError:
        raise NoteError(f"{text[:40]!r} is not a time such as 2026-03-02T12:00:00+01:00") from None
    if moment.tzinfo is None:
        raise NoteError(
            f"the time {text[:40]!r} has no time zone, unlike 2026-03-02T12:00:00+01:00"
        )
    return moment
