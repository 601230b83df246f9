"""Worlds that change from day to day: things are moved, removed, added and swapped."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from hypermap.simulation.variation import Room, moved_by
from hypermap.simulation.world import Point, World, WorldObject

ChangeKind = Literal["moved", "removed", "added", "swapped", "door"]

_TRIES = 60  # places that are tried for each change; then there is none
_MOVES = (0.3, 5.0)  # [m] by which things are moved
SAME_SIZE = 0.05
"""Share by which the sizes of things that look alike differ at most."""

_DOOR = {"length": 0.06, "height": 2.0}  # of a closed door [m]
_MAX_GROUP = 3  # things that are moved or removed at once, such as a table with the objects on it


@dataclass(frozen=True)
class WorldChange:
    """What happened to one thing between two days.

    Attributes:
        kind: what. "door": it is closed, or open again.
        thing: its number, which stays the same over all days.
        before: what it was; None if it was not there.
        after: what it is; None if it is not there any more.
    """

    kind: ChangeKind
    thing: int
    before: WorldObject | None
    after: WorldObject | None


@dataclass(frozen=True)
class Day:
    """A world on one day.

    Attributes:
        world: what there is.
        things: the number of each of its objects.
        changes: what happened since the day before.
        next_thing: the number of the next new thing.
    """

    world: World
    things: tuple[int, ...]
    changes: tuple[WorldChange, ...]
    next_thing: int

    @classmethod
    def first(cls, world: World) -> Day:
        """Return the first day of a world."""
        count = len(world.objects)
        return cls(world, tuple(range(count)), (), count)


@dataclass(frozen=True)
class DailyChanges:
    """How many changes there are from one day to the next, of each kind, if there is room.

    Attributes:
        moved: groups of things, such as a table with the objects on it.
        removed: the same.
        added: copies of things that are there, at other places.
        swapped: pairs of things of one class and size that change places.
        doors: that close or open, where the robot does not pass.
    """

    moved: int = 2
    removed: int = 1
    added: int = 1
    swapped: int = 1
    doors: int = 1


def next_day(day: Day, seed: int, counts: DailyChanges | None = None) -> Day:
    """Return the world a day later.

    Nothing ends up inside anything else, in the robot's way or above the floor. No thing changes
    twice.

    Args:
        day: the day before.
        seed: of the random number generator.
        counts: how much changes; None for the defaults.
    """
    counts = counts or DailyChanges()
    draft = _Draft(day, np.random.default_rng([seed, 77]))
    steps: Sequence[tuple[int, Callable[[], bool]]] = (
        (counts.swapped, draft.swap),
        (counts.moved, draft.move),
        (counts.removed, draft.remove),
        (counts.added, draft.add),
        (counts.doors, draft.turn_door),
    )
    for count, step in steps:
        for _ in range(count):
            any(step() for _ in range(_TRIES))
    return draft.day()


def day_of(world: World, number: int, seed: int) -> Day:
    """Return a world on a day of a series, as `hypermap experiment days` has them.

    Args:
        world: what there is on the first day.
        number: of the day, from 1.
        seed: of the series.
    """
    day = Day.first(world)
    for later in range(2, number + 1):
        day = next_day(day, seed_of_day(seed, later))
    return day


def seed_of_day(seed: int, number: int) -> int:
    """Return the seed of a day's changes and errors, from that of its series."""
    return 1000 * seed + number - 1


class _Draft:
    """A day while it is being changed."""

    def __init__(self, day: Day, rng: np.random.Generator) -> None:
        self._things = list(day.things)
        self._change(day.world)
        self._next = day.next_thing
        self._rng = rng
        self._changes: list[WorldChange] = []

    def _change(self, world: World) -> None:
        self._world, self._room = world, Room(world)

    def day(self) -> Day:
        """Return the day so far."""
        return Day(self._world, tuple(self._things), tuple(self._changes), self._next)

    def swap(self) -> bool:
        """Let two things of one class and size change places; return whether they did."""
        room = self._room
        group = self._unchanged(room)
        if len(group) != 1:
            return False
        one = room.objects[group[0]]
        if one.at is None:
            return False
        others = [i for i in self._loose(room) if i != group[0] and room.objects[i].at is not None]
        others = [i for i in others if look_alike(one, room.objects[i])]
        if not others:
            return False
        other = room.objects[int(self._rng.choice(others))]
        pair = [group[0], room.objects.index(other)]
        after = [
            replace(one, at=other.at, yaw_deg=other.yaw_deg),
            replace(other, at=one.at, yaw_deg=one.yaw_deg),
        ]
        if math.dist(one.place, other.place) < _MOVES[0] or not room.accept(pair, after):
            return False
        self._take(room, "swapped", pair)
        return True

    def move(self) -> bool:
        """Move a thing, with the things on it."""
        room = self._room
        group = self._unchanged(room)
        if not 1 <= len(group) <= _MAX_GROUP:
            return False
        low, high = map(math.log, _MOVES)
        distance = math.exp(self._rng.uniform(low, high))
        direction, turn = self._rng.uniform(-math.pi, math.pi), self._rng.uniform(-90, 90)
        by = (distance * math.cos(direction), distance * math.sin(direction))
        about = room.objects[group[0]].place
        after = [moved_by(room.objects[i], about, by, float(turn)) for i in group]
        if not room.accept(group, after):
            return False
        self._take(room, "moved", group)
        return True

    def remove(self) -> bool:
        """Remove a thing, with the things on it."""
        group = self._unchanged(self._room)
        if not 1 <= len(group) <= _MAX_GROUP:
            return False
        self._drop("removed", group)
        return True

    def add(self) -> bool:
        """Add a copy of a thing."""
        room = self._room
        group = self._unchanged(room)
        if len(group) != 1:
            return False
        model = room.objects[group[0]]
        x0, y0, x1, y1 = self._rng.choice(np.array(self._world.floor.all_rectangles))
        place: Point = (float(self._rng.uniform(x0, x1)), float(self._rng.uniform(y0, y1)))
        by = (place[0] - model.place[0], place[1] - model.place[1])
        new = moved_by(model, model.place, by, float(self._rng.uniform(-180, 180)))
        if not room.has_room_for(new):
            return False
        self._bring("added", new)
        return True

    def turn_door(self) -> bool:
        """Close a door through which the robot does not drive, or open it again."""
        closed = [i for i, thing in enumerate(self._world.objects) if thing.name == "door"]
        closed = [i for i in closed if self._is_new(i)]
        if closed and self._rng.random() < 0.5:
            self._drop("door", [int(self._rng.choice(closed))])
            return True
        doors = [(wall, door) for wall in self._world.walls for door in wall.doors]
        if not doors:
            return False
        wall, door = doors[int(self._rng.integers(len(doors)))]
        corners = wall.corners()
        (ax, ay), (bx, by) = min(
            itertools.pairwise(corners),
            key=lambda ends: abs(math.dist(ends[0], door.at) + math.dist(door.at, ends[1])
                                 - math.dist(*ends)),
        )  # fmt: skip
        across = math.degrees(math.atan2(by - ay, bx - ax)) + 90
        size = {**_DOOR, "width": door.width}
        panel = WorldObject("panel", door.at, across, name="door", size=size)
        if not self._room.has_room_for(panel, in_a_gap=True):
            return False
        self._bring("door", panel)
        return True

    def _is_new(self, index: int) -> bool:
        """Return whether a door was closed by us, and not just now."""
        thing = self._things[index]
        return thing not in {change.thing for change in self._changes}

    def _unchanged(self, room: Room) -> list[int]:
        """Return a thing on the floor, with the things on it, if it is unchanged so far."""
        if not room.objects:
            return []
        group = room.group_of(int(self._rng.integers(len(room.objects))))
        changed = {change.thing for change in self._changes}
        return [] if any(self._things[i] in changed for i in group) else group

    def _loose(self, room: Room) -> list[int]:
        changed = {change.thing for change in self._changes}
        return [
            i
            for i in range(len(room.objects))
            if len(room.group_of(i)) == 1 and self._things[i] not in changed
        ]

    def _with(self, objects: Sequence[WorldObject]) -> World:
        return replace(self._world, objects=tuple(objects))

    def _take(self, room: Room, kind: ChangeKind, group: Sequence[int]) -> None:
        self._changes += [
            WorldChange(kind, self._things[i], self._world.objects[i], room.objects[i])
            for i in group
        ]
        self._change(self._with(room.objects))

    def _drop(self, kind: ChangeKind, group: Sequence[int]) -> None:
        objects = list(self._world.objects)
        for i in sorted(group, reverse=True):
            self._changes.append(WorldChange(kind, self._things.pop(i), objects.pop(i), None))
        self._change(self._with(objects))

    def _bring(self, kind: ChangeKind, new: WorldObject) -> None:
        self._changes.append(WorldChange(kind, self._next, None, new))
        self._things.append(self._next)
        self._next += 1
        self._change(self._with([*self._world.objects, new]))


def look_alike(one: WorldObject, other: WorldObject, share: float = SAME_SIZE) -> bool:
    """Return whether two things are of one class, and of nearly the same size.

    Such objects cannot be distinguished.

    Args:
        one: a thing.
        other: another one.
        share: by which their sizes differ at most.
    """
    is_same = (one.label, one.model, one.z) == (other.label, other.model, other.z)
    if not is_same or (one.outline is None) != (other.outline is None):
        return False
    sizes, others = _sizes(one), _sizes(other)
    keys = sizes.keys() | others.keys()
    return all(math.isclose(sizes.get(key, -1), others.get(key, -1), rel_tol=share) for key in keys)


def _sizes(thing: WorldObject) -> dict[str, float]:
    if thing.outline is None:
        return thing.size
    a, b, c, _ = thing.outline
    return {**thing.size, "length": math.dist(a, b), "width": math.dist(b, c)}
