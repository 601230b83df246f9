"""`hypermap frontiers`: where a robot should look next."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hypermap.cli.mask_options import note_strangers
from hypermap.cli.negative_points import PointsCommand
from hypermap.cli.options import AsJson, MapPath, name_of
from hypermap.cli.robot_options import (
    Keepout,
    OccupancyName,
    RobotRadius,
    ThroughUnknown,
    path_settings,
)
from hypermap.cli.terminal import out, say, say_json, table
from hypermap.core.errors import HypermapError
from hypermap.text import decimal, printable

if TYPE_CHECKING:
    from hypermap.core.frames import Pose2D
    from hypermap.exploration import Frontier, NextView

COMMAND_CLASS = PointsCommand


def command(
    path: MapPath,
    start: Annotated[
        str,
        typer.Argument(
            metavar="FROM",
            show_default=False,
            help='Where the robot is: a point X,Y, a room, or an object such as "cup 3".',
        ),
    ],
    robot_radius: RobotRadius = None,
    max_range: Annotated[
        float, typer.Option("--max-range", metavar="METERS", help="Maximum range of the sensor.")
    ] = 4.0,
    min_range: Annotated[
        float,
        typer.Option(
            "--min-range", metavar="METERS", help="Minimum range at which it sees the floor."
        ),
    ] = 0.0,
    fov: Annotated[
        float, typer.Option("--fov", metavar="DEGREES", help="Horizontal field of view.")
    ] = 60.0,
    least_size: Annotated[
        float,
        typer.Option("--least-size", metavar="METERS", help="Minimum length of a frontier."),
    ] = 0.5,
    least_gain: Annotated[
        float,
        typer.Option(
            "--least-gain",
            metavar="M2",
            help="Minimum unknown area that a frontier would show.",
        ),
    ] = 0.2,
    next_views: Annotated[
        bool,
        typer.Option("--next-views", help="Also list viewpoints for uncertain objects."),
    ] = False,
    sure_from: Annotated[
        float,
        typer.Option(
            "--sure-from", metavar="LOG_ODDS", help="Existence below which an object is uncertain."
        ),
    ] = 5.0,
    keepout: Keepout = None,
    through_unknown: ThroughUnknown = False,
    occupancy: OccupancyName = None,
    as_json: AsJson = False,
) -> None:
    """Find where a robot should look next: frontiers (borders of unknown space) that it can reach.

    For each frontier, this prints its length, how much unknown area the robot would see, the length
    of the path, and where to stand and look. The best come first: large and near. --next-views also
    lists viewpoints for objects that were seen only a few times, or only from one side.

    Examples:
        hypermap frontiers office.hmap 1,1 --robot-radius 0.3
        hypermap frontiers office.hmap kitchen --max-range 8 --fov 360
        hypermap frontiers office.hmap 1,1 --next-views --json
    """
    from hypermap.console.paths import parse_place
    from hypermap.exploration import Explorer, Sensor
    from hypermap.formats import open_map
    from hypermap.ros.server.zones import keepout_filter

    robot = path_settings(robot_radius, through_unknown=through_unknown)
    try:
        sensor = Sensor(max_range, min_range, fov)
    except ValueError as error:
        name, _, rest = str(error).partition(" ")
        option = name.removesuffix("_deg").replace("_", "-")
        raise HypermapError(f"--{option} {rest}") from None
    zones = keepout_filter(keepout or ()).zones
    hypermap = open_map(path)
    note_strangers([hypermap], zones)
    explorer = Explorer(
        hypermap,
        parse_place(start, "FROM"),
        robot,
        sensor,
        keepout=zones,
        occupancy=occupancy,
    )
    frontiers = explorer.frontiers(least_size, least_gain)
    views = explorer.next_views(sure_from) if next_views else None
    if as_json:
        frame_id = explorer.planner.space.frame_id
        say_json({"map": name_of(path), **document(frontiers, views, frame_id)})
        return
    _show(frontiers)
    if views is not None:
        say()
        _show_views(views)


def document(
    frontiers: Sequence[Frontier], views: Sequence[NextView] | None, frame_id: str
) -> dict[str, Any]:
    """Return what `--json` prints, without the map's path."""
    document: dict[str, Any] = {
        "frame_id": frame_id,
        "frontiers": [
            {
                "place": each.place_xy.tolist(),
                "size": each.size,
                "gain": each.gain,
                "distance": each.distance,
                "pose": _pose(each.pose),
                "points": each.points_xy.tolist(),
            }
            for each in frontiers
        ],
    }
    if views is not None:
        document["next_views"] = [
            {
                "layer": each.item.layer,
                "object": each.item.object.id,
                "name": each.item.object.name,
                "existence": each.item.object.existence,
                "is_weak": each.is_weak,
                "is_one_sided": each.is_one_sided,
                "turn": each.turn,
                "distance": each.distance,
                "pose": _pose(each.pose),
            }
            for each in views
        ]
    return document


def _pose(pose: Pose2D) -> dict[str, float]:
    return {"x": pose.x, "y": pose.y, "yaw": pose.yaw}


def _show(frontiers: Sequence[Frontier]) -> None:
    if not frontiers:
        say("no frontier can be reached")
        return
    numbers = ("x", "y", "size", "gain m2", "path", "stand at", "heading")
    shown = table("frontier", *numbers, right=("frontier", *numbers))
    for i, each in enumerate(frontiers, 1):
        x, y = each.place_xy
        shown.add_row(
            str(i),
            decimal(x),
            decimal(y),
            f"{each.size:.1f}",
            f"{each.gain:.1f}",
            f"{each.distance:.1f}",
            *_stand(each.pose),
        )
    out().print(shown)


def _show_views(views: Sequence[NextView]) -> None:
    if not views:
        say("no uncertain object can be seen from a new side")
        return
    shown = table(
        "object",
        "uncertain because",
        "path",
        "stand at",
        "heading",
        right=("path", "stand at", "heading"),
    )
    for each in views:
        one = each.item.object
        reasons = ["few observations"] * each.is_weak + ["seen from one side"] * each.is_one_sided
        name = printable(f"{one.name} {one.id}")
        shown.add_row(name, ", ".join(reasons), f"{each.distance:.1f}", *_stand(each.pose))
    out().print(shown)


def _stand(pose: Pose2D) -> tuple[str, str]:
    return f"{decimal(pose.x)},{decimal(pose.y)}", f"{decimal(math.degrees(pose.yaw), 0)}°"
