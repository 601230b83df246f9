"""Which things are on or in others, or in the air."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import as_objects
from hypermap.simulation.parts import Part
from hypermap.simulation.scene import placed, projection, wall_parts
from hypermap.simulation.world import World

_TOUCH = 1e-3  # meters by which two things may overlap where they touch
_GAP = 0.02  # meters between a thing and its support, as between a seat and a person
_WALL_GAP = 0.15  # meters between a wall and things that hang on it
_IN_WALL = 0.35  # share of a thing that may be inside walls, because outlines are drawn by hand


@dataclass(frozen=True)
class Solid:
    """A part as a prism: its outline, and its lowest and highest point."""

    outline: BaseGeometry
    bottom: float
    top: float

    @classmethod
    def of(cls, part: Part) -> Solid:
        """Return the prism around a part."""
        z = part.vertices[:, 2]
        return cls(projection(part), float(z.min()), float(z.max()))

    def hits(self, other: Solid) -> bool:
        """Return whether the two share more than a touch."""
        if not self.is_level_with(other):
            return False
        shared = self.outline.intersection(other.outline)
        return not shared.buffer(-_TOUCH / 2).is_empty

    def is_level_with(self, other: Solid) -> bool:
        """Return whether the two share some height."""
        return min(self.top, other.top) - max(self.bottom, other.bottom) > _TOUCH


@dataclass(frozen=True)
class Body:
    """A thing as its parts.

    Attributes:
        solids: the parts.
        outline: all of them on the floor.
        bottom: the lowest height [m].
    """

    solids: tuple[Solid, ...]
    outline: BaseGeometry
    bottom: float

    @classmethod
    def of(cls, parts: tuple[Part, ...]) -> Body:
        """Return the body of some parts."""
        solids = tuple(Solid.of(part) for part in parts)
        outline = shapely.union_all([solid.outline for solid in solids])
        return cls(solids, outline, min(solid.bottom for solid in solids))

    def hits(self, other: Body) -> bool:
        """Return whether the two share more than a touch."""
        if not self.outline.intersects(other.outline):
            return False
        return any(a.hits(b) for a in self.solids for b in other.solids)

    def stands_on(self, other: Body) -> bool:
        """Return whether one part of the other ends where this begins, and is below it."""
        return any(
            abs(solid.top - self.bottom) <= _GAP and solid.outline.intersects(self.outline)
            for solid in other.solids
        )

    def hangs_at(self, wall: Body) -> bool:
        """Return whether this is next to a wall that is as high."""
        is_level = any(a.is_level_with(b) for a in self.solids for b in wall.solids)
        return is_level and bool(self.outline.distance(wall.outline) <= _WALL_GAP)

    def share_in(self, walls: list[Body]) -> float:
        """Return the share of this in walls."""
        shared = [
            a.outline.intersection(b.outline)
            for wall in walls
            if self.outline.intersects(wall.outline)
            for a in self.solids
            for b in wall.solids
            if a.is_level_with(b)
        ]
        return float(shapely.union_all(shared).area / self.outline.area)


def bodies_of(world: World) -> list[Body]:
    """Return the bodies of a world's things, in their order."""
    return [Body.of(placed(thing)) for thing in world.objects]


def walls_of(world: World) -> list[Body]:
    """Return the bodies of a world's walls; one that is all door has none."""
    every = [wall_parts(wall) for wall in world.walls]
    return [Body.of(parts) for parts in every if parts]


def overlaps(world: World) -> list[tuple[int, int]]:
    """Return the pairs of things with intersecting parts."""
    bodies = bodies_of(world)
    outlines = as_objects([body.outline for body in bodies])  # of none, too
    left, right = shapely.STRtree(outlines).query(outlines, predicate="intersects")
    pairs = sorted((int(i), int(j)) for i, j in zip(left, right, strict=True) if i < j)
    return [(i, j) for i, j in pairs if bodies[i].hits(bodies[j])]


def in_walls(world: World) -> list[int]:
    """Return the things with a large part inside walls."""
    walls = walls_of(world)
    return [i for i, body in enumerate(bodies_of(world)) if body.share_in(walls) > _IN_WALL]


def off_floor(world: World) -> list[int]:
    """Return the things as low as the floor that are all beside it."""
    floor = floor_of(world)
    return [
        i
        for i, body in enumerate(bodies_of(world))
        if body.bottom <= _GAP and not body.outline.intersects(floor)
    ]


def blocked(world: World) -> tuple[int, int | None] | None:
    """Return where walls or things are first in the camera's way; None if they never are.

    Returns:
        The number of the waypoint to which the way leads, and that of the thing; None for a wall.
    """
    if world.drive is None:
        return None
    places = [point[:2] for point in world.drive.waypoints]
    legs = [shapely.LineString(ends) for ends in zip([places[0], *places], places, strict=False)]
    height = world.drive.camera_height
    found = []
    for i, body in [*enumerate(bodies_of(world)), *((None, wall) for wall in walls_of(world))]:
        for solid in body.solids:
            if solid.bottom < height < solid.top:
                inside = solid.outline.buffer(-_TOUCH)
                hit = np.flatnonzero(shapely.intersects(inside, legs))
                found += [(int(hit[0]), i)] if len(hit) else []
    return min(found, key=lambda one: one[0], default=None)


def floor_of(world: World) -> BaseGeometry:
    """Return where there is floor [m]."""
    return shapely.union_all([shapely.box(*area) for area in world.floor.all_rectangles])


def bases(world: World) -> list[int | None]:
    """Return the support of each thing: a thing, itself for floor and walls, None for none."""
    bodies, walls = bodies_of(world), walls_of(world)
    return [_base(i, bodies, walls) for i in range(len(bodies))]


def _base(i: int, bodies: list[Body], walls: list[Body]) -> int | None:
    body = bodies[i]
    if body.bottom <= _GAP:
        return i
    for j, other in enumerate(bodies):
        if j != i and body.stands_on(other):
            return j
    is_held = any(body.stands_on(wall) or body.hangs_at(wall) for wall in walls)
    return i if is_held else None
