"""A world as solid bodies: what the camera sees, and the exact footprints."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.frames import Pose2D
from hypermap.simulation.parts import Part, box, moved
from hypermap.simulation.world import FloorPlan, Point, Wall, World, WorldObject

BACKGROUND = -1  # the instance of floor, walls and nothing at all
FLOOR_THICKNESS = 0.1
_TOUCH = 1e-3  # meters by which two things may overlap where they touch


@dataclass(frozen=True, eq=False)
class Scene:
    """The triangles of a world.

    Attributes:
        triangles: corners in the map frame [m], float32, shape (T, 3, 3).
        colors: RGB, 0..1, float32, shape (T, 3).
        instances: place of the triangle's object in the world's list, or -1, int32, shape (T,).
        is_floor: whether the triangle belongs to the floor, shape (T,).
    """

    triangles: NDArray[np.float32]
    colors: NDArray[np.float32]
    instances: NDArray[np.int32]
    is_floor: NDArray[np.bool_]

    @classmethod
    def of(cls, world: World, with_glass: bool = True) -> Scene:
        """Return the triangles of a world, with or without what is made of glass."""
        walls = [wall for wall in world.walls if with_glass or not wall.glass]
        things = [(i, one) for i, one in enumerate(world.objects) if with_glass or not one.glass]
        bodies = [(part, BACKGROUND, True) for part in floor_parts(world.floor)]
        bodies += [(part, BACKGROUND, False) for wall in walls for part in wall_parts(wall)]
        return cls._of_bodies(bodies + _bodies_of(things))

    @classmethod
    def of_things(cls, things: Iterable[tuple[int, WorldObject]]) -> Scene:
        """Return the triangles of things alone, each with its instance."""
        return cls._of_bodies(_bodies_of(things))

    def joined(self, other: Scene) -> Scene:
        """Return the triangles of both."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return Scene(*(np.concatenate(pair) for pair in pairs))

    @classmethod
    def _of_bodies(cls, bodies: Sequence[_Body]) -> Scene:
        counts = [len(part.faces) for part, _, _ in bodies]
        return cls(
            np.concatenate([part.vertices[part.faces] for part, _, _ in bodies]).astype(np.float32),
            np.repeat([part.color for part, _, _ in bodies], counts, axis=0).astype(np.float32),
            np.repeat([instance for _, instance, _ in bodies], counts).astype(np.int32),
            np.repeat([is_floor for _, _, is_floor in bodies], counts),
        )


_Body: TypeAlias = tuple[Part, int, bool]  # with its instance, and whether it is floor


def _bodies_of(things: Iterable[tuple[int, WorldObject]]) -> list[_Body]:
    return [(part, i, False) for i, thing in things for part in placed(thing)]


def placed(thing: WorldObject) -> tuple[Part, ...]:
    """Return the parts of a thing in the map frame."""
    return thing.parts()


def size_of(thing: WorldObject) -> float:
    """Return the largest side of a thing [m]: of its length, width and height."""
    corners = np.concatenate([part.vertices for part in placed(thing)])
    return float(np.ptp(corners, axis=0).max())


def floor_parts(floor: FloorPlan) -> tuple[Part, ...]:
    """Return the floor as slabs whose upper side is at z = 0."""
    return tuple(
        box(
            (x1 - x0, y1 - y0, FLOOR_THICKNESS),
            ((x0 + x1) / 2, (y0 + y1) / 2, -FLOOR_THICKNESS / 2),
            floor.color,
        )
        for x0, y0, x1, y1 in floor.all_rectangles
    )


def wall_parts(wall: Wall) -> tuple[Part, ...]:
    """Return a wall as boxes: one for each straight piece between its corners and doors."""
    parts = []
    corners = wall.corners()
    for start, end in itertools.pairwise(corners):
        direction = Pose2D(*start, math.atan2(end[1] - start[1], end[0] - start[0]))
        length = math.hypot(end[0] - start[0], end[1] - start[1])
        for a, b in _solid_pieces(wall, direction, length):
            size = (b - a, wall.thickness, wall.height)
            piece = box(size, ((a + b) / 2, 0, wall.height / 2), wall.color)
            parts.append(moved(piece, direction, 0.0))
    return tuple(parts)


def footprint(parts: Iterable[Part]) -> BaseGeometry:
    """Return the union of the parts' projections on the floor; exact, as every part is convex."""
    return shapely.union_all([projection(part) for part in parts])


def projection(part: Part) -> BaseGeometry:
    """Return the outline of a part on the floor; exact, as every part is convex."""
    return shapely.MultiPoint(part.vertices[:, :2]).convex_hull


def _solid_pieces(wall: Wall, direction: Pose2D, length: float) -> list[tuple[float, float]]:
    """Return begin and end of a straight piece of wall along its direction [m].

    It reaches half a thickness past both corners, so that corners are closed.
    """
    pieces = [(-wall.thickness / 2, length + wall.thickness / 2)]
    for door in wall.doors:
        along, across = _local(direction, door.at)
        if abs(across) > wall.thickness / 2 or not 0 <= along <= length:
            continue  # it is in another piece
        a, b = along - door.width / 2, along + door.width / 2
        pieces = [
            piece
            for start, end in pieces
            for piece in ((start, min(end, a)), (max(start, b), end))
            if piece[1] - piece[0] > _TOUCH
        ]
    return pieces


def _local(frame: Pose2D, point: Point) -> tuple[float, float]:
    along, across = frame.inverse().apply(point)[0]
    return float(along), float(across)
