"""What a robot can drive over, and what it would rather not."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hypermap.core.arguments import check_kind

STAND_OFF = 0.6
"""Default distance from which a robot looks at an object [m]."""


@dataclass(frozen=True)
class PathSettings:
    """The robot, and the cost near walls.

    Attributes:
        robot_radius: minimum distance of its center from the centers of blocked cells [m].
        inflation_radius: a path costs more within this distance from walls [m]; 0 for the shortest
            path. Nav2's default is 0.55.
        cost_scaling: how fast that cost falls with the distance from the robot's radius [1/m].
        unknown_is_free: whether the robot drives over unknown cells.

    Raises:
        ValueError: If a length is negative or not finite.
    """

    robot_radius: float = 0.0
    inflation_radius: float = 0.0
    cost_scaling: float = 10.0
    unknown_is_free: bool = False

    def __post_init__(self) -> None:
        for name in ("robot_radius", "inflation_radius", "cost_scaling"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise ValueError(f"{name} must be 0 or more, got {value}")


def robot_of(settings: PathSettings | None) -> PathSettings:
    """Return the settings that are given, or those of a point for None.

    Raises:
        TypeError: If it is something else, such as a radius.
    """
    chosen = PathSettings() if settings is None else settings
    check_kind(chosen, PathSettings)
    return chosen
