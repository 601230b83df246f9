"""Answers a `Query` about a map: the one place that does."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import BoolArray, as_objects
from hypermap.core.errors import HypermapError, did_you_mean
from hypermap.core.frames import Pose2D
from hypermap.core.hypermap import ROOMS, FoundObject, Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.questions.query import Condition, Query, Reference, When
from hypermap.questions.relations import (
    Sides,
    Stacks,
    any_pair,
    distances,
    footprints,
    key_of,
)
from hypermap.questions.seen import seen_in
from hypermap.questions.taxonomy import Taxonomy, load_taxonomy
from hypermap.rooms.questions import rooms_asked, rooms_at, rooms_called
from hypermap.rooms.rooms import Room, Rooms, rooms_on

NEXT_TO = 1.0  # [m] between the shapes of things that are next to each other
_FEW = 100  # places, around which objects are looked up
_IN_SIGHT = 2.0  # [m] from a thing is what is beside it, or in front of it or behind it


@dataclass(frozen=True, eq=False)
class Answer:
    """What a map says to a query.

    Attributes:
        query: that.
        objects: those that meet its conditions, in the base frame; with distances where the query
            measures any, nearest first.
        rooms: those asked for, for "room" in the order of `objects`; None where one is in no room.
        notes: what is to be said next to it, such as that there is no object of a name.
    """

    query: Query
    objects: tuple[FoundObject, ...]
    rooms: tuple[Room | None, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def count(self) -> int:
        """How many there are: of the rooms if these are asked for, else of the objects."""
        return len(self.rooms) if self.query.asks_rooms else len(self.objects)

    @property
    def exists(self) -> bool:
        """Whether there is any."""
        return self.count > 0


def ask(
    hypermap: Hypermap,
    query: Query,
    *,
    asker: Pose2D | None = None,
    taxonomy: Taxonomy | None = None,
    robot_radius: float = 0.0,
) -> Answer:
    """Return the answer of a map to a query.

    Args:
        hypermap: the map.
        query: the question.
        asker: where the asker is, and where he or she looks, in the base frame.
        taxonomy: names and kinds of things; None for ours.
        robot_radius: of the robot that distances by path are for [m].

    Raises:
        HypermapError: If the query needs to know where the asker is, asks for rooms of a map that
            has none, for an unknown room, or for heights that the map does not have.

    >>> from hypermap import SemanticLayer, SemanticObject
    >>> things = [SemanticObject("couch", shapely.box(x, 0, x + 1, 1)) for x in (0, 4)]
    >>> hypermap = Hypermap([SemanticLayer("semantic", "map", things)])
    >>> ask(hypermap, Query("count", ("seating",))).count
    2
    """
    return _Asking(hypermap, asker, taxonomy or load_taxonomy(), robot_radius).answer(query)


class _Asking:
    def __init__(
        self, hypermap: Hypermap, asker: Pose2D | None, taxonomy: Taxonomy, robot_radius: float
    ) -> None:
        self._hypermap, self._asker, self._taxonomy = hypermap, asker, taxonomy
        self._robot_radius = robot_radius
        layers = [layer for layer in hypermap.layers if isinstance(layer, SemanticLayer)]
        others = [layer for layer in layers if layer.name != ROOMS]
        self._names = sorted({str(name) for layer in others for name in layer.names})
        self._notes: list[str] = []
        self._known: dict[Reference, list[FoundObject]] = {}

    def answer(self, query: Query) -> Answer:
        found: Sequence[FoundObject] = ()
        asks_objects = bool(query.names or query.besides or query.where or query.when)
        if asks_objects or not query.asks_rooms:
            found = self._found(query)
        rooms: list[Room | None] = []
        if query.asks_rooms:
            rooms = self._rooms_of(found) if asks_objects else self._asked_rooms(query)
        elif query.give == "room":
            rooms = rooms_at(self._rooms, [item.point_xy for item in found]) if found else []
        return Answer(query, tuple(found), tuple(rooms), tuple(dict.fromkeys(self._notes)))

    # Objects and rooms

    def _found(self, query: Query) -> list[FoundObject]:
        start = query.start or Reference(is_asker=True)
        is_plain = query.which == "nearest" and query.by == "air" and not start.names
        if is_plain and not (query.where or query.besides or query.when or start.rooms):
            # Few objects are created, where the map may have many.
            matching = [self._matching(name) for name in query.names]
            if all(matching):
                names = [name for some in matching for name in some]
                (place,) = self._others(start)
                most = (query.count or 1) + (len(self._rooms) if ROOMS in self._hypermap else 0)
                near = self._hypermap.objects(names or None, near=place.point_xy, limit=most)
                return [one for one in near if one.layer != ROOMS][: query.count or 1]
        found = self._objects(query.names, query.where, query.besides)
        return self._chosen(query, found if query.when is None else self._seen(query.when, found))

    def _matching(self, name: str) -> list[str]:
        """Return the names of the map's objects that a name means, none for a name and an id."""
        return self._taxonomy.matching(name, self._names)

    def _objects(
        self,
        names: tuple[str, ...],
        where: tuple[Condition, ...],
        besides: tuple[str, ...] = (),
    ) -> list[FoundObject]:
        """Return the objects of some names, of any if there are none, that meet conditions."""
        if not all(one.negated or one.relation == "beyond" or self._is_there(one) for one in where):
            return []
        area = self._reached(where)
        found = self._called(names, area) if names else self._hypermap.objects(area=area)
        others = {name for other in besides for name in self._taxonomy.matching(other, self._names)}
        found = [item for item in found if item.layer != ROOMS and item.object.name not in others]
        for condition in where:
            holds = self._holds(condition, found) ^ condition.negated
            found = [item for item, is_so in zip(found, holds.tolist(), strict=True) if is_so]
        return found

    def _called(self, names: tuple[str, ...], area: BaseGeometry | None) -> list[FoundObject]:
        """Return the objects of names or kinds, and those of a name and an id, as "chair 14".

        Args:
            names: any of which matches.
            area: that they reach into; None for anywhere.
        """
        wanted: dict[str, set[int]] = {}  # by name; no ids for any
        for name in names:
            by_id = re.fullmatch(r"(.+) (\d+)", name)
            what, number = name, set[int]()
            if by_id is not None and name not in self._names:
                what, number = by_id[1], {int(by_id[2])}
            matching = self._matching(what)
            for one in matching:
                ids = wanted.setdefault(one, set(number))
                wanted[one] = ids | number if ids and number else set()
            if not matching:
                known = self._taxonomy.usual_name(what) is not None
                hint = "" if known else f"; {did_you_mean(what, self._names)}"
                self._notes.append(f"there is no {what} in the map{hint}")
        if not wanted:
            return []
        found = self._hypermap.objects([*wanted], area=area)
        return [
            one
            for one in found
            if not wanted[one.object.name] or one.object.id in wanted[one.object.name]
        ]

    def _is_there(self, condition: Condition) -> bool:
        """Return whether there is anything that a condition refers to."""
        return bool(self._others(condition.reference))

    def _reached(self, where: Iterable[Condition]) -> BaseGeometry | None:
        """Return an area outside of which no object meets conditions; None where it is not known.

        This is for speed alone: so few objects are looked at where a question is about few places.
        """
        for condition in where:
            if condition.negated or condition.relation == "beyond":
                continue
            others = self._others(condition.reference)
            if others and len(others) <= _FEW:
                within = max(condition.within or 0.0, _IN_SIGHT)
                boxes = shapely.box(*shapely.bounds(footprints(others)).T)
                return shapely.union_all(shapely.buffer(boxes, within, join_style="mitre"))
        return None

    @property
    def _rooms(self) -> Rooms:
        rooms = rooms_on(self._hypermap)
        if rooms is None:
            raise HypermapError("the map has no rooms; `hypermap rooms MAP -o OUT` finds them")
        return rooms

    def _asked_rooms(self, query: Query) -> list[Room | None]:
        """Return the rooms of some names or kinds, of any if there are none."""
        if query.rooms in ((), ("room",)):  # any
            rooms = [*self._rooms]
        else:
            called = {r.id: r for name in query.rooms for r in rooms_called(self._rooms, name)}
            rooms = [*called.values()]
        if query.which in ("largest", "smallest"):
            rooms.sort(key=lambda room: room.area, reverse=query.which == "largest")
        elif query.which is not None or query.give == "distance":
            places = self._others(query.start or Reference(is_asker=True))
            near = shapely.union_all(footprints(places))
            far = {room.id: float(shapely.distance(room.outline, near)) for room in rooms}
            rooms.sort(key=lambda room: far[room.id], reverse=query.which == "farthest")
            self._notes += [f"room {room.id} is {far[room.id]:.2f} m away" for room in rooms]
        return [*(rooms[: query.count or 1] if query.which is not None else rooms)]

    def _rooms_called(self, names: Iterable[str]) -> list[Room]:
        return [room for name in names for room in rooms_asked(self._hypermap, name)]

    def _rooms_of(self, found: Sequence[FoundObject]) -> list[Room | None]:
        there = rooms_at(self._rooms, [item.point_xy for item in found]) if found else []
        ids = {room.id for room in there if room is not None}
        return [room for room in self._rooms if room.id in ids]

    # Conditions

    def _holds(self, condition: Condition, found: Sequence[FoundObject]) -> BoolArray:
        """Return for which objects a condition holds, before it is negated."""
        reference, relation = condition.reference, condition.relation
        if reference.rooms and relation == "in":
            ids = {room.id for room in self._rooms_called(reference.rooms)}
            there = rooms_at(self._rooms, [item.point_xy for item in found]) if found else []
            return np.array([room is not None and room.id in ids for room in there], dtype=bool)
        others = self._others(reference)
        if not found or not others:
            return np.full(len(found), relation == "beyond" and bool(found))
        if relation in ("near", "beyond"):
            within = NEXT_TO if condition.within is None else condition.within
            is_near = distances(found, others, within) <= within
            return is_near if relation == "near" else ~is_near
        if relation == "at":
            return any_pair(found, others, footprints(found), "intersects")
        if relation in ("in", "on", "under"):
            middles = as_objects([shapely.Point(item.point_xy) for item in found])
            is_so = None if relation == "in" else Stacks(relation, found, others)
            return any_pair(found, others, middles, "intersects", is_so=is_so)
        is_beside = Sides(relation, found, others, self._asker_pose())
        return any_pair(found, others, footprints(found), "dwithin", _IN_SIGHT, is_beside)

    def _others(self, reference: Reference) -> list[FoundObject]:
        """Return what a reference refers to; a point, a room or the asker as one without an id."""
        if reference.names:
            if reference not in self._known:
                self._known[reference] = self._objects(reference.names, reference.where)
            return self._known[reference]
        if reference.rooms:
            return [_somewhere(room.outline) for room in self._rooms_called(reference.rooms)]
        if reference.point_xy is not None:
            return [_somewhere(shapely.Point(reference.point_xy))]
        pose = self._asker_pose()
        return [_somewhere(shapely.Point(pose.x, pose.y))]

    def _asker_pose(self) -> Pose2D:
        if self._asker is None:
            raise HypermapError(
                "the answer depends on where you are; say it in the question, or give --pose "
                "X,Y or X,Y,YAW"
            )
        return self._asker

    def _seen(self, when: When, found: list[FoundObject]) -> list[FoundObject]:
        """Return the objects that were seen at a time, not seen since, or new then."""
        found, unsure = seen_in(when, found)
        if unsure:
            self._notes.append(f"{unsure} more were seen before and after, and may have been then")
        return found

    # Which of them

    def _chosen(self, query: Query, found: list[FoundObject]) -> list[FoundObject]:
        """Return those that are asked for, of all that meet the conditions."""
        if query.give == "distance" or query.which in ("nearest", "farthest"):
            found = self._with_distances(query, found)
            if query.which == "farthest":
                found = found[::-1]
        elif query.give == "last_seen" and query.which is None:
            found = sorted(found, key=_ORDERS["newest"])
        elif query.which is not None:
            found = sorted(found, key=_ORDERS[query.which])
        return found[: query.count or 1] if query.which is not None else found

    def _with_distances(self, query: Query, found: list[FoundObject]) -> list[FoundObject]:
        """Return objects with their distances, nearest first."""
        if not found:
            return found
        start = query.start or Reference(is_asker=True)
        others = self._others(start)
        if query.by == "path":
            return self._by_path(found, others)
        if not others:
            return []
        keys = {key_of(one) for one in others if one.object.id is not None}
        found = [one for one in found if key_of(one) not in keys] or found
        meters = distances(found, others).tolist()
        measured = [
            replace(one, distance=far)
            for one, far in zip(found, meters, strict=True)
            if math.isfinite(far)
        ]
        return sorted(measured, key=lambda one: one.distance or 0.0)

    def _by_path(
        self, found: Sequence[FoundObject], others: Sequence[FoundObject]
    ) -> list[FoundObject]:
        from hypermap.paths import PathSettings, Planner  # with loops that take time to load

        if len(others) != 1:
            raise HypermapError(f"a path begins at one place; the question names {len(others)}")
        planner = Planner(self._hypermap, PathSettings(self._robot_radius))
        (other,) = others
        is_thing = other.object.id is not None
        start: Any = other.object.id if is_thing else other.point_xy.tolist()
        return planner.by_path(found, start)


_ORDERS: dict[str, Any] = {
    "largest": lambda one: -one.object.footprint.area,
    "smallest": lambda one: one.object.footprint.area,
    "surest": lambda one: -(one.object.existence or 0.0),
    "newest": lambda one: -(one.object.last_seen or 0.0),
}


def _somewhere(shape: Any) -> FoundObject:
    from hypermap.core.objects import SemanticObject

    place = SemanticObject("place", shape if shape.area else shape.buffer(1e-6))
    return FoundObject("", np.array(shape.centroid.coords[0]), object=place)
