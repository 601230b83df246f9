"""Paths as people ask for them, and as they are told."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from hypermap.console.places import parse_point
from hypermap.paths import Approach, Path, Planner
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
    """Yield what people read of a path."""
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
            f"stand at {pose.x:.2f},{pose.y:.2f}, turned to {math.degrees(pose.yaw):.0f} degrees: "
            f"{printable(title(approach.object))} is {approach.distance:.2f} m ahead"
        )


def document(planned: Planned, frame_id: str) -> dict[str, Any]:
    """Return what programs read of a path."""
    path, approach = planned.path, planned.approach
    told: dict[str, Any] = {
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
        told["approach"] = {
            "x": approach.pose.x,
            "y": approach.pose.y,
            "yaw": approach.pose.yaw,
            "distance": approach.distance,
            "layer": approach.object.layer,
            "object": approach.object.object.id,
            "name": approach.object.object.name,
        }
    return told
