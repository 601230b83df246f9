"""Paths over the free space of a map, for a robot with a radius, to points, objects and rooms."""

from typing import TYPE_CHECKING, Any

from hypermap._lazy import attribute

if TYPE_CHECKING:
    from hypermap.paths.find import Distances, NoPath, distances, find_path
    from hypermap.paths.floors import Building, Connector, FloorPath, with_connector
    from hypermap.paths.free_space import FreeSpace
    from hypermap.paths.planner import Approach, Path, Planner
    from hypermap.paths.routes import RouteGraph, route_graph
    from hypermap.paths.settings import PathSettings

_HOMES = {
    "Approach": "hypermap.paths.planner",
    "Building": "hypermap.paths.floors",
    "Connector": "hypermap.paths.floors",
    "Distances": "hypermap.paths.find",
    "FloorPath": "hypermap.paths.floors",
    "FreeSpace": "hypermap.paths.free_space",
    "NoPath": "hypermap.paths.find",
    "Path": "hypermap.paths.planner",
    "PathSettings": "hypermap.paths.settings",
    "Planner": "hypermap.paths.planner",
    "RouteGraph": "hypermap.paths.routes",
    "distances": "hypermap.paths.find",
    "find_path": "hypermap.paths.find",
    "route_graph": "hypermap.paths.routes",
    "with_connector": "hypermap.paths.floors",
}

__all__ = [
    "Approach",
    "Building",
    "Connector",
    "Distances",
    "FloorPath",
    "FreeSpace",
    "NoPath",
    "Path",
    "PathSettings",
    "Planner",
    "RouteGraph",
    "distances",
    "find_path",
    "route_graph",
    "with_connector",
]


def __getattr__(name: str) -> Any:
    return attribute(__name__, name, _HOMES)
