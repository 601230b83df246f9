"""Furniture for random worlds: each thing where it finds a place, with what belongs to it."""

from __future__ import annotations

import colorsys
import math
from collections.abc import Callable

import numpy as np
import shapely
from shapely import affinity

from hypermap.simulation.models import size_parameters
from hypermap.simulation.world import WorldObject

ON_TABLES = ("monitor", "screen", "keyboard", "mouse", "cup", "cup", "bottle", "fan", "carton")
ON_BOARDS = ("carton", "carton", "carton", "carton", "bottle", "cup", "fan", "monitor")
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


class Furniture:
    """The things on a floor; what finds no place is left out.

    Attributes:
        room: length and width of the floor [m], shape (2,).
        faces: of walls, from start to end, with the room on their left.
        things: in the order in which they came.
        taken: outlines of what stands on the floor.
    """

    def __init__(self, rng: np.random.Generator, room: np.ndarray) -> None:
        """Begin with an empty floor.

        Args:
            rng: all chance comes from here.
            room: length and width of the floor [m], shape (2,).
        """
        self.room = room
        width, depth = map(float, room)
        self.faces = [
            ((0.0, 0.0), (width, 0.0)),
            ((width, 0.0), (width, depth)),
            ((width, depth), (0.0, depth)),
            ((0.0, depth), (0.0, 0.0)),
        ]
        self.things: list[WorldObject] = []
        self.taken: list[shapely.Polygon] = []
        self._tops: list[tuple[float, shapely.Polygon]] = []  # heights and outlines of the rest
        self._rng = rng

    def _place_at_wall(self, length: float) -> tuple[float, float, float]:
        """Return x, y and yaw [deg] of what stands with its back at a wall."""
        rng = self._rng
        extents = np.array([math.dist(*face) for face in self.faces])
        start, end = self.faces[rng.choice(len(extents), p=extents / extents.sum())]
        away = length / 2 + rng.choice([0.005, rng.uniform(0.01, 0.3)])
        bearing = math.atan2(end[1] - start[1], end[0] - start[0])
        dx, dy = _turned(rng.uniform(0.02, 0.98) * math.dist(start, end), away, bearing)
        return start[0] + dx, start[1] + dy, math.degrees(bearing) + 90

    def add_doors(self, pitch: float, color: str) -> None:
        """Add closed doors along the two long walls."""
        for face in self.faces:
            if math.dist(*face) < self.room.max():
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

    def add_row(
        self, add: Callable[[float, float, float], bool], count: int, spacing: float
    ) -> None:
        """Add things side by side, all looking the same way."""
        rng = self._rng
        x, y = rng.uniform([1.0, 1.0], self.room - 1.0)
        yaw = rng.choice([0.0, 90.0, 180.0, -90.0]) + rng.choice([0.0, rng.normal(0, 5)])
        for i in range(count):
            dx, dy = _turned(0.0, (i - count / 2) * spacing, math.radians(yaw))
            add(x + dx, y + dy, yaw + rng.normal(0, 1))

    def add_row_at_wall(self) -> None:
        """Add some of a kind side by side at a wall."""
        rng = self._rng
        model = str(rng.choice(IN_ROWS))
        size = self._size(model)
        radius = size.get("radius", 0.25)
        x, y, yaw = self._place_at_wall(size.get("length", 2 * radius))
        spacing = size.get("width", 2 * radius) + rng.uniform(0.03, 0.6)
        for i in range(rng.integers(2, 6)):
            dx, dy = _turned(0.0, i * spacing, math.radians(yaw))
            self.add_model(model, x + dx, y + dy, yaw + rng.normal(0, 2), size=size)

    def add_table(self) -> None:
        """Add a table, chairs around it, and what lies on it."""
        rng = self._rng
        length, width = rng.uniform(0.45, 1.2), rng.uniform(0.5, 2.2)
        height = 0.74 if rng.random() < 0.6 else rng.uniform(0.4, 1.05)
        if rng.random() < 0.5:
            x, y, yaw = self._place_at_wall(length)
        else:
            x, y = rng.uniform([0.8, 0.8], np.maximum(self.room - 0.8, 0.81))
            yaw = rng.choice([0.0, 90.0, 180.0, -90.0]) + rng.normal(0, 8)
        if rng.random() < 0.35:
            self.add_desk(x, y, yaw)
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

    def add_desk(self, x: float, y: float, yaw: float) -> bool:
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

    def add_shelf(self, x: float, y: float, yaw: float, **options: object) -> bool:
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

    def add_at_wall(self, model: str) -> bool:
        """Add a thing with its back at a wall, and perhaps what is on it; return whether it was."""
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
        if not self.add_model(model, x, y, yaw, z=z, size=size):
            return False
        top = z + size.get("height", 2.0)
        if model in ("cupboard", "sink", "carton") and top < 1.2:
            for _ in range(rng.integers(0, 3)):
                dx, dy = _turned(0.0, rng.uniform(-0.35, 0.35) * size["width"], math.radians(yaw))
                look = yaw + rng.normal(0, 15)
                self._add(str(rng.choice(ON_TABLES)), x + dx, y + dy, look, z=top)
        return True

    def add_anywhere(self, model: str) -> bool:
        """Add a thing somewhere on the floor; return whether it was."""
        x, y = self._rng.uniform([0.3, 0.3], self.room - 0.3)
        return self.add_model(model, x, y, self._rng.uniform(-180, 180))

    def add_model(
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
            return self.add_shelf(x, y, yaw, size=size)
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
            color = any_color(rng) if rng.random() < 0.6 else wood_color(rng)
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
        self.things.append(thing)
        if on_floor:
            self.taken.append(area)
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
        others = self.taken if z is None else [top for height, top in self._tops if height == z]
        inside = shapely.box(-0.02, -0.02, *(self.room + 0.02))
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


def any_color(rng: np.random.Generator) -> str:
    """Return a color, as "#rrggbb"."""
    return _hex(rng.random(), rng.uniform(0, 0.85), rng.uniform(0.12, 1))


def wood_color(rng: np.random.Generator) -> str:
    """Return a color of wood."""
    return _hex(rng.uniform(0.06, 0.13), rng.uniform(0.15, 0.6), rng.uniform(0.35, 0.9))


def pale_color(rng: np.random.Generator) -> str:
    """Return a color of walls."""
    return _hex(rng.random(), rng.uniform(0, 0.15), rng.uniform(0.7, 1))


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
