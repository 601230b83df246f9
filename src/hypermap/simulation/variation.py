"""Worlds that differ from seed to seed: things moved, turned, and of other sizes."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import shapely
from shapely import affinity
from shapely.geometry.base import BaseGeometry

from hypermap.simulation.models import size_parameters
from hypermap.simulation.scene import placed
from hypermap.simulation.standing import Body, bases, bodies_of, floor_of, walls_of
from hypermap.simulation.world import Point, Variation, World, WorldObject

_TRIES = 15  # places that are tried for each thing; then it stays where it is
_CLEARANCE = 0.3  # meters that stay free to either side of the drive
_GROUND = ("length", "width", "radius")  # sizes that a thing has on the floor


def varied(world: World, seed: int) -> World:
    """Return a world with its things moved, turned and of other sizes, as its `variation` says.

    Things on a thing move with it. No thing ends up inside another, in the robot's way or
    off the floor, and things keep their order. A world without `variation` is unchanged. Things on
    walls stay there, and so do panels, such as doors.
    """
    if world.variation is None:
        return world
    rng = np.random.default_rng([seed, len(world.objects)])
    room = Room(world)
    for root in rng.permutation(len(world.objects)).tolist():
        group = room.group_of(root)
        for _ in range(_TRIES if group else 0):
            changed = _changed([world.objects[i] for i in group], world.variation, rng)
            if room.accept(group, changed):
                break
    return replace(world, objects=tuple(room.objects))


class Room:
    """The things of a world while they are moved, one after the other."""

    def __init__(self, world: World) -> None:
        """Take the things as they are."""
        self.objects = list(world.objects)
        self._bases = bases(world)
        self._bodies, self._walls = bodies_of(world), walls_of(world)
        self._floor = floor_of(world)
        self._way: BaseGeometry = shapely.Point()
        if world.drive is not None:
            points = [point[:2] for point in world.drive.waypoints]
            line = shapely.LineString(points if len(points) > 1 else points * 2)
            self._way = line.buffer(_CLEARANCE)

    def group_of(self, root: int) -> list[int]:
        """Return a thing on the floor and all things on it; none if it is not on the floor."""
        is_hung = self._bodies[root].bottom > 0.05 or self.objects[root].model == "panel"
        if is_hung or self._bases[root] != root:
            return []
        group = [root]
        for member in group:  # which grows meanwhile
            group += [i for i, base in enumerate(self._bases) if base == member and i not in group]
        return group

    def accept(self, group: list[int], changed: list[WorldObject]) -> bool:
        """Take over changed things if there is room for them; return whether there was."""
        bodies = [Body.of(placed(thing)) for thing in changed]
        others = [b for i, b in enumerate(self._bodies) if i not in group] + self._walls
        is_free = self._are_free(bodies, others) and not any(
            a.hits(b) for k, a in enumerate(bodies) for b in bodies[:k]
        )
        if is_free:
            for i, thing, body in zip(group, changed, bodies, strict=True):
                self.objects[i], self._bodies[i] = thing, body
        return is_free

    def has_room_for(self, thing: WorldObject, *, in_a_gap: bool = False) -> bool:
        """Return whether there is room for one more thing.

        Args:
            thing: the new one.
            in_a_gap: whether it may touch the walls, as a door does.
        """
        walls = [] if in_a_gap else self._walls
        return self._are_free([Body.of(placed(thing))], [*self._bodies, *walls])

    def _are_free(self, bodies: list[Body], others: list[Body]) -> bool:
        return (
            self._floor.covers(bodies[0].outline)
            and not any(body.outline.intersects(self._way) for body in bodies)
            and not any(body.hits(other) for body in bodies for other in others)
        )


def _changed(
    group: list[WorldObject], variation: Variation, rng: np.random.Generator
) -> list[WorldObject]:
    """Return a thing and the things on it at another place, rotated and resized.

    What carries something grows at most, so that nothing falls off.
    """
    dx, dy = rng.uniform(-variation.move, variation.move, 2)
    turn = float(rng.uniform(-variation.turn_deg, variation.turn_deg))
    about = group[0].place
    changed = []
    for k, thing in enumerate(group):
        low = 0.0 if k == 0 and len(group) > 1 else -variation.size
        moved = moved_by(thing, about, (float(dx), float(dy)), turn)
        changed.append(replace(moved, size=_resized(thing, low, variation.size, rng)))
    return changed


def moved_by(thing: WorldObject, about: Point, by: Point, turn: float) -> WorldObject:
    """Return a thing at another place [m], turned about a point [degrees]."""

    def moved_points(points: tuple[Point, ...]) -> tuple[Point, ...]:
        turned = affinity.rotate(shapely.MultiPoint(points), turn, origin=about)
        return tuple((p.x + by[0], p.y + by[1]) for p in turned.geoms)

    yaw = math.remainder(thing.yaw_deg + turn, 360)
    if thing.outline is None:
        (at,) = moved_points((thing.place,))
        return replace(thing, at=at, yaw_deg=yaw)
    a, b, c, d = moved_points(thing.outline)
    return replace(thing, outline=(a, b, c, d), yaw_deg=yaw)


def _resized(
    thing: WorldObject, low: float, high: float, rng: np.random.Generator
) -> dict[str, float]:
    sizes = size_parameters(thing.model) | thing.size
    drawn = {key: float(rng.uniform(1 + low, 1 + high)) for key in _GROUND if key in sizes}
    return thing.size | {key: round(sizes[key] * factor, 4) for key, factor in drawn.items()}
