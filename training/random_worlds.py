"""Random worlds to train on: rooms, corridors and halls, furnished as people could have done it."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np
import shapely
from furniture import ANYWHERE, AT_WALLS, Furniture, any_color, pale_color, wood_color

from hypermap.simulation.trajectory import DrivePlan, camera_poses
from hypermap.simulation.world import Doorway, FloorPlan, Wall, World, WorldObject

# Share of the worlds, and the least and largest length and width [m].
KINDS = {
    "room": (0.4, (3.5, 3.0), (10.0, 7.5)),
    "corridor": (0.2, (8.0, 1.5), (40.0, 5.0)),
    "hall": (0.2, (8.0, 7.0), (18.0, 13.0)),
    "rooms": (0.2, (7.0, 6.0), (16.0, 12.0)),
}
SMALL = ("mouse", "cup", "bottle", "keyboard", "fan", "carton")
_TRIES = 4  # to find a place for a thing
_CAMERA_MARGIN = 0.25  # meters between the camera and what stands around


class RandomWorld:
    """A floor with walls, and furniture on it."""

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
        self._furniture = Furniture(rng, self._room)
        self._height = float(rng.uniform(2.3, 3.4))
        self._paint = pale_color(rng) if rng.random() < 0.8 else any_color(rng)
        self._walls = [self._outer_wall()]
        {
            "room": self._furnish_room,
            "corridor": self._furnish_corridor,
            "hall": self._furnish_hall,
            "rooms": self._furnish_rooms,
        }[self.kind]()

    def world(self) -> World:
        """Return the floor with all that is on it."""
        rng = self._rng
        color = wood_color(rng) if rng.random() < 0.7 else any_color(rng)
        floor = FloorPlan(rectangle=(0.0, 0.0, *map(float, self._room)), color=color)
        return World("random", floor, tuple(self._furniture.things), tuple(self._walls))

    def camera_pose(self) -> np.ndarray:
        """Return `map_T_camera` of a place with some room around, shape (4, 4)."""
        rng = self._rng
        small = [thing for thing in self._furniture.things if thing.model in SMALL]
        if small and rng.random() < 0.2:
            return self._look_closely(small[rng.integers(len(small))])
        place = self._free_place()
        if self._furniture.things and rng.random() < (0.5 if self.kind == "corridor" else 0.8):
            x, y = self._furniture.things[rng.integers(len(self._furniture.things))].place
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
        return float(
            shapely.distance(self._furniture.taken, shapely.Point(place)).min(initial=np.inf)
        )

    def _furnish_room(self) -> None:
        rng = self._rng
        if rng.random() < 0.4:
            self._add_partition()
        self._furnish(tables=rng.integers(1, 5), at_walls=rng.integers(4, 13))
        self._try_often(rng.integers(3, 9), self._furniture.add_anywhere, ANYWHERE)

    def _furnish_corridor(self) -> None:
        rng = self._rng
        length = float(self._room.max())
        if rng.random() < 0.7:
            self._furniture.add_doors(pitch=rng.uniform(1.4, 4.5), color=wood_color(rng))
        if rng.random() < 0.2:
            self._add_partition()
        for _ in range(rng.integers(0, 3)):
            self._furniture.add_row_at_wall()
        self._furnish(tables=rng.integers(0, 3), at_walls=int(length * rng.uniform(0.2, 0.8)))
        self._try_often(rng.integers(0, 5), self._furniture.add_anywhere, ANYWHERE)

    def _furnish_hall(self) -> None:
        rng = self._rng
        kind = rng.random()
        for _ in range(rng.integers(1, 5)):
            if kind < 0.4:
                self._furniture.add_row(
                    self._furniture.add_shelf, rng.integers(2, 6), rng.uniform(2.0, 2.6)
                )
            elif kind < 0.8:
                self._furniture.add_row(
                    self._furniture.add_desk, rng.integers(2, 6), rng.uniform(1.5, 2.4)
                )
            else:
                add = partial(self._furniture.add_model, "chair")
                self._furniture.add_row(add, rng.integers(3, 9), rng.uniform(0.5, 0.9))
        for _ in range(rng.integers(0, 3)):
            self._furniture.add_row_at_wall()
        if rng.random() < 0.3:
            self._add_partition()
        self._furnish(tables=rng.integers(0, 5), at_walls=rng.integers(4, 15))
        self._try_often(rng.integers(4, 13), self._furniture.add_anywhere, ANYWHERE)

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
        self._try_often(rng.integers(3, 11), self._furniture.add_anywhere, ANYWHERE)

    def _furnish(self, tables: int, at_walls: int) -> None:
        for _ in range(tables):
            self._furniture.add_table()
        self._try_often(at_walls, self._furniture.add_at_wall, AT_WALLS)

    def _try_often(self, count: int, add: Callable[[str], bool], models: tuple[str, ...]) -> None:
        for _ in range(count):
            model = str(self._rng.choice(models))
            any(add(model) for _ in range(_TRIES))

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
                color=pale_color(rng),
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
            self._furniture.faces.append(tuple(map(tuple, corners.tolist())))

    def _add_wall(self, wall: Wall) -> None:
        self._walls.append(wall)
        self._furniture.taken.append(shapely.LineString(wall.corners()).buffer(wall.thickness / 2))


def _camera(place: np.ndarray, yaw: float, height: float, pitch: float) -> np.ndarray:
    drive = DrivePlan(((0.0, 0.0),), camera_height=float(height), pitch_deg=float(pitch))
    return camera_poses([[*place, yaw]], drive)[0]
