"""Route graphs as Nav2's route server reads them: GeoJSON with nodes and directed edges.

A node is a Point with `id` and `frame`, an edge a MultiLineString with `id`, `startid`, `endid`,
`cost` and `overridable`. Ids are unique in the file. Both carry `metadata`: texts, numbers,
booleans, lists of these, and mappings. The route server takes coordinates as meters in `frame`;
`crs` is the one that its own files name for QGIS.

Source: the README of nav2_route and its GeoJsonGraphFileLoader.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import shapely

from hypermap.formats.letters import check_savable
from hypermap.paths.routes import RouteGraph
from hypermap.rooms.rooms import Door, Room

_CRS = "urn:ogc:def:crs:EPSG::3857"
_DECIMALS = 6  # of a meter


def to_nav2_routes(graph: RouteGraph) -> str:
    """Return a route graph as the text of a file for Nav2's route server.

    Each edge is there twice, once for each direction; its cost is its length [m].

    Raises:
        HypermapError: If the name of a room or frame holds half of a character.
    """
    features = ",\n".join(
        json.dumps(feature, ensure_ascii=False, allow_nan=False)
        for feature in (*_nodes(graph), *_edges(graph))
    )
    check_savable(features, "the route graph")
    crs = json.dumps({"type": "name", "properties": {"name": _CRS}})
    return (
        '{"type": "FeatureCollection", "name": "route graph",\n'
        f'"crs": {crs},\n"features": [\n{features}\n]}}\n'
    )


def _nodes(graph: RouteGraph) -> Iterator[dict[str, Any]]:
    names = {stop.id: stop.name for stop in graph.stops if isinstance(stop, Room)}
    names |= {room.id: room.name for room in graph.rooms}
    for number, (point, stop) in enumerate(zip(graph.points_xy, graph.stops, strict=True)):
        yield _feature(
            {"type": "Point", "coordinates": _point(point)},
            {"id": number, "frame": graph.frame_id, "metadata": _described(stop, names)},
        )


def _edges(graph: RouteGraph) -> Iterator[dict[str, Any]]:
    number = len(graph.stops)
    for (one, other), length, room in zip(
        graph.edges.tolist(), graph.lengths.tolist(), graph.rooms, strict=True
    ):
        metadata = {"class": room.kind or "room", "room": room.id, "name": room.name}
        for start, end in ((one, other), (other, one)):
            line = [_point(graph.points_xy[node]) for node in (start, end)]
            yield _feature(
                {"type": "MultiLineString", "coordinates": [line]},
                {
                    "id": number,
                    "startid": start,
                    "endid": end,
                    "cost": round(length, _DECIMALS),
                    "overridable": True,
                    "metadata": metadata,
                },
            )
            number += 1


def _described(stop: Room | Door | None, names: dict[int, str]) -> dict[str, Any]:
    """Return the metadata of a node."""
    if isinstance(stop, Room):
        largest = max(shapely.get_parts(stop.outline), key=shapely.area)
        x, y = shapely.get_coordinates(largest.exterior).round(_DECIMALS).T.tolist()
        return {
            "type": "room",
            "room": stop.id,
            "name": stop.name,
            "kind": stop.kind,
            "area": round(stop.area, 3),
            "outline": {"x_values": x, "y_values": y},
        }
    if isinstance(stop, Door):
        return {
            "type": "door",
            "class": "door",
            "rooms": list(stop.rooms),
            "names": [names.get(number, "") for number in stop.rooms],
            "width": round(stop.width, 3),
        }
    return {"type": "turn"}


def _feature(geometry: dict[str, Any], properties: dict[str, Any]) -> dict[str, Any]:
    return {"type": "Feature", "properties": properties, "geometry": geometry}


def _point(point: Any) -> list[float]:
    x, y = point.round(_DECIMALS).tolist()
    return [x, y]
