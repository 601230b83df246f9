"""`hypermap path`: the shortest path from one place on a map to another."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from hypermap.cli.mask_options import note_strangers
from hypermap.cli.negative_points import PointsCommand
from hypermap.cli.options import AsJson, MapPath, name_of
from hypermap.cli.robot_options import (
    InflationRadius,
    Keepout,
    OccupancyName,
    RobotRadius,
    ThroughUnknown,
    path_settings,
)
from hypermap.cli.terminal import say, say_json
from hypermap.paths.settings import STAND_OFF

COMMAND_CLASS = PointsCommand


def command(
    path: MapPath,
    start: Annotated[
        str,
        typer.Argument(
            metavar="FROM",
            show_default=False,
            help='Start: a point X,Y, a room, or an object by name, id, or both, such as "cup 3".',
        ),
    ],
    goal: Annotated[
        str, typer.Argument(metavar="TO", show_default=False, help="Goal, in the same form.")
    ],
    robot_radius: RobotRadius = None,
    inflation_radius: InflationRadius = None,
    cost_scaling: Annotated[
        float,
        typer.Option(
            "--cost-scaling",
            metavar="PER_METER",
            help="How fast the cost of --inflation-radius falls.",
        ),
    ] = 10.0,
    keepout: Keepout = None,
    through_unknown: ThroughUnknown = False,
    distance: Annotated[
        float,
        typer.Option("--distance", metavar="METERS", help="Distance to keep from a goal object."),
    ] = STAND_OFF,
    occupancy: OccupancyName = None,
    goal_map: Annotated[
        Path | None,
        typer.Option(
            "--goal-map",
            metavar="FILE",
            show_default=False,
            help="The map of TO, if it is on another floor that lifts or stairs lead to.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Find the shortest path for a robot, with the rooms and doors along it.

    If the goal is an object, the path ends where the robot can stand in front of it and see it.
    Points are in meters, in the base frame of the map. If there is no path, the exit code is 2 and
    the message says why.

    Examples:
        hypermap path office.hmap 1,1 "cup 3"
        hypermap path office.hmap kitchen "office 2" --robot-radius 0.3
        hypermap path office.hmap 1,1 4,-2 --robot-radius 0.2 --inflation-radius 0.55
        hypermap path office.hmap 1,1 printer --keepout "plant 0.3" --json
        hypermap path ground.hmap kitchen "office 2" --goal-map upper.hmap
    """
    from hypermap.console.paths import (
        document,
        floor_document,
        floor_lines,
        lines,
        parse_place,
        plan,
    )
    from hypermap.formats import open_map
    from hypermap.formats.config import file_of_map
    from hypermap.formats.floors import open_floors
    from hypermap.paths import Building, Planner
    from hypermap.ros.server.zones import keepout_filter

    settings = path_settings(robot_radius, inflation_radius, cost_scaling, through_unknown)
    zones = keepout_filter(keepout or ()).zones
    if goal_map is not None:
        maps = open_floors(path)
        building = Building(maps, settings, keepout=zones, occupancy=occupancy)
        note_strangers(maps.values(), zones)
        begin, end = parse_place(start, "FROM"), parse_place(goal, "TO")
        files = [os.path.normpath(file_of_map(file).absolute()) for file in (path, goal_map)]
        way = building.path((files[0], begin), (files[1], end), distance)
        if as_json:
            frames = {file: hypermap.base_frame for file, hypermap in maps.items()}
            say_json(floor_document(way, frames))
            return
        for line in floor_lines(way):
            say(line)
        return
    hypermap = open_map(path)
    note_strangers([hypermap], zones)
    planner = Planner(hypermap, settings, keepout=zones, occupancy=occupancy)
    planned = plan(planner, start, goal, distance)
    if as_json:
        say_json({"map": name_of(path), **document(planned, hypermap.base_frame)})
        return
    for line in lines(planned):
        say(line)
