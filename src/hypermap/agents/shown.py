"""Objects, rooms, doors, places and times as JSON values."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timezone
from typing import Any

import numpy as np
import shapely

from hypermap.core.errors import HypermapError
from hypermap.core.history import Change, Revision
from hypermap.core.hypermap import FoundObject, Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.questions.times import are_calendar
from hypermap.rooms.questions import rooms_of_objects
from hypermap.rooms.rooms import Door, Room, Rooms

_MOST_CORNERS = 60  # of a path


def answer_of(hypermap: Hypermap, **parts: Any) -> dict[str, Any]:
    """Return an answer, with the frame and the unit of all lengths."""
    return {"frame_id": hypermap.base_frame, "unit": "m", **parts}


def object_rows(hypermap: Hypermap, found: Sequence[FoundObject]) -> list[dict[str, Any]]:
    """Return objects as JSON values: who, where, in which room, how sure and when."""
    there = rooms_of_objects(hypermap, found)
    return [_row(item, room) for item, room in zip(found, there, strict=True)]


def _row(item: FoundObject, room: Room | None) -> dict[str, Any]:
    thing = item.object
    x, y = place(item.point_xy)
    row: dict[str, Any] = {"id": thing.id, "name": str(thing.name), "layer": item.layer}
    row |= {"x": x, "y": y, "area": round(float(thing.footprint.area), 3)}
    if room is not None:
        row["room"] = room.name
    if item.distance is not None:
        row["distance"] = round(item.distance, 2)
    if thing.probability is not None:
        row["probability"] = round(thing.probability, 3)
    if thing.last_seen is not None:
        row["last_seen"] = time_text(thing.last_seen)
    return row


def change_row(revision: Revision, change: Change) -> dict[str, Any]:
    """Return a change as JSON values: of what, from where to where, when and by what."""
    row: dict[str, Any] = {"change": change.kind, "layer": change.layer}
    for state, thing in (("before", change.before), ("after", change.after)):
        if thing is not None:
            row[state] = {"id": thing.id, "name": str(thing.name)}
            row[state] |= dict(zip("xy", place(thing.footprint.centroid.coords[0]), strict=True))
    if change.distance is not None:
        row["distance"] = round(change.distance, 2)
    if change.confidence is not None:
        row["confidence"] = round(change.confidence, 3)
    row |= {"version": revision.version, "cause": revision.cause}
    if revision.time is not None:
        row["time"] = time_text(revision.time)
    return row | ({"drive": revision.drive} if revision.drive else {})


def room_row(room: Room | None) -> dict[str, Any] | None:
    """Return a room, with a point in it."""
    if room is None:
        return None
    x, y = place(room.outline.representative_point().coords[0])
    shown = {"id": room.id, "name": room.name, "kind": room.kind or None}
    return shown | {"x": x, "y": y, "area": round(room.area, 2)}


def door_row(rooms: Rooms, door: Door) -> dict[str, Any]:
    """Return a door, with the names of both rooms."""
    x, y = place(door.place_xy)
    names = [rooms[number].name for number in door.rooms]
    return {"rooms": names, "x": x, "y": y, "width": round(door.width, 2)}


def place(point: Any) -> list[float]:
    """Return x and y, to the centimeter."""
    return [round(float(number), 2) for number in point]


def few_corners(points_xy: Any) -> Any:
    """Return the corners of a line, and of one with many those that make out its shape."""
    line, tolerance = shapely.LineString(points_xy), 0.01
    while len(points_xy) > _MOST_CORNERS:
        points_xy = np.asarray(line.simplify(tolerance).coords)
        tolerance *= 2
    return points_xy


def time_text(stamp: float) -> str | float:
    """Return a time as people write it; the stamp [s] where its clock is none of a calendar."""
    if not are_calendar([stamp]):
        return round(stamp, 2)
    return datetime.fromtimestamp(stamp, timezone.utc).isoformat(timespec="seconds")


def layer_of_object(hypermap: Hypermap, number: int) -> str:
    """Return the name of the only layer that has an object with that id.

    Raises:
        HypermapError: If there is none, or several have one.
    """
    layers = [one for one in hypermap if isinstance(one, SemanticLayer)]
    names = [one.name for one in layers if number in one.ids]
    if len(names) != 1:
        what = f"layers {', '.join(names)} have an" if names else "there is no"
        raise HypermapError(f"{what} object {number}" + ("; name the layer" if names else ""))
    return names[0]
