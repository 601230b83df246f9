"""Finds the objects that are of some names and meet conditions, and what these refer to."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from hypermap.core.arrays import BoolArray, ObjectArray, as_objects
from hypermap.core.errors import HypermapError, did_you_mean
from hypermap.core.frames import Pose2D
from hypermap.core.hypermap import ROOMS, Hypermap, Matches
from hypermap.core.layer import Layer
from hypermap.core.semantic import SemanticLayer
from hypermap.core.shapes import as_area
from hypermap.questions.departed import departed
from hypermap.questions.frames import pose_of_asker
from hypermap.questions.query import Condition, Reference
from hypermap.questions.relations import (
    Sides,
    SidesOfAsker,
    Stacks,
    any_pair,
    are_between,
    are_carrying,
    are_near,
)
from hypermap.questions.room_finder import RoomFinder
from hypermap.questions.taxonomy import Taxonomy
from hypermap.rooms.rooms import rooms_on
from hypermap.text import printable

if TYPE_CHECKING:
    from hypermap.paths import Planner

NEXT_TO = 1.0  # [m] between the shapes of objects that are next to each other
ASKER = Reference(is_asker=True)

# Relations to something that may be far away.
_FAR_REACHING = ("beyond", "visible from", "with", "in the room of", "next door to")
_FEW = 100  # places, around which objects are looked up
_DOORS = ("door", "doorway")
_MOST_DOORS = 10  # that an error lists
_IN_SIGHT = 2.0  # [m] up to which an object is beside, in front of or behind another


class Finder:
    """Finds objects for one query; what several of its parts need is found once.

    Attributes:
        rooms: finds rooms for it.
        notes: what is to be said next to the answer.

    Args:
        hypermap: the map.
        exact: whether names are those of the map alone; rooms are objects, too.
        asker: where the asker is, in the base frame; None if that is not known.
        taxonomy: names and kinds of objects.
        robot_radius: of the robot that distances by path are for [m].
    """

    def __init__(
        self,
        hypermap: Hypermap,
        exact: bool,
        asker: Pose2D | None,
        taxonomy: Taxonomy,
        robot_radius: float,
    ) -> None:
        self._hypermap, self._exact, self._asker = hypermap, exact, asker
        self.rooms = RoomFinder(hypermap, asker)
        self._taxonomy, self._robot_radius = taxonomy, robot_radius
        self._known: dict[Reference, Matches] = {}
        self.notes: list[str] = []

    @cached_property
    def _names(self) -> list[str]:
        """The names of the map's objects."""
        layers = (layer for layer in self._hypermap if isinstance(layer, SemanticLayer))
        names = {n for one in layers if one.name != ROOMS for n in one.table.names_in_use}
        return sorted(names)

    def matching(self, name: str) -> list[str]:
        """Return the names of the map's objects that a name means, none for a name and an id."""
        if self._exact:
            return [name]
        return self._taxonomy.matching(name, self._names)

    def _means(self, name: str, other: str) -> bool:
        """Return whether a name means objects of another one."""
        return bool(self._taxonomy.matching(name, [other]))

    def objects(
        self,
        names: tuple[str, ...],
        where: tuple[Condition, ...],
        layers: Sequence[Layer] | None = None,
    ) -> Matches:
        """Return the objects of some names, of any if there are none, that meet conditions.

        Args:
            names: any of which matches.
            where: all of which hold.
            layers: of the objects; None for all.
        """
        if not all(one.negated or one.relation == "beyond" or self._is_there(one) for one in where):
            return Matches.of_shapes(as_objects([]))
        found = self._called(names, self._search_area(where), layers)
        if not self._exact and not any(each.name == ROOMS for each in layers or ()):
            found = found.take(~found.are_of(ROOMS))
        only_rooms = bool(layers) and all(each.name == ROOMS for each in layers or ())
        for condition in where:
            found = found.take(self._holds(condition, found, only_rooms) ^ condition.negated)
        if any(one.relation == "at" and one.reference.point_xy for one in where):
            found = found.take(np.argsort(shapely.area(found.shapes), kind="stable"))
        return found

    def _called(
        self, names: tuple[str, ...], area: BaseGeometry | None, layers: Sequence[Layer] | None
    ) -> Matches:
        """Return the objects of names or kinds, and those of a name and an id, as "chair 14".

        Args:
            names: any of which matches; none for any object.
            area: that they reach into; None for anywhere.
            layers: of the objects; None for all.
        """
        wanted: dict[str, set[int]] = {}  # by name; no ids for any
        for name in names:
            by_id = None if self._exact else re.fullmatch(r"(.+) (\d+)", name)
            what, number = name, set[int]()
            if by_id is not None and name not in self._names:
                what, number = by_id[1], {int(by_id[2])}
            matching = self.matching(what)
            for one in matching:
                ids = wanted.setdefault(one, set(number))
                wanted[one] = ids | number if ids and number else set()
            if not matching:
                doors = self._doors_between_rooms(what)
                if doors and len(names) == 1:
                    raise HypermapError(doors)
                is_known = self._taxonomy.usual_name(what) is not None
                hint = f"; {did_you_mean(what, self._names)}"
                if is_known:
                    like = self._taxonomy.related(what, self._names)
                    hint = f"; similar: {', '.join(map(printable, like[:3]))}" if like else ""
                if (last := departed(self._hypermap, partial(self._means, what))) is not None:
                    hint = f"; {last.sentence()}"
                self.notes.append(doors or f"there is no {what} in the map{hint}")
        only = [layer.name for layer in layers or () if isinstance(layer, SemanticLayer)]
        if (names and not wanted) or (layers is not None and not only):
            return Matches.of_shapes(as_objects([]))
        layer = only[0] if len(only) == 1 else None
        found = self._hypermap.matching([*wanted] if names else None, area=area, layer=layer)
        if len(only) > 1:
            found = found.take(np.any([found.are_of(name) for name in only], axis=0))
        if not any(wanted.values()):
            return found
        pairs = zip(found.column("names").tolist(), found.column("ids").tolist(), strict=True)
        is_one = [not wanted[name] or number in wanted[name] for name, number in pairs]
        return found.take(np.array(is_one, dtype=bool))

    def _doors_between_rooms(self, name: str) -> str:
        """Return a sentence on doors that are known only between rooms, if a name means doors."""
        rooms = rooms_on(self._hypermap) if self._taxonomy.usual_name(name) in _DOORS else None
        if rooms is None or not rooms.doors:
            return ""
        doors = []
        for door in rooms.doors[:_MOST_DOORS]:
            (x, y), (one, other) = door.place_xy, (printable(rooms[i].name) for i in door.rooms)
            doors.append(f"{one} to {other} at ({x:.2f}, {y:.2f}), {door.width:.2f} m wide")
        more = f"; {len(rooms.doors) - len(doors)} more" if len(rooms.doors) > len(doors) else ""
        listed = "; ".join(doors) + more
        return f"the map has no object {name!r}, but doors between its rooms: {listed}"

    def _is_there(self, condition: Condition) -> bool:
        """Return whether there is anything that a condition refers to."""
        if condition.relation == "in" and self.rooms.meant(condition.reference):
            return True
        references = [condition.reference, *([condition.other] if condition.other else [])]
        return all(len(self.others(reference)) > 0 for reference in references)

    def _search_area(self, where: Iterable[Condition]) -> BaseGeometry | None:
        """Return an area outside of which no object meets conditions; None where it is not known.

        This is for speed alone: so few objects are looked at where a question is about few places.
        """
        for condition in where:
            if condition.negated or condition.relation in _FAR_REACHING:
                continue
            if condition.relation == "in" and condition.reference.is_asker:
                return shapely.buffer(self.rooms.of_asker.outline, _IN_SIGHT)
            if condition.relation == "in" and self.rooms.meant(condition.reference):
                continue
            shapes = self.others(condition.reference).shapes
            if condition.other is not None:
                both = [*shapes, *self.others(condition.other).shapes]
                shapes = as_objects([shapely.GeometryCollection(both)])
            if 0 < len(shapes) <= _FEW:
                within = max(condition.within or 0.0, _IN_SIGHT)
                boxes = shapely.box(*shapely.bounds(shapes).T)
                return shapely.union_all(shapely.buffer(boxes, within, join_style="mitre"))
        return None

    def _holds(self, condition: Condition, found: Matches, only_rooms: bool = False) -> BoolArray:
        """Return for which objects a condition holds, before it is negated."""
        reference, relation = condition.reference, condition.relation
        if reference.rooms and relation == "in":
            return self.rooms.are_in(self.rooms.called(reference.rooms), found, only_rooms)
        if relation == "in" and (rooms := self.rooms.meant(reference)):
            is_in = self.rooms.are_in(rooms, found, only_rooms)
            if not self._is_thing(reference):
                return is_in
            return is_in | self._meet(condition, found, self.others(reference))
        if relation == "with":
            return self.rooms.have(self.others(reference), found)
        if relation == "next door to":
            if not self.rooms.known.doors:
                self.notes.append("the map knows no doors between its rooms")
            return self.rooms.are_next_door(reference, found)
        if relation == "in the room of":
            others = self.others(reference)
            is_in = self.rooms.are_in(self.rooms.of(others), found, only_rooms)
            return is_in & ~self.rooms.are_only(others, found)
        if condition.other is not None:
            return self._are_between(found, (reference, condition.other))
        return self._meet(condition, found, self.others(reference))

    def _meet(self, condition: Condition, found: Matches, others: Matches) -> BoolArray:
        """Return for which objects a condition on some others holds, before it is negated."""
        relation = condition.relation
        if not len(found) or not len(others):
            return np.full(len(found), relation == "beyond" and bool(len(found)))
        if relation in ("near", "beyond"):
            is_near = are_near(
                found, others, NEXT_TO if condition.within is None else condition.within
            )
            return is_near if relation == "near" else ~is_near
        if relation == "at":
            return any_pair(found, others, found.shapes, "intersects")
        if relation in ("in", "on", "under"):
            middles: ObjectArray = np.asarray(shapely.points(found.centroids))
            is_so = None if relation == "in" else Stacks(relation, found, others)
            return any_pair(found, others, middles, "intersects", is_so=is_so)
        if relation == "carrying":
            return are_carrying(found, others)
        if relation == "visible from":
            return self._are_seen(condition.reference, found)
        asker = pose_of_asker(self._asker)
        is_beside: Sides | SidesOfAsker
        if condition.reference.is_asker:
            is_beside = SidesOfAsker(relation, found, asker)
            self.notes.append(f"you look along {math.degrees(asker.yaw):g} degrees")
        else:
            is_beside = Sides(relation, found, others, asker)
        return any_pair(found, others, found.shapes, "dwithin", _IN_SIGHT, is_beside)

    def _are_between(self, found: Matches, references: tuple[Reference, Reference]) -> BoolArray:
        """Return which objects are between two places; neither is between itself and the other."""
        one, other = (self._only(reference) for reference in references)
        is_end = np.isin(found.keys, [one.keys[0], other.keys[0]])
        return are_between(found, one.shapes[0], other.shapes[0]) & ~is_end

    def _are_seen(self, reference: Reference, found: Matches) -> BoolArray:
        """Return which objects have a line of sight from a place without a wall between."""
        place, own = self.place(reference), self.others(reference).keys[0]
        sight = self.planner.sight
        pairs = zip(found.keys.tolist(), found.shapes, strict=True)
        return np.array([key != own and sight.sees(place, shape) for key, shape in pairs], bool)

    def others(self, reference: Reference) -> Matches:
        """Return what a reference refers to; a point, an area or a room as one without an id."""
        if reference not in self._known:
            self._known[reference] = self._looked_up(reference)
        return self._known[reference]

    def _looked_up(self, reference: Reference) -> Matches:
        if reference.names:
            return self.objects(reference.names, reference.where)
        if reference.rooms:
            outlines = [room.outline for room in self.rooms.called(reference.rooms)]
            return Matches.of_shapes(as_objects(outlines))
        if reference.area is not None:
            return Matches.of_shapes(as_objects([as_area(shapely.from_wkt(reference.area))]))
        if reference.point_xy is not None:
            return Matches.of_shapes(as_objects([shapely.Point(reference.point_xy)]))
        pose = pose_of_asker(self._asker)
        return Matches.of_shapes(as_objects([shapely.Point(pose.x, pose.y)]))

    def _is_thing(self, reference: Reference) -> bool:
        """Return whether an object of the map has one of the names."""
        return any(set(self.matching(name)) & {*self._names} for name in reference.names)

    def place(self, reference: Reference) -> NDArray[np.float64]:
        """Return the one point that a reference refers to, shape (2,)."""
        return np.asarray(self._only(reference).centroids[0])

    def _only(self, reference: Reference) -> Matches:
        """Return the one object or place that a reference refers to."""
        others = self.others(reference)
        if len(others) != 1:
            name, said = " or ".join(reference.names), str(len(others))
            if reference.names and len(others):
                one = f"{reference.names[0]} {others.column('ids')[0]}"
                said += f" things called {name}; write one with its number, as {one!r}"
            raise HypermapError(f"this needs one place; the question names {said}")
        return others

    @cached_property
    def planner(self) -> Planner:
        """Plans paths on the map, and knows what is in sight."""
        from hypermap.paths import PathSettings, Planner  # with loops that take time to load

        return Planner(self._hypermap, PathSettings(self._robot_radius))
