"""People who walk through a world while a robot maps it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from hypermap.core.arrays import FloatArray
from hypermap.simulation.trajectory import DrivePlan
from hypermap.simulation.world import WorldObject

_SPEEDS = (0.7, 1.3)  # meters per second
_COLORS = ("#3f6f9f", "#8a4f3d", "#5c6b3f", "#6b4f7a")
_ASIDE = 0.8  # meters; people nearer to the camera have stepped aside


@dataclass(frozen=True)
class Walker:
    """A person who walks back and forth along the robot's path, where it is free.

    Attributes:
        way: the waypoints of the drive [m].
        start: how far along the way they are at first [m].
        speed: meters per second.
        color: of their clothes.
    """

    way: shapely.LineString
    start: float
    speed: float
    color: str

    def at(self, stamp: float) -> WorldObject:
        """Return where they are at a time [s]."""
        length = self.way.length
        along = (self.start + self.speed * stamp) % (2 * length)
        is_back = along > length
        along = 2 * length - along if is_back else along
        here = self.way.interpolate(along)
        ahead = self.way.interpolate(along - 0.1 if is_back else along + 0.1)
        yaw = math.degrees(math.atan2(ahead.y - here.y, ahead.x - here.x))
        return WorldObject("person", (here.x, here.y), yaw_deg=yaw, color=self.color)


def draw_walkers(count: int, drive: DrivePlan, rng: np.random.Generator) -> list[Walker]:
    """Draw people along a drive; none where the robot only turns on the spot."""
    points = [point[:2] for point in drive.waypoints]
    way = shapely.LineString(points if len(points) > 1 else points * 2)
    if way.length < _ASIDE:
        return []
    return [
        Walker(
            way,
            float(rng.uniform(0, 2 * way.length)),
            float(rng.uniform(*_SPEEDS)),
            _COLORS[i % len(_COLORS)],
        )
        for i in range(count)
    ]


def walkers_at(
    walkers: Sequence[Walker], stamp: float, camera_xy: FloatArray
) -> list[tuple[int, WorldObject]]:
    """Return the people at a time, with their numbers, without those too near the camera."""
    placed = [(number, walker.at(stamp)) for number, walker in enumerate(walkers)]
    return [(n, one) for n, one in placed if math.dist(one.place, camera_xy) > _ASIDE]
