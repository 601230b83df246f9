"""Object search: by name and by place: near, within, inside, in an area."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import shapely

from hypermap.core.found import FoundObject
from hypermap.core.hypermap import ROOMS, Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.questions.answer import ask
from hypermap.questions.frames import pose_of_frame
from hypermap.questions.query import Condition, Query, Reference
from hypermap.viewer.live.names import similar_names
from hypermap.viewer.live.request_errors import Refused
from hypermap.viewer.live.requests import corners_in, number_in, text_in, whole_number_in
from hypermap.viewer.live.room_names import means_rooms, names_of_rooms
from hypermap.viewer.live.snippets import AskedMap, snippets_for_search

MOST_FOUND = 5000
"""How many rows an answer has at most."""
_FOUND = 100  # rows, unless another limit is given


@dataclass(frozen=True)
class Search:
    """A search for objects; None where there is no condition.

    Attributes:
        name: the name of the objects.
        near: a name, or a point [m], from which the distance is measured.
        within: the largest distance [m].
        inside: the name of the object that contains them.
        corners: of a polygon that they intersect [m].
        frame: of point and polygon; None for the base frame.
        limit: the maximum number of rows in the answer.
    """

    name: str | None = None
    near: str | tuple[float, float] | None = None
    within: float | None = None
    inside: str | None = None
    corners: Sequence[Sequence[float]] | None = None
    frame: str | None = None
    limit: int = _FOUND

    def as_query(self, hypermap: Hypermap) -> Query:
        """Return the search as a query, in the base frame of the map.

        Raises:
            FrameError: If the frame is unknown.
        """
        pose = pose_of_frame(hypermap, self.frame)
        near = None
        if isinstance(self.near, str):
            near = Reference(names=(self.near,))
        elif self.near is not None:
            x, y = pose.apply(self.near)[0].tolist()
            near = Reference(point_xy=(x, y))
        where = []
        if self.corners is not None:
            area = pose.apply_geometry(shapely.Polygon(self.corners))
            where.append(Condition("at", Reference(area=shapely.to_wkt(area, -1))))
        if self.inside is not None:
            where.append(Condition("in", Reference(names=(self.inside,))))
        if near is not None and self.within is not None:
            where.append(Condition("near", near, self.within))
        return Query(
            "objects" if near is None else "distance",
            () if self.name is None else (self.name,),
            exact=True,
            where=tuple(where),
            start=near,
        )


def search_in(values: Mapping[str, Any], hypermap: Hypermap) -> Search:
    """Return the search of a request.

    Raises:
        Refused: If there is no condition, or a wrong one.
    """
    limit = whole_number_in(values, "limit") if "limit" in values else _FOUND
    if not 1 <= limit <= MOST_FOUND:
        raise Refused(f"limit: must be from 1 to {MOST_FOUND}, got {limit}")
    near = text_in(values, "near")
    within = number_in(values, "within") if values.get("within") else None
    if within is not None and near is None:
        raise Refused("within: needs near, from which the distance is measured")
    if within is not None and within < 0:
        raise Refused(f"within: must not be negative, got {within:g}")
    search = Search(
        name=text_in(values, "name"),
        near=None if near is None else _place_or_name(near, hypermap),
        within=within,
        inside=text_in(values, "inside"),
        corners=corners_in(values, "polygon") if values.get("polygon") else None,
        frame=text_in(values, "frame"),
        limit=limit,
    )
    is_near = isinstance(search.near, str) or within is not None
    if not (search.name or is_near or search.inside or search.corners):
        raise Refused("name: missing; give name, near, inside or polygon")
    return search


def find(hypermap: Hypermap, asked: AskedMap, search: Search) -> dict[str, Any]:
    """Return the objects that meet all conditions, as the page shows them.

    With `near`, the nearest come first. `name`, `near` and `inside` are returned as they were
    understood: if no object has exactly this name, the only similar one is taken. `unknown` lists
    the names that were not found, each with the similar ones.

    Raises:
        FrameError: If the frame is unknown.
    """
    known = known_names(hypermap)
    unknown: dict[str, list[str]] = {}

    def meant(said: str | None) -> str | None:
        if said is None or said in known:
            return said
        unknown[said] = similar_names(said, known)
        return unknown[said][0] if len(unknown[said]) == 1 else said

    near = meant(search.near) if isinstance(search.near, str) else search.near
    is_room = search.inside is not None and means_rooms(hypermap, search.inside)
    inside = search.inside if is_room else meant(search.inside)
    understood = replace(search, name=meant(search.name), near=near, inside=inside)
    answer = ask(hypermap, understood.as_query(hypermap))
    return {
        "name": understood.name,
        "near": understood.near,
        "inside": understood.inside,
        "rows": rows_of(hypermap, answer.first(search.limit)),
        "total": answer.count,
        "names": [] if search.name is None else similar_names(search.name, known),
        "unknown": unknown,
        **snippets_for_search(
            asked,
            understood.name,
            near=understood.near,
            within=search.within,
            inside=understood.inside,
            corners=search.corners,
            frame=search.frame,
        ),
    }


def rows_of(hypermap: Hypermap, found: Sequence[FoundObject]) -> list[dict[str, Any]]:
    """Return a row for each object, with its place in the base frame and its room."""
    rooms = names_of_rooms(hypermap, [item.point_xy for item in found])
    return [_row(item, room) for item, room in zip(found, rooms, strict=True)]


def _row(found: FoundObject, room: str | None) -> dict[str, Any]:
    x, y = found.point_xy
    of_room = {} if room is None or found.layer == ROOMS else {"room": room}
    return {
        "layer": found.layer,
        "id": found.object.id,
        "name": found.object.name,
        "x": float(x),
        "y": float(y),
        "distance": found.distance,
        **of_room,
    }


def known_names(hypermap: Hypermap) -> list[str]:
    """Return the sorted names of all objects in layers that a transform places."""
    layers = [layer for layer in hypermap.placed_layers() if isinstance(layer, SemanticLayer)]
    return sorted({name for layer in layers for name in layer.table.names_in_use})


def _place_or_name(text: str, hypermap: Hypermap) -> str | tuple[float, float]:
    """Return a point "x,y", or the text as it is where it is, or could be, a name."""
    if not re.fullmatch(r"[-+.,\d\seE]*", text) or text in known_names(hypermap):
        return text
    try:
        x, y = (number_in({"near": part}, "near") for part in text.split(","))
    except ValueError:
        raise Refused(f"near: a point x,y is expected, got {text[:60]!r}") from None
    return x, y
