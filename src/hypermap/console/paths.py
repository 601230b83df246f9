"""Paths on the command line: how users ask for them, and how answers are printed."""

from __future__ import annotations

import math
import pathlib
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from hypermap.console.places import parse_point
from hypermap.paths import Approach, Path, Planner
from hypermap.paths.floors import FloorPart, FloorPath
from hypermap.paths.places import Place, title
from hypermap.text import printable


@dataclass(frozen=True)
class Planned:
    """A path, and where a robot stands at its end.

    Attributes:
        path: that.
        approach: where it leads to an object; None where it leads elsewhere.
    """

    path: Path
    approach: Approach | None = None


def parse_place(text: str, option: str) -> Place:
    """Return a place from "X,Y", an object's id, or a name.

    Raises:
        HypermapError: If it is neither, as "1,x".
    """
    if re.fullmatch(r"\s*\d+\s*", text):
        return int(text)
    if re.match(r"\s*[-+.\d]", text) and "," in text:
        return parse_point(text, option)
    return text


def plan(planner: Planner, start: str, goal: str, distance: float) -> Planned:
    """Return the path between two places as `parse_place` has them.

    Args:
        planner: of the map and the robot.
        start: from where.
        goal: to where.
        distance: so far from an object the robot stands [m].

    Raises:
        HypermapError: If there is none, or no such place.
    """
    begin, end = parse_place(start, "FROM"), parse_place(goal, "TO")
    if isinstance(end, str | int) and planner.places.room(end) is None:
        there = planner.approach(end, distance, begin)
        assert there.path is not None
        return Planned(there.path, there)
    return Planned(planner.path(begin, end))


def lines(planned: Planned) -> Iterator[str]:
    """Yield the lines that describe a path to the user."""
    path, approach = planned.path, planned.approach
    yield f"{path.length:.2f} m"
    yield "  ".join(f"{x:.2f},{y:.2f}" for x, y in path.points_xy.tolist())
    if path.rooms:
        yield "rooms: " + ", ".join(printable(room.name) for room in path.rooms)
    for door in path.doors:
        x, y = door.place_xy.tolist()
        yield f"door at {x:.2f},{y:.2f}, {door.width:.2f} m wide"
    if approach is not None:
        pose = approach.pose
        yield (
            f"stand at {pose.x:.2f},{pose.y:.2f}, heading {math.degrees(pose.yaw):.0f} degrees: "
            f"{printable(title(approach.object))} is {approach.distance:.2f} m ahead"
        )


def floor_lines(way: FloorPath) -> Iterator[str]:
    """Yield the lines that describe a path over floors to the user."""
    yield f"{way.length:.2f} m"
    for number, part in enumerate(way.parts):
        if number:
            connector = way.connectors[number - 1]
            counts = f", counts for {connector.length:g} m" if connector.length else ""
            yield f"-- {printable(connector.title)}{counts} --"
        yield f"{printable(_floor(part))}:"
        for line in lines(_planned(way, number)):
            yield f"  {line}"


def floor_document(way: FloorPath, frames: Mapping[str, str]) -> dict[str, Any]:
    """Return a path over floors as values for JSON.

    Args:
        way: the path.
        frames: base frame of each map, by its file.
    """
    return {
        "length": way.length,
        "parts": [
            {
                "map": part.map,
                "floor": part.floor,
                **document(_planned(way, number), frames[part.map]),
            }
            for number, part in enumerate(way.parts)
        ],
        "connectors": [
            {"kind": each.kind, "name": each.name, "length": each.length} for each in way.connectors
        ],
    }


def _floor(part: FloorPart) -> str:
    name = pathlib.Path(part.map).name
    return f"{part.floor} ({name})" if part.floor else name


def _planned(way: FloorPath, number: int) -> Planned:
    """Return a part of a path; the last one ends at the approach pose."""
    is_last = number == len(way.parts) - 1
    return Planned(way.parts[number].path, way.approach if is_last else None)


def document(planned: Planned, frame_id: str) -> dict[str, Any]:
    """Return a path as values for JSON."""
    path, approach = planned.path, planned.approach
    values: dict[str, Any] = {
        "frame_id": frame_id,
        "length": path.length,
        "points": path.points_xy.tolist(),
        "rooms": [{"id": room.id, "name": room.name} for room in path.rooms],
        "doors": [
            {"rooms": list(door.rooms), "place": door.place_xy.tolist(), "width": door.width}
            for door in path.doors
        ],
        "approach": None,
    }
    if approach is not None:
        values["approach"] = {
            "x": approach.pose.x,
            "y": approach.pose.y,
            "yaw": approach.pose.yaw,
            "distance": approach.distance,
            "layer": approach.object.layer,
            "object": approach.object.object.id,
            "name": approach.object.object.name,
        }
    return values
