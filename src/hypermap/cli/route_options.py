"""The route graph of `hypermap convert`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hypermap.cli.mask_options import note_strangers
from hypermap.cli.options import check_output
from hypermap.cli.robot_options import path_settings
from hypermap.cli.terminal import note
from hypermap.core.errors import HypermapError
from hypermap.text import counted

if TYPE_CHECKING:
    from hypermap.core.hypermap import Hypermap

PANEL = "A route graph for nav2's route server, in place of the map"

AsRouteGraph = Annotated[
    bool,
    typer.Option(
        "--route-graph",
        rich_help_panel=PANEL,
        help="Write rooms, doors and the routes between them as .geojson; --keepout keeps "
        "routes out of zones.",
    ),
]


def save_route_graph(
    hypermap: Hypermap,
    target: Path,
    robot_radius: float | None,
    inflation_radius: float | None,
    keepout: list[str],
    force: bool,
) -> None:
    """Save the route graph of a map with rooms, and say what is left out.

    Raises:
        HypermapError: If the map has no rooms, no way is free, or the file cannot be saved.
    """
    from hypermap.formats.atomic import write_file
    from hypermap.formats.nav2_routes import to_nav2_routes
    from hypermap.paths import Planner, route_graph
    from hypermap.ros.server.zones import keepout_filter

    if target.suffix.lower() not in (".geojson", ".json"):
        raise HypermapError(f"{target}: a route graph is saved as .geojson")
    check_output(target, force)
    settings = path_settings(robot_radius, inflation_radius)
    zones = keepout_filter(keepout).zones
    note_strangers([hypermap], zones)
    planner = Planner(hypermap, settings, keepout=zones)
    graph = route_graph(planner)
    if not len(graph.edges):
        raise HypermapError(
            f"there is no path between rooms and doors for a radius of {robot_radius or 0:g} m"
        )
    write_file(target, to_nav2_routes(graph).encode())
    if graph.too_narrow:
        note(f"left out: {counted(len(graph.too_narrow), 'door')} too narrow for the robot")
    ways, nodes = counted(len(graph.edges), "way"), counted(len(graph.stops), "node")
    note(f"{target.name}: {ways} between {nodes}; the frame is {graph.frame_id!r}")
