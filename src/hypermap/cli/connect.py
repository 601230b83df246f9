"""`hypermap connect`: add a lift or stairs between two maps."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hypermap.cli.negative_points import PointsCommand
from hypermap.cli.options import MapPath, check_edited, name_of
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
        typer.Argument(metavar="X,Y", show_default=False, help="Its position on MAP."),
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
        typer.Argument(metavar="X,Y", show_default=False, help="Its position on OTHER."),
    ],
    kind: Annotated[
        str, typer.Option("--kind", metavar="KIND", help="Kind: lift, stairs, ...")
    ] = "lift",
    name: Annotated[
        str,
        typer.Option("--called", metavar="NAME", show_default=False, help="Its name."),
    ] = "",
    length: Annotated[
        float,
        typer.Option("--counts-as", metavar="METERS", min=0, help="Length it adds to a path."),
    ] = 0.0,
    floor: Annotated[
        str | None,
        typer.Option(
            "--floor", metavar="NAME", show_default=False, help="Name of the floor of MAP."
        ),
    ] = None,
    other_floor: Annotated[
        str | None,
        typer.Option(
            "--other-floor", metavar="NAME", show_default=False, help="Name of the floor of OTHER."
        ),
    ] = None,
) -> None:
    """Connect two maps by a lift or stairs, so that paths can lead from one to the other.

    This changes both maps; the old versions stay as NAME.bak. Positions are in meters, in the base
    frame of each map. If there is already a lift or stairs of this name (or, without a name, at
    this position), it is replaced.

    Examples:
        hypermap connect ground.hmap 1.5,2 upper.hmap 1.5,2 --called "lift A" --counts-as 10
        hypermap connect ground.hmap 7,1 upper.hmap 7,4 --kind stairs --floor 0 --other-floor 1
    """
    from hypermap.console.places import parse_point
    from hypermap.formats.backup import save_with_backup
    from hypermap.formats.locks import turn_to_edit

    here, far = parse_point(at, "MAP"), parse_point(there, "OTHER")
    for file in (path, other):
        if file.suffix.lower() != ".hmap":
            raise HypermapError(f"{name_of(file)}: only .hmap files can contain lifts and stairs")
    if path.absolute() == other.absolute():
        raise HypermapError(f"{path}: a lift or stairs must lead to another map")
    for file in (path, other):
        check_edited(file)
    with turn_to_edit(path, other):
        connected = {
            path: _connected(path, here, other, far, kind, name, length, floor),
            other: _connected(other, far, path, here, kind, name, length, other_floor),
        }
        for file, hypermap in connected.items():
            save_with_backup(hypermap, file)
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
    """Return the map in a file, with the lift or stairs and, if given, its floor's name.

    Raises:
        HypermapError: If the file is not a map, or the position is not free.
    """
    from hypermap.core.occupancy import OccupancyLayer
    from hypermap.formats import open_map
    from hypermap.paths import Connector, Planner, with_connector
    from hypermap.paths.floors import path_from

    hypermap = open_map(file)
    grids = [layer.name for layer in hypermap if isinstance(layer, OccupancyLayer)]
    space = Planner(hypermap, occupancy=grids[0] if grids else None).space
    space.place(at, f"{file}: the place")
    to = path_from(file, other)
    connected = with_connector(hypermap, Connector(kind, at, to, there, name, length))
    if floor is not None:
        connected.metadata["floor"] = floor
    return connected
