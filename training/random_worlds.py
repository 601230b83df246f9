"""Random worlds to train on: rooms, corridors and halls, furnished as people could have done it."""

from __future__ import annotations

import colorsys
import math
from collections.abc import Callable
from functools import partial

import numpy as np
import shapely
from shapely import affinity

from hypermap.simulation.models import size_parameters
from hypermap.simulation.trajectory import DrivePlan, camera_poses
from hypermap.simulation.world import Doorway, FloorPlan, Wall, World, WorldObject

# Share of the worlds, and the least and largest length and width [m].
KINDS = {
    "room": (0.4, (3.5, 3.0), (10.0, 7.5)),
    "corridor": (0.2, (8.0, 1.5), (40.0, 5.0)),
    "hall": (0.2, (8.0, 7.0), (18.0, 13.0)),
    "rooms": (0.2, (7.0, 6.0), (16.0, 12.0)),
}
ON_TABLES = ("monitor", "screen", "keyboard", "mouse", "cup", "cup", "bottle", "fan", "carton")
ON_BOARDS = ("carton", "carton", "carton", "carton", "bottle", "cup", "fan", "monitor")
SMALL = ("mouse", "cup", "bottle", "keyboard", "fan", "carton")
AT_WALLS = (
    *("cupboard", "cupboard", "sink", "sofa", "bench", "panel", "panel", "noteboard", "lamp"),
    *("bin", "plant", "shelf", "bed", "carton", "chair", "door"),
)
ANYWHERE = (
    *("chair", "person", "person", "plant", "lamp", "bin", "noteboard", "bench"),
    *("sofa", "panel", "cupboard", "shelf", "bed", "carton", "carton"),
)
IN_ROWS = ("chair", "chair", "bench", "plant", "cupboard", "bin", "panel", "shelf", "carton")
HUNG = ("panel",)
BOARDS = (0.1, 0.4, 0.7, 1.0)  # of a shelf's height
_OWN_COLOR = 0.35  # share of things in their model's own color
_CROOKED = 0.25  # share of things that fill a crooked quadrilateral
_TRIES = 4  # to find a place for a thing
_CAMERA_MARGIN = 0.25  # meters between the camera and what stands around


class RandomWorld:
    """Furnishes a floor, thing by thing, and leaves out what finds no place."""

    def __init__(self, rng: np.random.Generator) -> None:
        """Furnish a world.

        Args:
            rng: all chance comes from here.
        """
        self._rng = rng
        shares = [share for share, _, _ in KINDS.values()]
        self.kind = str(rng.choice(list(KINDS), p=shares))
        self._room = rng.uniform(*KINDS[self.kind][1:])
        if rng.random() < 0.5:
            self._room = self._room[::-1].copy()
        self._things: list[WorldObject] = []
        self._taken: list[shapely.Polygon] = []  # by what stands on the floor
        self._tops: list[tuple[float, shapely.Polygon]] = []  # heights and outlines of the rest
        self._height = float(rng.uniform(2.3, 3.4))
        self._paint = self._pale() if rng.random() < 0.8 else self._color()
        self._walls = [self._outer_wall()]
        width, depth = map(float, self._room)
        self._faces = [  # of walls, from start to end, with the room on their left
            ((0.0, 0.0), (width, 0.0)),
            ((width, 0.0), (width, depth)),
            ((width, depth), (0.0, depth)),
            ((0.0, depth), (0.0, 0.0)),
        ]
        {
            "room": self._furnish_room,
            "corridor": self._furnish_corridor,
            "hall": self._furnish_hall,
            "rooms": self._furnish_rooms,
        }[self.kind]()

    def world(self) -> World:
        """Return the floor with all that is on it."""
        color = self._wood() if self._rng.random() < 0.7 else self._color()
        floor = FloorPlan(rectangle=(0.0, 0.0, *map(float, self._room)), color=color)
        return World("random", floor, tuple(self._things), tuple(self._walls))

    def camera_pose(self) -> np.ndarray:
        """Return `map_T_camera` of a place with some room around, shape (4, 4)."""
        rng = self._rng
        small = [thing for thing in self._things if thing.model in SMALL]
        if small and rng.random() < 0.2:
            return self._look_closely(small[rng.integers(len(small))])
        place = self._free_place()
        if self._things and rng.random() < (0.5 if self.kind == "corridor" else 0.8):
            x, y = self._things[rng.integers(len(self._things))].place
            yaw = math.atan2(y - place[1], x - place[0]) + rng.normal(0, 0.3)
        elif self.kind == "corridor":  # along it
            along = 0.0 if self._room[0] > self._room[1] else math.pi / 2
            yaw = along + rng.choice([0, math.pi]) + rng.normal(0, 0.3)
        else:
            yaw = rng.uniform(-math.pi, math.pi)
        if rng.random() < 0.75:  # a robot's
            height, pitch = rng.normal(1.2, 0.07), rng.normal(15, 3)
        else:
            height, pitch = rng.uniform(0.5, 1.8), rng.uniform(-5, 35)
        return _camera(place, yaw, height, pitch)

    def _look_closely(self, thing: WorldObject) -> np.ndarray:
        """Return the pose of a camera that is near a small thing and has it in the image."""
        rng = self._rng
        away = rng.uniform(0.5, 2.2)
        for _ in range(20):
            bearing = rng.uniform(-math.pi, math.pi)
            place = np.array(thing.place) + away * np.array([math.cos(bearing), math.sin(bearing)])
            is_inside = ((place > 0.2) & (place < self._room - 0.2)).all()
            if is_inside and self._distance_to_things(place) > 0.1:
                break
        place = place.clip(0.1, self._room - 0.1)
        height = min(thing.z + rng.uniform(0.25, 0.8), self._height - 0.2)
        pitch = math.degrees(math.atan2(height - thing.z, away)) + rng.normal(0, 7)
        yaw = math.atan2(*(np.array(thing.place) - place)[::-1]) + rng.normal(0, 0.25)
        return _camera(place, yaw, height, min(pitch, 60.0))

    def _free_place(self) -> np.ndarray:
        for _ in range(50):
            place = self._rng.uniform([0.3, 0.3], self._room - 0.3)
            if self._distance_to_things(place) > _CAMERA_MARGIN:
                break
        return place

    def _distance_to_things(self, place: np.ndarray) -> float:
        return float(shapely.distance(self._taken, shapely.Point(place)).min(initial=np.inf))

    # What a world contains.

    def _furnish_room(self) -> None:
        rng = self._rng
        if rng.random() < 0.4:
            self._add_partition()
        self._furnish(tables=rng.integers(1, 5), at_walls=rng.integers(4, 13))
        self._try_often(rng.integers(3, 9), self._add_anywhere, ANYWHERE)

    def _furnish_corridor(self) -> None:
        rng = self._rng
        length = float(self._room.max())
        if rng.random() < 0.7:
            self._add_doors(pitch=rng.uniform(1.4, 4.5), color=self._wood())
        if rng.random() < 0.2:
            self._add_partition()
        for _ in range(rng.integers(0, 3)):
            self._add_row_at_wall()
        self._furnish(tables=rng.integers(0, 3), at_walls=int(length * rng.uniform(0.2, 0.8)))
        self._try_often(rng.integers(0, 5), self._add_anywhere, ANYWHERE)

    def _furnish_hall(self) -> None:
        rng = self._rng
        kind = rng.random()
        for _ in range(rng.integers(1, 5)):
            if kind < 0.4:
                self._add_row(self._add_shelf, rng.integers(2, 6), rng.uniform(2.0, 2.6))
            elif kind < 0.8:
                self._add_row(self._add_desk, rng.integers(2, 6), rng.uniform(1.5, 2.4))
            else:
                add = partial(self._add_model, "chair")
                self._add_row(add, rng.integers(3, 9), rng.uniform(0.5, 0.9))
        for _ in range(rng.integers(0, 3)):
            self._add_row_at_wall()
        if rng.random() < 0.3:
            self._add_partition()
        self._furnish(tables=rng.integers(0, 5), at_walls=rng.integers(4, 15))
        self._try_often(rng.integers(4, 13), self._add_anywhere, ANYWHERE)

    def _furnish_rooms(self) -> None:
        rng = self._rng
        width, depth = map(float, self._room)
        across = float(rng.uniform(0.35, 0.65) * depth)
        if rng.random() < 0.7:
            self._divide((0.0, across), (width, across))
        for share in rng.uniform(0.25, 0.75, rng.integers(1, 4)):
            x = float(share * width)
            self._divide((x, 0.0), (x, float(rng.choice([across, depth]))))
        self._furnish(tables=rng.integers(2, 7), at_walls=rng.integers(8, 24))
        self._try_often(rng.integers(3, 11), self._add_anywhere, ANYWHERE)

    def _furnish(self, tables: int, at_walls: int) -> None:
        for _ in range(tables):
            self._add_table()
        self._try_often(at_walls, self._add_at_wall, AT_WALLS)

    def _try_often(self, count: int, add: Callable[[str], bool], models: tuple[str, ...]) -> None:
        for _ in range(count):
            model = str(self._rng.choice(models))
            any(add(model) for _ in range(_TRIES))

    # Walls.

    def _outer_wall(self) -> Wall:
        width, depth = map(float, self._room)
        around = (-0.05, -0.05, width + 0.05, depth + 0.05)
        return Wall(rectangle=around, height=self._height, color=self._paint)

    def _add_partition(self) -> None:
        """Add a wall that reaches into the room, a low bench of a wall, or a pane of glass."""
        rng = self._rng
        x = float(rng.uniform(0.3, 0.7) * self._room[0])
        reach = float(rng.uniform(0.3, 0.6) * self._room[1])
        height = float(rng.choice([0.75, 1.0, 2.6]))
        thickness = 0.1 if height > 2 else float(rng.uniform(0.1, 0.7))
        glass = bool(rng.random() < 0.25)
        self._add_wall(
            Wall(
                line=((x, 0.0), (x, reach)),
                height=2.2 if glass else height,
                thickness=0.03 if glass else thickness,
                color=self._pale(),
                glass=glass,
            )
        )

    def _divide(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Add a wall from side to side with a door or two; things stand on both sides of it."""
        points = np.array([start, end])
        shares = self._rng.uniform(0.1, 0.9, self._rng.integers(1, 3))
        places = points[0] + shares[:, np.newaxis] * (points[1] - points[0])
        width = float(self._rng.uniform(0.8, 1.2))
        doors = tuple(Doorway(tuple(place), width) for place in places.tolist())
        self._add_wall(Wall((start, end), doors=doors, height=self._height, color=self._paint))
        aside = 0.05 * np.array([end[1] - start[1], start[0] - end[0]]) / math.dist(start, end)
        for corners in (points - aside, points[::-1] + aside):
            self._faces.append(tuple(map(tuple, corners.tolist())))

    def _add_wall(self, wall: Wall) -> None:
        self._walls.append(wall)
        self._taken.append(shapely.LineString(wall.corners()).buffer(wall.thickness / 2))

    def _place_at_wall(self, length: float) -> tuple[float, float, float]:
        """Return x, y and yaw [deg] of what stands with its back at a wall."""
        rng = self._rng
        extents = np.array([math.dist(*face) for face in self._faces])
        start, end = self._faces[rng.choice(len(extents), p=extents / extents.sum())]
        away = length / 2 + rng.choice([0.005, rng.uniform(0.01, 0.3)])
        bearing = math.atan2(end[1] - start[1], end[0] - start[0])
        dx, dy = _turned(rng.uniform(0.02, 0.98) * math.dist(start, end), away, bearing)
        return start[0] + dx, start[1] + dy, math.degrees(bearing) + 90

    # Furniture.

    def _add_doors(self, pitch: float, color: str) -> None:
        """Add closed doors along the two long walls."""
        for face in self._faces:
            if math.dist(*face) < self._room.max():
                continue
            yaw = math.degrees(math.atan2(face[1][1] - face[0][1], face[1][0] - face[0][0])) + 90
            first = self._rng.uniform(0.5, pitch)
            for along in np.arange(first, math.dist(*face) - 0.5, pitch):
                dx, dy = _turned(along, 0.04, math.radians(yaw - 90))
                self._add_door(face[0][0] + dx, face[0][1] + dy, yaw, color)

    def _add_door(self, x: float, y: float, yaw: float, color: str | None) -> bool:
        rng = self._rng
        size = {
            "length": rng.uniform(0.04, 0.08),
            "width": rng.uniform(0.75, 1.05),
            "height": rng.uniform(1.9, 2.2),
        }
        return self._add("panel", x, y, yaw, size=size, color=color)

    def _add_row(
        self, add: Callable[[float, float, float], bool], count: int, spacing: float
    ) -> None:
        """Add things side by side, all looking the same way."""
        rng = self._rng
        x, y = rng.uniform([1.0, 1.0], self._room - 1.0)
        yaw = rng.choice([0.0, 90.0, 180.0, -90.0]) + rng.choice([0.0, rng.normal(0, 5)])
        for i in range(count):
            dx, dy = _turned(0.0, (i - count / 2) * spacing, math.radians(yaw))
            add(x + dx, y + dy, yaw + rng.normal(0, 1))

    def _add_row_at_wall(self) -> None:
        """Add some of a kind side by side at a wall."""
        rng = self._rng
        model = str(rng.choice(IN_ROWS))
        size = self._size(model)
        radius = size.get("radius", 0.25)
        x, y, yaw = self._place_at_wall(size.get("length", 2 * radius))
        spacing = size.get("width", 2 * radius) + rng.uniform(0.03, 0.6)
        for i in range(rng.integers(2, 6)):
            dx, dy = _turned(0.0, i * spacing, math.radians(yaw))
            self._add_model(model, x + dx, y + dy, yaw + rng.normal(0, 2), size=size)

    def _add_table(self) -> None:
        """Add a table, chairs around it, and what lies on it."""
        rng = self._rng
        length, width = rng.uniform(0.45, 1.2), rng.uniform(0.5, 2.2)
        height = 0.74 if rng.random() < 0.6 else rng.uniform(0.4, 1.05)
        if rng.random() < 0.5:
            x, y, yaw = self._place_at_wall(length)
        else:
            x, y = rng.uniform([0.8, 0.8], np.maximum(self._room - 0.8, 0.81))
            yaw = rng.choice([0.0, 90.0, 180.0, -90.0]) + rng.normal(0, 8)
        if rng.random() < 0.35:
            self._add_desk(x, y, yaw)
            return
        inset = rng.choice([0.001, rng.uniform(0.02, 0.16)])
        size = {"length": length, "width": width, "height": height, "inset": inset}
        if not self._add("table", x, y, yaw, size=size):
            return
        turn = math.radians(yaw)
        for _ in range(rng.integers(0, 7)):  # chairs
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

    def _add_desk(self, x: float, y: float, yaw: float) -> bool:
        """Add a table to work at: screens at its back, keyboards and mice before them."""
        rng = self._rng
        size = {
            "length": rng.uniform(0.6, 0.9),
            "width": rng.uniform(1.0, 2.0),
            "height": rng.uniform(0.68, 0.8),
        }
        if not self._add("table", x, y, yaw, size=size):
            return False
        length, width, turn = size["length"], size["width"], math.radians(yaw)

        def put(model: str, across: float, along: float, look: float) -> None:
            dx, dy = _turned(across * length, along, turn)
            self._add(model, x + dx, y + dy, yaw + rng.normal(look, 8), z=size["height"])

        screen = str(rng.choice(["screen", "monitor"]))
        for along in rng.choice([-0.3, 0.0, 0.3], rng.integers(1, 3), replace=False):
            put(screen, rng.uniform(-0.35, -0.2), along * width, 0)
        along = rng.uniform(-0.2, 0.2) * width
        if rng.random() < 0.9:
            put("keyboard", rng.uniform(0.1, 0.3), along, 0)
        if rng.random() < 0.8:
            put("mouse", rng.uniform(0.1, 0.35), along + rng.uniform(0.28, 0.45), 0)
        for model in rng.choice(ON_TABLES, rng.integers(0, 3)):
            put(str(model), rng.uniform(-0.4, 0.4), rng.uniform(-0.45, 0.45) * width, 0)
        if rng.random() < 0.8:
            dx, dy = _turned(length / 2 + rng.uniform(0.0, 0.5), along, turn)
            self._add_chair(x + dx, y + dy, yaw + 180 + rng.normal(0, 15))
        return True

    def _add_shelf(self, x: float, y: float, yaw: float, **options: object) -> bool:
        """Add a shelf and what is on its boards."""
        rng = self._rng
        size = options.get("size") or self._size("shelf")
        if not self._add("shelf", x, y, yaw, size=size):
            return False
        turn, gap = math.radians(yaw), 0.3 * size["height"] - 0.06
        is_full = rng.random()
        for share in BOARDS[: 4 if size["height"] < 2.0 else 3]:
            for _ in range(rng.integers(0, 2 + int(4 * is_full))):
                model = str(rng.choice(ON_BOARDS))
                thing = self._size(model)
                thing["height"] = min(thing["height"], gap * rng.uniform(0.6, 1.0))
                along, across = rng.uniform(-0.4, 0.4) * size["width"], rng.uniform(-0.05, 0.1)
                dx, dy = _turned(across * size["length"], along, turn)
                look, z = yaw + rng.normal(0, 8), share * size["height"]
                self._add(model, x + dx, y + dy, look, z=z, size=thing)
        return True

    def _add_chair(self, x: float, y: float, yaw: float) -> bool:
        rng = self._rng
        size = {
            "length": rng.uniform(0.3, 0.6),
            "width": rng.uniform(0.3, 0.6),
            "height": rng.uniform(0.75, 1.05),
            "seat_height": rng.uniform(0.4, 0.5),
        }
        kind = rng.random()
        if kind < 0.1:  # a stool
            seat = rng.uniform(0.3, 0.55)
            size |= {"height": seat + rng.uniform(0.005, 0.2), "seat_height": seat}
        elif kind < 0.25:  # somebody sits on it
            size |= {"height": 0.45, "seat_height": 0.44}
        if not self._add("chair", x, y, yaw, size=size, is_under_tables=True):
            return False
        if 0.1 < kind < 0.25:
            sitter = {"length": rng.uniform(0.4, 0.8), "height": rng.uniform(0.75, 0.95)}
            self._add("sitter", x, y, yaw, z=0.45, size=sitter, is_under_tables=True)
        return True

    def _add_at_wall(self, model: str) -> bool:
        rng = self._rng
        if model == "door":
            return self._add_door(*self._place_at_wall(0.08), None)
        size = self._size(model)
        if model == "cupboard" and rng.random() < 0.35:
            size["height"] = rng.uniform(0.6, 1.15)
        x, y, yaw = self._place_at_wall(size.get("length", 2 * size.get("radius", 0.2)))
        z = rng.uniform(0.6, 1.6) if model in HUNG and rng.random() < 0.8 else 0.0
        if model == "sink" and rng.random() < 0.3:
            z, size["height"] = 0.55, 0.33
        yaw += rng.normal(0, 4)
        if not self._add_model(model, x, y, yaw, z=z, size=size):
            return False
        top = z + size.get("height", 2.0)
        if model in ("cupboard", "sink", "carton") and top < 1.2:
            for _ in range(rng.integers(0, 3)):
                dx, dy = _turned(0.0, rng.uniform(-0.35, 0.35) * size["width"], math.radians(yaw))
                look = yaw + rng.normal(0, 15)
                self._add(str(rng.choice(ON_TABLES)), x + dx, y + dy, look, z=top)
        return True

    def _add_anywhere(self, model: str) -> bool:
        x, y = self._rng.uniform([0.3, 0.3], self._room - 0.3)
        return self._add_model(model, x, y, self._rng.uniform(-180, 180))

    def _add_model(
        self,
        model: str,
        x: float,
        y: float,
        yaw: float,
        *,
        z: float = 0.0,
        size: dict[str, float] | None = None,
    ) -> bool:
        """Add a thing with what belongs to it, such as who sits on it."""
        if model == "chair":
            return self._add_chair(x, y, yaw)
        if model == "shelf":
            return self._add_shelf(x, y, yaw, size=size)
        return self._add(model, x, y, yaw, z=z, size=self._size(model) if size is None else size)

    def _add(
        self,
        model: str,
        x: float,
        y: float,
        yaw: float,
        *,
        z: float = 0.0,
        size: dict[str, float] | None = None,
        color: str | None = None,
        is_under_tables: bool = False,
    ) -> bool:
        """Add a thing if its place is free; return whether it was.

        What stands on something is kept apart from its neighbors there alone.
        """
        rng = self._rng
        size = self._size(model) if size is None else size
        size = {key: float(value) for key, value in size.items()}
        sizes = size_parameters(model) | size
        radius = sizes.get("radius", sizes.get("width", 0.3) / 2)
        length, width = sizes.get("length", 2 * radius), sizes.get("width", 2 * radius)
        area = _rectangle(x, y, length, width, yaw)
        on_floor = z == 0 or model in (*HUNG, "sink")
        if not self._is_free(area, None if on_floor else z, 0.3 if is_under_tables else 0.02):
            return False
        if color is None and rng.random() > _OWN_COLOR:
            color = self._color() if rng.random() < 0.6 else self._wood()
        place: dict[str, object] = {"at": (float(x), float(y))}
        if rng.random() < _CROOKED and model not in ("monitor", "cup", "bottle"):
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
        if on_floor:
            self._taken.append(area)
        elif model != "sitter":  # on a chair of their own
            self._tops.append((z, area))
        return True

    def _is_free(self, area: shapely.Polygon, z: float | None, limit: float) -> bool:
        """Return whether a place is free on the floor, or at a height on something else.

        Args:
            area: the outline of what is to be there.
            z: the height [m]; None on the floor.
            limit: the share of it that another may take.
        """
        others = self._taken if z is None else [top for height, top in self._tops if height == z]
        inside = shapely.box(-0.02, -0.02, *(self._room + 0.02))
        if not inside.covers(area if z is None else area.centroid):
            return False
        taken = shapely.area(shapely.intersection(others, area))
        return bool(taken.max(initial=0.0) <= limit * area.area)

    def _size(self, model: str) -> dict[str, float]:
        """Return sizes around the model's own; all by one factor, and each by one of its own."""
        whole = self._rng.uniform(0.8, 1.2)
        return {
            key: value * whole * float(self._rng.uniform(0.75, 1.3))
            for key, value in size_parameters(model).items()
            if key != "seat_height"
        }

    def _color(self) -> str:
        return _hex(self._rng.random(), self._rng.uniform(0, 0.85), self._rng.uniform(0.12, 1))

    def _wood(self) -> str:
        rng = self._rng
        return _hex(rng.uniform(0.06, 0.13), rng.uniform(0.15, 0.6), rng.uniform(0.35, 0.9))

    def _pale(self) -> str:
        return _hex(self._rng.random(), self._rng.uniform(0, 0.15), self._rng.uniform(0.7, 1))


def _camera(place: np.ndarray, yaw: float, height: float, pitch: float) -> np.ndarray:
    drive = DrivePlan(((0.0, 0.0),), camera_height=float(height), pitch_deg=float(pitch))
    return camera_poses([[*place, yaw]], drive)[0]


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
