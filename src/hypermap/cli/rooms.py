"""`hypermap rooms`: divide free space into rooms."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hypermap.cli.options import AsJson, Force, MapPath, OptionalMapOutput, check_new_map
from hypermap.cli.robot_options import OccupancyName, RobotRadius
from hypermap.cli.saving import save_from
from hypermap.cli.terminal import note, out, say, say_json, table
from hypermap.core.errors import HypermapError
from hypermap.text import counted, printable

if TYPE_CHECKING:
    from hypermap.rooms import Graph, Rooms


def command(
    path: MapPath,
    output: OptionalMapOutput = None,
    occupancy: OccupancyName = None,
    least_area: Annotated[
        float, typer.Option("--least-area", metavar="M2", help="Minimum area of a room.")
    ] = 1.0,
    widest_door: Annotated[
        float,
        typer.Option(
            "--widest-door",
            metavar="METERS",
            help="Maximum width of a door. Two large rooms with a wider passage are one room.",
        ),
    ] = 2.2,
    widest_opening: Annotated[
        float,
        typer.Option(
            "--widest-opening",
            metavar="METERS",
            help="Maximum width of an opening between a room without a door and a corridor.",
        ),
    ] = 4.5,
    robot_radius: RobotRadius = None,
    kinds: Annotated[
        Path | None,
        typer.Option(
            "--kinds",
            metavar="FILE",
            show_default=False,
            help="YAML file with your own kinds of rooms.",
        ),
    ] = None,
    as_json: AsJson = False,
    force: Force = False,
) -> None:
    """Find the rooms, corridors and doors of a map, and what kind each room is.

    With -o, they become the layer "rooms" of the new map: objects with outlines and names. If the
    map already has such a layer, rooms keep their ids and the names given by hand.

    Examples:
        hypermap rooms office.hmap
        hypermap rooms office.hmap -o rooms.hmap
        hypermap rooms office.hmap --robot-radius 0.4
        hypermap rooms office.hmap --widest-door 1.5 --least-area 3 --json
    """
    from hypermap.formats import open_map
    from hypermap.rooms import RoomSettings, graph, load_kinds, rooms_of_map, with_rooms

    if output is not None:
        check_new_map(output, force)
    try:
        settings = RoomSettings(least_area, widest_door, widest_opening)
    except ValueError as error:
        name, _, rest = str(error).partition(" ")
        raise HypermapError(f"--{name.replace('_', '-')} {rest}") from None
    table_of_kinds = None if kinds is None else load_kinds(kinds)
    hypermap = open_map(path)
    rooms = rooms_of_map(hypermap, settings, occupancy=occupancy, kinds=table_of_kinds)
    passing = graph(rooms, robot_radius or 0.0)
    if output is not None:  # first: nobody may read what is printed
        save_from(with_rooms(hypermap, rooms), path, output)
    if as_json:
        say_json(describe(rooms, passing, robot_radius))
    else:
        _show(rooms, passing, robot_radius)
    if output is not None:
        note(f"saved {output}")


def describe(rooms: Rooms, passing: Graph, robot_radius: float | None) -> dict[str, Any]:
    """Return what `--json` prints."""
    parts = passing.parts().tolist()
    return {
        "frame_id": rooms.frame_id,
        "rooms": [
            {
                "id": room.id,
                "name": room.name,
                "kind": room.kind,
                "sure": room.sure,
                "named_by_hand": room.is_named,
                "area": round(room.area, 3),
                "outline": room.outline.wkt,
                "part": part,
            }
            for room, part in zip(rooms, parts, strict=True)
        ],
        "doors": [
            {
                "rooms": list(door.rooms),
                "place": [round(value, 3) for value in door.place_xy.tolist()],
                "width": round(door.width, 3),
                "passes": door.lets_pass(robot_radius or 0.0),
            }
            for door in rooms.doors
        ],
    }


def _show(rooms: Rooms, passing: Graph, robot_radius: float | None) -> None:
    if not len(rooms):
        say("no room is larger than --least-area")
        return
    shown = table("id", "room", "kind", "sure", "m2", right=("id", "sure", "m2"))
    for room in rooms:
        sure = f"{room.sure:.0%}" if room.kind else ""
        shown.add_row(str(room.id), printable(room.name), room.kind, sure, f"{room.area:.1f}")
    out().print(shown)
    if rooms.doors:
        say()
        doors = table("door between", "and", "x", "y", "width", "", right=("x", "y", "width"))
        for door in rooms.doors:
            names = [printable(rooms[number].name) for number in door.rooms]
            x, y = door.place_xy
            fits = robot_radius is None or door.lets_pass(robot_radius)
            says = "" if fits else "too narrow"
            doors.add_row(*names, f"{x:.2f}", f"{y:.2f}", f"{door.width:.2f}", says)
        out().print(doors)
    if robot_radius is not None:
        _show_parts(rooms, passing)


def _show_parts(rooms: Rooms, passing: Graph) -> None:
    parts: dict[int, list[str]] = {}
    for room, part in zip(rooms, passing.parts().tolist(), strict=True):
        parts.setdefault(part, []).append(printable(room.name))
    say()
    if len(parts) == 1:
        say("the robot can get from every room to every other")
        return
    say(f"no path connects these {counted(len(parts), 'group')} of rooms:")
    for names in parts.values():
        say(f"  {', '.join(names)}")
