"""Worlds: rooms with walls, a floor and furniture, described in a small YAML file."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from importlib import resources
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import ConfigDict, Field, TypeAdapter, ValidationError

from hypermap.core.errors import FileMissing, FormatError, HypermapError, did_you_mean
from hypermap.core.frames import Pose2D
from hypermap.formats.checked import found, place_of
from hypermap.formats.yaml_text import read_yaml
from hypermap.simulation.models import MODELS, build, size_parameters
from hypermap.simulation.parts import Part, fitted, moved, rgb
from hypermap.simulation.trajectory import DrivePlan

Meters = Annotated[float, Field(strict=True, ge=-1000, le=1000)]
Height = Annotated[float, Field(strict=True, gt=0, le=20)]
Angle = Annotated[float, Field(strict=True, ge=-360, le=360)]
Point = tuple[Meters, Meters]
Rectangle = tuple[Meters, Meters, Meters, Meters]
_STRICT = ConfigDict(extra="forbid")
_TEXTS = {("name",), ("objects", "*", "name")}  # texts even where they look like numbers


@dataclass(frozen=True)
class FloorPlan:
    """The floor; where there is floor and nothing on it, the map is free.

    Attributes:
        rectangle: xmin, ymin, xmax, ymax [m]; None where `rectangles` are given.
        rectangles: several of them; they may overlap.
        color: of its boards.
    """

    rectangle: Rectangle | None = None
    rectangles: Annotated[tuple[Rectangle, ...], Field(max_length=1000)] = ()
    color: str = "#c8a878"

    __pydantic_config__: ClassVar[ConfigDict] = _STRICT

    def __post_init__(self) -> None:
        if (self.rectangle is None) == (not self.rectangles):
            raise ValueError("a floor needs either a rectangle or rectangles")
        for rectangle in self.all_rectangles:
            _check_rectangle(rectangle)
        rgb(self.color)

    @property
    def all_rectangles(self) -> tuple[Rectangle, ...]:
        """What it is made of."""
        return self.rectangles if self.rectangle is None else (self.rectangle,)


@dataclass(frozen=True)
class Doorway:
    """A gap in a wall.

    Attributes:
        at: its middle, on the wall's center line [m].
        width: meters.
    """

    at: Point
    width: Height = 0.9

    __pydantic_config__: ClassVar[ConfigDict] = _STRICT


@dataclass(frozen=True)
class Wall:
    """Walls along a line, or around a rectangle.

    Attributes:
        line: corners of the center line [m]; None where `rectangle` is given.
        rectangle: xmin, ymin, xmax, ymax of the center line [m].
        doors: gaps.
        height: meters.
        thickness: meters.
        color: of the paint.
        glass: whether cameras and lasers measure mostly what is behind it.
    """

    line: tuple[Point, ...] | None = None
    rectangle: Rectangle | None = None
    doors: tuple[Doorway, ...] = ()
    height: Height = 2.6
    thickness: Height = 0.1
    color: str = "#e9e4d8"
    glass: bool = False

    __pydantic_config__: ClassVar[ConfigDict] = _STRICT

    def __post_init__(self) -> None:
        if (self.line is None) == (self.rectangle is None):
            raise ValueError("a wall needs either a line or a rectangle")
        if self.rectangle is not None:
            _check_rectangle(self.rectangle)
        if self.line is not None and len(self.line) < 2:
            raise ValueError("a line needs at least two corners")
        center_line = shapely.LineString(self.corners())
        for door in self.doors:
            if center_line.distance(shapely.Point(door.at)) > self.thickness / 2:
                raise ValueError(f"the door at {_place(door.at)} is not in the wall")
        rgb(self.color)

    def corners(self) -> tuple[Point, ...]:
        """Return the center line; around a rectangle it is closed."""
        if self.line is not None:
            return self.line
        assert self.rectangle is not None  # checked when built
        x0, y0, x1, y1 = self.rectangle
        return (x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)


@dataclass(frozen=True)
class WorldObject:
    """A piece of furniture, a person, a cup: one object of the truth.

    Attributes:
        model: which of the models it is.
        at: its place [m]; None where `outline` is given.
        yaw_deg: which way it looks, degrees counter-clockwise from +x. With an outline, the side
            that faces most that way is the front.
        z: height of what it stands on [m].
        name: its class in the truth; the model's name if empty.
        size: the model's size parameters [m] that differ from its defaults.
        color: of its main parts; None for the model's own.
        outline: four corners [m], which the model then fills; its length and width, if it has
            such, are those of the outline.
        glass: whether cameras and lasers measure mostly what is behind it.
    """

    model: str
    at: Point | None = None
    yaw_deg: Angle = 0.0
    z: Annotated[float, Field(strict=True, ge=0, le=20)] = 0.0
    name: str = ""
    size: dict[str, Annotated[float, Field(strict=True)]] = field(default_factory=dict)
    color: str | None = None
    outline: tuple[Point, Point, Point, Point] | None = None
    glass: bool = False

    __pydantic_config__: ClassVar[ConfigDict] = _STRICT

    def __post_init__(self) -> None:
        if (self.at is None) == (self.outline is None):
            raise ValueError("an object needs either a place ('at') or an outline")
        if self.outline is not None:
            ring = shapely.Polygon(self.outline)
            if not ring.is_valid or not np.isclose(ring.convex_hull.area, ring.area, rtol=1e-9):
                raise ValueError("the corners of an outline must go around a convex shape")
        self.parts()  # raises where model, size or color are wrong

    @property
    def label(self) -> str:
        """Its class in the truth."""
        return self.name or self.model

    @property
    def place(self) -> Point:
        """Its place: `at`, or the center of its outline."""
        if self.at is not None:
            return self.at
        middle = shapely.Polygon(self.outline).centroid
        return middle.x, middle.y

    def parts(self) -> tuple[Part, ...]:
        """Return its parts in the map frame."""
        if self.outline is None:
            pose = Pose2D(*self.place, math.radians(self.yaw_deg))
            parts = build(self.model, self.size, self.color)
            return tuple(moved(part, pose, self.z) for part in parts)
        corners = _from_front_right(self.outline, math.radians(self.yaw_deg))
        sides = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
        lengths = {"width": (sides[0] + sides[2]) / 2, "length": (sides[1] + sides[3]) / 2}
        known = size_parameters(self.model) if self.model in MODELS else {}
        size = {key: float(value) for key, value in lengths.items() if key in known}
        return fitted(build(self.model, size | self.size, self.color), corners, self.z)


@dataclass(frozen=True)
class Variation:
    """By how much the things of a world differ from seed to seed; see `varied`.

    Attributes:
        move: at most by so much in x and in y [m].
        turn_deg: at most by so much to either side [degrees].
        size: lengths and widths at most by this share.
    """

    move: Annotated[float, Field(strict=True, ge=0, le=5)] = 0.3
    turn_deg: Annotated[float, Field(strict=True, ge=0, le=180)] = 12.0
    size: Annotated[float, Field(strict=True, ge=0, le=0.5)] = 0.15

    __pydantic_config__: ClassVar[ConfigDict] = _STRICT


@dataclass(frozen=True)
class World:
    """All that there is to see, and a drive through it.

    Attributes:
        name: of the world.
        floor: its floor.
        objects: the objects of the ground truth; their indices are their ids.
        walls: its walls.
        drive: how a robot drives through it; None if the file has no drive.
        variation: how its things differ from seed to seed; None if they do not.
    """

    name: str
    floor: FloorPlan
    objects: Annotated[tuple[WorldObject, ...], Field(max_length=10_000)] = ()
    walls: Annotated[tuple[Wall, ...], Field(max_length=10_000)] = ()
    drive: DrivePlan | None = None
    variation: Variation | None = None

    __pydantic_config__: ClassVar[ConfigDict] = _STRICT


# The keys of a world file, to suggest the nearest known one.
_KINDS: dict[str, type] = {
    "": World,
    "floor": FloorPlan,
    "walls": Wall,
    "doors": Doorway,
    "objects": WorldObject,
    "drive": DrivePlan,
    "variation": Variation,
}


def built_in_worlds() -> list[str]:
    """Return the names of the worlds that come with the package."""
    folder = resources.files(__package__) / "worlds"
    return sorted(item.name.removesuffix(".yaml") for item in folder.iterdir())


def built_in_world(name: str) -> World:
    """Return a world that comes with the package, such as "lab".

    Raises:
        HypermapError: If there is none of that name.
    """
    if name not in built_in_worlds():
        hint = did_you_mean(name, built_in_worlds())
        raise HypermapError(f"there is no world {name!r}; {hint}; or name a world file")
    with resources.as_file(resources.files(__package__) / "worlds" / f"{name}.yaml") as path:
        return load_world(path)


def demo_world() -> World:
    """Return the room of `hypermap demo`: 7 x 5 m, lived in."""
    return built_in_world("demo")


def load_world(path: str | Path) -> World:
    """Return the world that a YAML file describes.

    Raises:
        FileMissing: If there is no such file.
        FormatError: If it is not a world, its objects intersect each other or walls, float in
            the air, or are beside the floor, or the camera passes through a wall or an object.
    """
    path = Path(path)
    if not path.is_file():
        raise FileMissing(f"{path}: there is no such world file")
    data = read_yaml(path.read_bytes(), str(path), _TEXTS)
    if not isinstance(data, dict):
        raise FormatError("a world file has keys such as 'floor' and 'objects'", path=path)
    try:
        world = TypeAdapter(World).validate_python(data)
    except ValidationError as error:
        key, message = _first_problem(error)
        raise FormatError(message, path=path, key=key) from None
    _check_standing(world, path)
    return world


def _check_standing(world: World, path: Path) -> None:
    """Raise a FormatError if what is said of places cannot be."""
    # They know worlds.
    from hypermap.simulation.standing import bases, blocked, in_walls, off_floor, overlaps

    def named(i: int) -> str:
        return f"the {world.objects[i].label} at {_place(world.objects[i].place)}"

    for i, j in overlaps(world):
        message = f"{named(j)} stands in {named(i)}, which is objects[{i}]; move one of them, or"
        raise FormatError(f"{message} raise its z", path=path, key=f"objects[{j}]")
    for i in in_walls(world):
        message = f"{named(i)} stands in a wall; move it away from there"
        raise FormatError(message, path=path, key=f"objects[{i}]")
    for i in off_floor(world):
        message = f"{named(i)} is beside the floor; move it onto the floor, or add a rectangle"
        raise FormatError(f"{message} there", path=path, key=f"objects[{i}]")
    for i, base in enumerate(bases(world)):
        if base is None:
            message = (
                f"{named(i)} hangs in the air: nothing ends at its z of {world.objects[i].z:g} "
                "below it, and no wall is next to it; set its z to the height of what it stands on"
            )
            raise FormatError(message, path=path, key=f"objects[{i}]")
    if world.drive is not None and (obstacle := blocked(world)) is not None:
        number, thing = obstacle
        x, y, *_ = world.drive.waypoints[number]
        through = "a wall" if thing is None else named(thing)
        message = f"on its way to {_place((x, y))}, the camera passes through {through}; add a "
        message += "waypoint before, or move this one"
        raise FormatError(message, path=path, key=f"drive.waypoints[{number}]")


def _first_problem(error: ValidationError) -> tuple[str | None, str]:
    """Return the key and the message of the first thing that is wrong."""
    problem = error.errors()[0]
    location = problem["loc"]
    key = place_of(location) or None
    if problem["type"] == "unexpected_keyword_argument":
        parents = [part for part in location[:-1] if isinstance(part, str)]
        kind = _KINDS[parents[-1] if parents else ""]
        hint = did_you_mean(str(location[-1]), (f.name for f in fields(kind)))
        return key, f"unknown key; {hint}"
    if problem["type"] == "missing":
        return key, "is missing"
    if problem["type"] == "value_error":
        return key, str(problem["ctx"]["error"])
    if problem["type"] == "dataclass_type":
        return key, f"expected keys and values, found {found(problem['input'])}"
    message = f"{problem['msg'][0].lower()}{problem['msg'][1:]}"
    message = message.replace("tuple", "list").replace(" after validation", "")
    return key, f"{message}, found {found(problem['input'])}"


def _check_rectangle(rectangle: Rectangle) -> None:
    x0, y0, x1, y1 = rectangle
    if not (x0 < x1 and y0 < y1):
        raise ValueError("a rectangle is xmin, ymin, xmax, ymax, each minimum below its maximum")


def _from_front_right(outline: Sequence[Point], yaw: float) -> NDArray[np.float64]:
    """Return corners counter-clockwise, from the right end of the side that faces a direction."""
    corners = np.array(outline, dtype=np.float64)
    if not shapely.LinearRing(corners).is_ccw:
        corners = corners[::-1]
    along = np.roll(corners, -1, axis=0) - corners
    outwards = np.column_stack([along[:, 1], -along[:, 0]])
    outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
    front = int(np.argmax(outwards @ [math.cos(yaw), math.sin(yaw)]))
    return np.roll(corners, -front, axis=0)


def _place(point: Point) -> str:
    return f"({point[0]:g}, {point[1]:g})"
