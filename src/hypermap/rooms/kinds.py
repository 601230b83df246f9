"""Guesses the kind and name of a room from its objects and its shape."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import FloatArray, IntArray, ObjectArray, as_objects
from hypermap.core.errors import NOT_UTF8, FileMissing, FormatError
from hypermap.core.semantic import SemanticObject
from hypermap.rooms.rooms import Room, Rooms
from hypermap.simple_yaml import parse_simple_yaml

OURS = Path(__file__).with_name("kinds.yaml")
LONG_AND_THIN = "(long and thin)"

_UNKNOWN = "room"  # what a room of no kind is called
_LEAST = 0.4  # how sure a kind is at least
_MOST = 3  # objects of one name count
_NONE = 1.0  # what always speaks for no kind
_LONG = 3.0  # times its width is a long room's length at least
_THIN = 3.5  # [m] is a thin room's width at most
_WIDE = 0.4  # of a corridor's area may be wider, as where it meets another
_PRECISE = 0.05  # [m] by which the measured width may be wrong
_IN_THE_WALL = 0.5  # [m] from a room may what is fixed to its wall seem to be


@dataclass(frozen=True)
class Kinds:
    """The table of kinds.

    Attributes:
        votes: for each kind, the weight of an object of each name. Names are in lower case and
            without blanks and "_".
    """

    votes: Mapping[str, Mapping[str, float]]

    def guess(self, names: Iterable[str]) -> tuple[str, float]:
        """Return the kind of a room with these objects, and its confidence.

        How sure is the share of the kind in all that speaks for any kind, where something always
        speaks for none. The kind is empty if that is below 0.4.

        >>> Kinds({"kitchen": {"sink": 2}, "bathroom": {"sink": 1}}).guess(["sink", "chair"])
        ('kitchen', 0.5)
        """
        counts = Counter(map(_key, names))
        speaks = {
            kind: sum(
                weight * min(counts[name], _MOST)
                for name, weight in votes.items()
                if name in counts
            )
            for kind, votes in self.votes.items()
        }
        best = max(speaks, key=lambda kind: speaks[kind], default="")
        if not best:
            return "", 0.0
        sure = speaks[best] / (sum(speaks.values()) + _NONE)
        return (best, round(sure, 3)) if sure >= _LEAST else ("", 0.0)


def load_kinds(path: str | Path = OURS) -> Kinds:
    """Return a table of kinds from a YAML file: each kind, and under it names with numbers.

    Raises:
        FileMissing: If there is no such file.
        FormatError: If it holds something else.
    """
    try:
        parsed = parse_simple_yaml(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise FileMissing(f"{path}: there is no such file") from None
    except UnicodeDecodeError:
        raise FormatError(NOT_UTF8, path=path) from None
    except (OSError, ValueError) as error:
        said = " ".join(str(error).split())
        raise FormatError(f"this is not a readable YAML file ({said})", path=path) from None
    shape = "each kind with names and numbers is expected, as 'kitchen: {oven: 3, sink: 1.5}'"
    if not isinstance(parsed, dict):
        raise FormatError(shape, path=path)
    votes: dict[str, dict[str, float]] = {}
    for kind, entries in parsed.items():
        if not isinstance(kind, str) or not isinstance(entries, dict):
            raise FormatError(shape, path=path, key=str(kind))
        for name, weight in entries.items():
            is_number = isinstance(weight, int | float) and not isinstance(weight, bool)
            if not is_number or not math.isfinite(weight) or weight < 0:
                raise FormatError(
                    f"{weight!r} is not a number of at least 0", path=path, key=f"{kind}.{name}"
                )
        votes[kind] = {_key(str(name)): float(weight) for name, weight in entries.items()}
    return Kinds(votes)


def guess_kinds(rooms: Rooms, objects: Iterable[SemanticObject], kinds: Kinds) -> Rooms:
    """Return rooms with kinds, and with names by their kinds where none was given by hand.

    The first room of a kind has its name, as "office"; others are numbered, as "office 2". A room
    whose kind stays keeps its name.

    Args:
        rooms: those.
        objects: the objects in them, in their frame.
        kinds: the table.
    """
    inside = _inside(rooms, objects)
    found = []
    for room, names in zip(rooms, inside, strict=True):
        kind, sure = kinds.guess([*names, *[LONG_AND_THIN] * _long_and_thin(room.outline)])
        found.append(replace(room, kind=kind, sure=sure))
    return rooms.replaced(_named(found))


def rooms_of(rooms: Rooms, places: Iterable[BaseGeometry]) -> list[int | None]:
    """Return the place in `rooms` of the room that each geometry's centroid is in, or None.

    What is up to half a meter away from a room, as in its wall, is in it, too.
    """
    centroids = shapely.centroid(as_objects(places))
    found = rooms_of_points(rooms, shapely.get_coordinates(centroids)).tolist()
    return [None if room < 0 else room for room in found]


def rooms_of_points(rooms: Rooms, points_xy: FloatArray) -> IntArray:
    """Return the place in `rooms` of the room that each point is in, or -1; like `rooms_of`.

    Args:
        rooms: the rooms.
        points_xy: in their frame [m], shape (N, 2).
    """
    found = np.full(len(points_xy), -1, dtype=np.int64)
    if len(points_xy) and len(rooms):
        tree = shapely.STRtree([room.outline for room in rooms])
        points: ObjectArray = np.asarray(shapely.points(points_xy))
        which, room = tree.query(points, predicate="intersects")  # much faster than the nearest
        found[which] = room
        rest = np.flatnonzero(found < 0)
        which, room = tree.query_nearest(points[rest], max_distance=_IN_THE_WALL, all_matches=False)
        found[rest[which]] = room
    return found


def _inside(rooms: Rooms, objects: Iterable[SemanticObject]) -> list[list[str]]:
    """Return the names of the objects in each room."""
    things = list(objects)
    names: list[list[str]] = [[] for _ in rooms]
    places = rooms_of(rooms, (thing.footprint for thing in things))
    for thing, place in zip(things, places, strict=True):
        if place is not None:
            names[place].append(thing.name)
    return names


def _long_and_thin(outline: BaseGeometry) -> int:
    """Return how many times the minimum length of a corridor an outline has; 0 if it is none.

    A corridor may turn and branch, and widen in places: where a disc of its largest width fits in.
    """
    if outline.is_empty or outline.area == 0:
        return 0
    circles: ObjectArray = np.asarray(shapely.maximum_inscribed_circle([outline], _PRECISE))
    width = 2 * float(circles[0].length)
    if width > _THIN:
        wide = outline.buffer(-_THIN / 2).buffer(_THIN / 2).intersection(outline)
        if wide.area > _WIDE * outline.area:
            return 0
        width = _THIN
    return int(outline.area / (_LONG * width**2))


def _named(rooms: list[Room]) -> list[Room]:
    taken = {room.name for room in rooms if room.is_named}
    result = list(rooms)
    waiting = []
    for place, room in enumerate(rooms):
        if room.is_named:
            continue
        base = room.kind or _UNKNOWN
        rest = room.name.removeprefix(base).strip()
        fits = room.name.startswith(base) and (rest == "" or rest.isdigit())
        if room.name and fits and room.name not in taken:
            taken.add(room.name)
        else:
            waiting.append(place)
    for place in waiting:
        base = result[place].kind or _UNKNOWN
        name, number = base, 1
        while name in taken:
            number += 1
            name = f"{base} {number}"
        taken.add(name)
        result[place] = replace(result[place], name=name)
    return result


def _key(name: str) -> str:
    return name.lower().replace(" ", "").replace("_", "")
