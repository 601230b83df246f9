"""`hypermap render`: draw a map."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hypermap.cli.options import MapPath, OnlyLayers, OnlyNames, check_picture, title_of
from hypermap.cli.robot_options import RobotRadius
from hypermap.cli.terminal import note
from hypermap.console.options import AN_AREA

if TYPE_CHECKING:
    from hypermap.core.hypermap import Hypermap
    from hypermap.exploration import Frontier


def command(
    path: MapPath,
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", metavar="OUT", show_default=False, help="Save here: .png or .svg."
        ),
    ],
    layers: OnlyLayers = None,
    names: OnlyNames = None,
    area: Annotated[
        str | None,
        typer.Option("--in", metavar="AREA|ROOM", help=f"Only this area: {AN_AREA}; or a room."),
    ] = None,
    rooms: Annotated[
        bool, typer.Option("--rooms", help="Find the rooms first if the map has none.")
    ] = False,
    start: Annotated[
        str | None,
        typer.Option(
            "--frontiers",
            metavar="FROM",
            show_default=False,
            help="Show the frontiers that a robot can reach from here: X,Y, a room or an object.",
        ),
    ] = None,
    robot_radius: RobotRadius = None,
    contours: Annotated[
        bool, typer.Option("--contours", help="Draw lines of equal value over measured values.")
    ] = False,
    full: Annotated[
        bool, typer.Option("--full", help="Show the whole grid, including unknown borders.")
    ] = False,
    labels: Annotated[
        bool,
        typer.Option("--show-labels/--hide-labels", help="Show the names of objects."),
    ] = True,
    title: Annotated[
        str | None,
        typer.Option("--title", show_default="the file's name", help="Title."),
    ] = None,
    size: Annotated[
        int, typer.Option("--size", min=200, max=10000, help="Longer side of the map in pixels.")
    ] = 1400,
) -> None:
    """Draw a map from above: occupancy, objects in a color per class, names, a scale bar.

    The picture shows the known area, or the whole grid with --full. A class has the same color in
    every picture, and the same map gives the same file.

    Examples:
        hypermap render lab.hmap -o lab.png
        hypermap render lab.hmap -o lab.svg --name chair --name table
        hypermap render floor.hmap -o corner.png --in 18,-4,30,4
        hypermap render lab.hmap -o rooms.png --rooms
        hypermap render lab.hmap -o kitchen.png --rooms --in kitchen
        hypermap render lab.hmap -o next.png --frontiers 1,1 --robot-radius 0.3
        hypermap render warm.hmap -o warm.png --layer occupancy --layer temperature --contours
    """
    from hypermap.console.places import names_rooms, parse_area
    from hypermap.core.hypermap import ROOMS
    from hypermap.formats import open_map
    from hypermap.viewer.picture import check_suffix, render

    check_suffix(output)
    check_picture(output)
    by_rooms = area is not None and names_rooms(area)
    shown = None if area is None or by_rooms else parse_area(area, "--in")
    hypermap = open_map(path)
    if rooms and ROOMS not in hypermap:
        from hypermap.rooms import rooms_of_map, with_rooms

        hypermap = with_rooms(hypermap, rooms_of_map(hypermap))
    if area is not None and by_rooms:
        from shapely import union_all

        from hypermap.rooms import rooms_asked

        shown = union_all([room.outline for room in rooms_asked(hypermap, area)])
    render(
        hypermap,
        output,
        layers=layers,
        names=names,
        area=shown,
        frontiers=[] if start is None else _frontiers(hypermap, start, robot_radius or 0.0),
        contours=contours,
        full=full,
        labels=labels,
        title=title_of(path) if title is None else title,
        size=size,
    )
    note(f"saved {output}")


def _frontiers(hypermap: Hypermap, start: str, robot_radius: float) -> list[Frontier]:
    """Return the frontiers that a robot can reach from a place."""
    from hypermap.console.paths import parse_place
    from hypermap.exploration import Explorer
    from hypermap.paths import PathSettings

    place, robot = parse_place(start, "--frontiers"), PathSettings(robot_radius)
    return Explorer(hypermap, place, robot).frontiers()
