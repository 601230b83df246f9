"""`hypermap connect`: a lift or stairs between two maps."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hypermap.cli.negative_points import PointsCommand
from hypermap.cli.options import MapPath
from hypermap.cli.terminal import note
from hypermap.core.errors import HypermapError

if TYPE_CHECKING:
    from hypermap.core.hypermap import Hypermap
    from hypermap.paths.floors import Point

COMMAND_CLASS = PointsCommand


def command(
    path: MapPath,
    at: Annotated[
        str,
        typer.Argument(metavar="X,Y", show_default=False, help="Where one gets in on MAP."),
    ],
    other: Annotated[
        Path,
        typer.Argument(
            metavar="OTHER",
            readable=False,
            show_default=False,
            help="The map of the other floor: .hmap.",
        ),
    ],
    there: Annotated[
        str,
        typer.Argument(metavar="X,Y", show_default=False, help="Where one gets out on OTHER."),
    ],
    kind: Annotated[
        str, typer.Option("--kind", metavar="KIND", help="What it is: lift, stairs, ...")
    ] = "lift",
    name: Annotated[
        str,
        typer.Option("--called", metavar="NAME", show_default=False, help="What it is called."),
    ] = "",
    length: Annotated[
        float,
        typer.Option(
            "--counts-as", metavar="METERS", min=0, help="How many meters of a path it counts as."
        ),
    ] = 0.0,
    floor: Annotated[
        str | None,
        typer.Option(
            "--floor", metavar="NAME", show_default=False, help="What the floor of MAP is called."
        ),
    ] = None,
    other_floor: Annotated[
        str | None,
        typer.Option(
            "--other-floor", metavar="NAME", show_default=False, help="And that of OTHER."
        ),
    ] = None,
) -> None:
    """Connect two maps by a lift or stairs, so that paths lead from one to the other.

    Both maps are saved with it; what lay there before stays as NAME.bak. Points are in meters, in
    the base frame of each map. The same again replaces it, by its name, or else by its place.

    Examples:
        hypermap connect ground.hmap 1.5,2 upper.hmap 1.5,2 --called "lift A" --counts-as 10
        hypermap connect ground.hmap 7,1 upper.hmap 7,4 --kind stairs --floor 0 --other-floor 1
    """
    from hypermap.console.places import parse_point
    from hypermap.formats import save_map
    from hypermap.formats.backup import keep_backup

    here, far = parse_point(at, "MAP"), parse_point(there, "OTHER")
    for file in (path, other):
        if file.suffix.lower() != ".hmap":
            raise HypermapError(f"{file}: lifts and stairs are kept in an .hmap file")
    if path.absolute() == other.absolute():
        raise HypermapError(f"{path}: a lift or stairs leads to another map")
    connected = {
        path: _connected(path, here, other, far, kind, name, length, floor),
        other: _connected(other, far, path, here, kind, name, length, other_floor),
    }
    for file, hypermap in connected.items():
        keep_backup(file)
        save_map(hypermap, file)
        note(f"saved {file}")


def _connected(
    file: Path,
    at: Point,
    other: Path,
    there: Point,
    kind: str,
    name: str,
    length: float,
    floor: str | None,
) -> Hypermap:
    """Return the map in a file with a lift or stairs to another, and perhaps its floor's name.

    Raises:
        HypermapError: If it is no map, or nobody can be at that place.
    """
    from hypermap.core.occupancy import OccupancyLayer
    from hypermap.formats import open_map
    from hypermap.paths import Connector, Planner, with_connector

    hypermap = open_map(file)
    grids = [layer.name for layer in hypermap if isinstance(layer, OccupancyLayer)]
    space = Planner(hypermap, occupancy=grids[0] if grids else None).space
    space.place(at, f"{file}: the place")
    to = os.path.relpath(other.absolute(), file.absolute().parent)
    connected = with_connector(hypermap, Connector(kind, at, to, there, name, length))
    if floor is not None:
        connected.metadata["floor"] = floor
    return connected
