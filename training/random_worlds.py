"""Random worlds to train on: rooms with furniture where people could have put it."""

from __future__ import annotations

import colorsys
import math
from collections.abc import Callable

import numpy as np
import shapely
from shapely import affinity

from hypermap.simulation.models import size_parameters
from hypermap.simulation.trajectory import Drive, camera_poses
from hypermap.simulation.world import FloorPlan, Wall, World, WorldObject

ON_TABLES = ("monitor", "screen", "keyboard", "mouse", "cup", "fan")
AT_WALLS = ("cupboard", "sink", "sofa", "bench", "panel", "noteboard", "lamp", "bin", "plant")
ANYWHERE = (
    *("chair", "person", "person", "plant", "lamp", "bin", "noteboard", "bench"),
    *("sofa", "panel", "cupboard"),
)
HUNG = ("panel",)
_OWN_COLOR = 0.35  # share of things in their model's own color
_CROOKED = 0.25  # share of things that fill a crooked quadrilateral
_TRIES = 4  # to find a place for a thing
_CAMERA_MARGIN = 0.25  # meters between the camera and what stands around


class RandomWorld:
    """Furnishes one room, thing by thing, and leaves out what finds no place."""

    def __init__(self, rng: np.random.Generator) -> None:
        """Furnish a room.

        Args:
            rng: all chance comes from here.
        """
        self._rng = rng
        self._room = rng.uniform([3.5, 3.0], [10.0, 7.5])
        self._things: list[WorldObject] = []
        self._taken: list[shapely.Polygon] = []
        self._walls = [self._outer_wall()]
        if rng.random() < 0.4:
            self._add_partition()
        for _ in range(rng.integers(1, 5)):
            self._add_table()
        for _ in range(rng.integers(4, 13)):
            self._try(self._add_at_wall, str(rng.choice(AT_WALLS)))
        for _ in range(rng.integers(3, 9)):
            self._try(self._add_anywhere, str(rng.choice(ANYWHERE)))

    def world(self) -> World:
        """Return the room with all that is in it."""
        color = self._wood() if self._rng.random() < 0.7 else self._color()
        floor = FloorPlan(rectangle=(0.0, 0.0, *map(float, self._room)), color=color)
        return World("random", floor, tuple(self._things), tuple(self._walls))

    def camera_pose(self) -> np.ndarray:
        """Return `map_T_camera` of a place with some room around, shape (4, 4)."""
        rng = self._rng
        around = shapely.union_all(self._taken)
        for _ in range(50):
            place = rng.uniform([0.3, 0.3], self._room - 0.3)
            if around.distance(shapely.Point(place)) > _CAMERA_MARGIN:
                break
        if self._things and rng.random() < 0.8:  # toward a thing
            x, y = self._things[rng.integers(len(self._things))].place
            yaw = math.atan2(y - place[1], x - place[0]) + rng.normal(0, 0.3)
        else:
            yaw = rng.uniform(-math.pi, math.pi)
        if rng.random() < 0.75:  # a robot's
            height, pitch = rng.normal(1.2, 0.07), rng.normal(15, 3)
        else:
            height, pitch = rng.uniform(0.5, 1.8), rng.uniform(-5, 35)
        drive = Drive(((0.0, 0.0),), camera_height=float(height), pitch_deg=float(pitch))
        return camera_poses([[*place, yaw]], drive)[0]

    def _try(self, add: Callable[[str], bool], model: str) -> None:
        any(add(model) for _ in range(_TRIES))

    def _outer_wall(self) -> Wall:
        width, depth = map(float, self._room)
        height = float(self._rng.uniform(2.3, 3.2))
        return Wall(
            rectangle=(-0.05, -0.05, width + 0.05, depth + 0.05),
            height=height,
            color=self._pale() if self._rng.random() < 0.8 else self._color(),
        )

    def _add_partition(self) -> None:
        """Add a wall that reaches into the room, or a low bench of a wall."""
        rng = self._rng
        x = float(rng.uniform(0.3, 0.7) * self._room[0])
        reach = float(rng.uniform(0.3, 0.6) * self._room[1])
        height = float(rng.choice([0.75, 1.0, 2.6]))
        thickness = 0.1 if height > 2 else float(rng.uniform(0.1, 0.7))
        wall = Wall(
            line=((x, 0.0), (x, reach)), height=height, thickness=thickness, color=self._pale()
        )
        self._walls.append(wall)
        self._taken.append(shapely.LineString(wall.corners()).buffer(thickness / 2))

    def _add_table(self) -> None:
        """Add a table, chairs around it, and what lies on it."""
        rng = self._rng
        length, width = rng.uniform(0.45, 1.2), rng.uniform(0.5, 2.2)
        height = 0.74 if rng.random() < 0.6 else rng.uniform(0.4, 1.05)
        inset = rng.choice([0.001, rng.uniform(0.02, 0.16)])
        if rng.random() < 0.5:
            x, y, yaw = self._place_at_wall(length)
        else:
            x, y = rng.uniform([0.8, 0.8], self._room - 0.8)
            yaw = rng.choice([0.0, 90.0, 180.0, -90.0]) + rng.normal(0, 8)
        size = {"length": length, "width": width, "height": height, "inset": inset}
        if not self._add("table", x, y, yaw, size=size):
            return
        turn = math.radians(yaw)
        for _ in range(rng.integers(0, 5)):  # chairs
            side = rng.choice([-1, 1])
            along, away = rng.uniform(-0.45, 0.45) * width, length / 2 + rng.uniform(0.1, 0.6)
            dx, dy = _turned(side * away, along, turn)
            look = yaw + (180 if side > 0 else 0) + rng.normal(0, 20)
            self._add_chair(x + dx, y + dy, look)
        for _ in range(rng.integers(0, 7)):
            along, across = rng.uniform(-0.42, 0.42, 2)
            dx, dy = _turned(across * length * 0.9, along * width, turn)
            look = yaw + rng.normal(0, 25) + rng.choice([0, 0, 0, 90, 180])
            self._add(str(rng.choice(ON_TABLES)), x + dx, y + dy, look, z=height)

    def _add_chair(self, x: float, y: float, yaw: float) -> bool:
        rng = self._rng
        size = {
            "length": rng.uniform(0.35, 0.6),
            "width": rng.uniform(0.35, 0.6),
            "height": rng.uniform(0.75, 1.05),
            "seat_height": rng.uniform(0.4, 0.5),
        }
        kind = rng.random()
        if kind < 0.1:  # a stool
            seat = rng.uniform(0.3, 0.55)
            size |= {"height": seat + rng.uniform(0.005, 0.2), "seat_height": seat}
        elif kind < 0.3:  # somebody sits on it
            size |= {"height": 0.45, "seat_height": 0.44}
        if not self._add("chair", x, y, yaw, size=size, is_under_tables=True):
            return False
        if 0.1 < kind < 0.3:
            sitter = {"length": rng.uniform(0.4, 0.8), "height": rng.uniform(0.75, 0.95)}
            self._add("sitter", x, y, yaw, z=0.45, size=sitter, is_under_tables=True)
        return True

    def _add_at_wall(self, model: str) -> bool:
        rng = self._rng
        size = self._size(model)
        length = size.get("length", 2 * size.get("radius", 0.2))
        x, y, yaw = self._place_at_wall(length)
        z = rng.uniform(0.6, 1.6) if model in HUNG and rng.random() < 0.8 else 0.0
        if model == "sink" and rng.random() < 0.3:
            z, size["height"] = 0.55, 0.33
        yaw += rng.normal(0, 4)
        if not self._add(model, x, y, yaw, z=z, size=size):
            return False
        top = z + size.get("height", 2.0)
        if model in ("cupboard", "sink") and top < 1.2 and rng.random() < 0.6:
            self._add(str(rng.choice(ON_TABLES)), x, y, yaw + rng.normal(0, 15), z=top)
        return True

    def _add_anywhere(self, model: str) -> bool:
        x, y = self._rng.uniform([0.4, 0.4], self._room - 0.4)
        yaw = self._rng.uniform(-180, 180)
        if model == "chair":
            return self._add_chair(x, y, yaw)
        return self._add(model, x, y, yaw, size=self._size(model))

    def _add(
        self,
        model: str,
        x: float,
        y: float,
        yaw: float,
        *,
        z: float = 0.0,
        size: dict[str, float] | None = None,
        is_under_tables: bool = False,
    ) -> bool:
        """Add a thing if its place is free; return whether it was.

        What stands on something is kept apart from its neighbors there alone.
        """
        rng = self._rng
        size = self._size(model) if size is None else size
        size = {key: float(value) for key, value in size.items()}
        defaults = size_parameters(model)
        sizes = defaults | size
        radius = sizes.get("radius", sizes.get("width", 0.3) / 2)
        length, width = sizes.get("length", 2 * radius), sizes.get("width", 2 * radius)
        area = _rectangle(x, y, length, width, yaw)
        grounded = z < 0.3 or model in HUNG
        others = self._taken if grounded else self._on_top(z)
        limit = 0.3 if is_under_tables else 0.02
        inside = shapely.box(-0.02, -0.02, *(self._room + 0.02))
        if not inside.covers(area if grounded else shapely.Point(x, y)) or any(
            area.intersection(other).area > limit * area.area for other in others
        ):
            return False
        own = rng.random() < _OWN_COLOR
        color = None if own else self._color() if rng.random() < 0.6 else self._wood()
        place: dict[str, object] = {"at": (float(x), float(y))}
        if rng.random() < _CROOKED and model not in ("monitor", "cup"):
            corners = np.array(area.exterior.coords[:4])
            corners += rng.uniform(-0.1, 0.1, (4, 2)) * min(length, width)
            if shapely.Polygon(corners).is_valid:
                place = {"outline": tuple(map(tuple, corners.tolist()))}
        yaw = math.remainder(float(yaw), 360)
        try:
            thing = WorldObject(model, yaw_deg=yaw, z=float(z), size=size, color=color, **place)
        except ValueError:  # its parts have no extent, or its corners no convex shape
            return False
        self._things.append(thing)
        if grounded:
            self._taken.append(area)
        return True

    def _on_top(self, z: float) -> list[shapely.Polygon]:
        """Return the outlines of what stands at a height; sitters are on chairs of their own."""
        return [
            shapely.MultiPoint(
                [tuple(v[:2]) for part in thing.parts() for v in part.vertices]
            ).convex_hull
            for thing in self._things
            if thing.z == z and thing.model != "sitter"
        ]

    def _size(self, model: str) -> dict[str, float]:
        """Return sizes around the model's own; all by one factor, and each by one of its own."""
        whole = self._rng.uniform(0.85, 1.2)
        return {
            key: value * whole * float(self._rng.uniform(0.8, 1.25))
            for key, value in size_parameters(model).items()
            if key != "seat_height"
        }

    def _place_at_wall(self, length: float) -> tuple[float, float, float]:
        """Return x, y and yaw [deg] of what stands with its back at a wall."""
        rng = self._rng
        width, depth = self._room
        away = length / 2 + rng.choice([0.005, rng.uniform(0.01, 0.3)])
        along = rng.uniform(0.05, 0.95)
        return (
            (away, along * depth, 0.0),
            (width - away, along * depth, 180.0),
            (along * width, away, 90.0),
            (along * width, depth - away, -90.0),
        )[rng.integers(4)]

    def _color(self) -> str:
        return _hex(self._rng.random(), self._rng.uniform(0, 0.85), self._rng.uniform(0.12, 1))

    def _wood(self) -> str:
        rng = self._rng
        return _hex(rng.uniform(0.06, 0.13), rng.uniform(0.15, 0.6), rng.uniform(0.35, 0.9))

    def _pale(self) -> str:
        return _hex(self._rng.random(), self._rng.uniform(0, 0.15), self._rng.uniform(0.7, 1))


def _hex(hue: float, saturation: float, value: float) -> str:
    red, green, blue = colorsys.hsv_to_rgb(hue, saturation, value)
    return f"#{round(255 * red):02x}{round(255 * green):02x}{round(255 * blue):02x}"


def _turned(x: float, y: float, angle: float) -> tuple[float, float]:
    return (
        x * math.cos(angle) - y * math.sin(angle),
        x * math.sin(angle) + y * math.cos(angle),
    )


def _rectangle(x: float, y: float, length: float, width: float, yaw: float) -> shapely.Polygon:
    box = shapely.box(-length / 2, -width / 2, length / 2, width / 2)
    return affinity.translate(affinity.rotate(box, yaw, origin=(0, 0)), x, y)
