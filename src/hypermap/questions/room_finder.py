"""Finds the rooms that a question refers to, and the objects that are in them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property

import numpy as np

from hypermap.core.arrays import BoolArray, IntArray
from hypermap.core.errors import HypermapError
from hypermap.core.frames import Pose2D
from hypermap.core.hypermap import ROOMS, Hypermap, Matches
from hypermap.questions.frames import pose_of_asker
from hypermap.questions.query import Condition, Reference
from hypermap.rooms.kinds import rooms_of_points
from hypermap.rooms.questions import rooms_asked, rooms_at, rooms_called
from hypermap.rooms.rooms import Room, Rooms, known_rooms


class RoomFinder:
    """Finds rooms for one query.

    Args:
        hypermap: the map.
        asker: where the asker is, in the base frame; None if that is not known.
    """

    def __init__(self, hypermap: Hypermap, asker: Pose2D | None) -> None:
        self._hypermap, self._asker = hypermap, asker

    @cached_property
    def known(self) -> Rooms:
        """The rooms of the map; raises HypermapError if it has none."""
        return known_rooms(self._hypermap)

    @cached_property
    def of_asker(self) -> Room:
        """The room in which the asker is; raises HypermapError if that is none."""
        pose = pose_of_asker(self._asker)
        (room,) = rooms_at(self.known, (pose.x, pose.y))
        if room is None:
            raise HypermapError(f"({pose.x:g}, {pose.y:g}), your position, is in no room")
        return room

    def check(self) -> None:
        """Raise a HypermapError if the map has no rooms."""
        _ = self.known

    def called(self, names: Iterable[str]) -> list[Room]:
        """Return the rooms of some names; raises HypermapError if there is none of a name."""
        return [room for name in names for room in rooms_asked(self._hypermap, name)]

    def meant(self, reference: Reference) -> list[Room]:
        """Return the rooms that the names of objects mean, or that the asker is in."""
        if reference.is_asker:
            return [self.of_asker]
        if not reference.names or reference.where or ROOMS not in self._hypermap:
            return []
        return [room for name in reference.names for room in rooms_called(self.known, name)]

    def within(self, where: Iterable[Condition]) -> list[Room]:
        """Return the rooms in which objects that meet conditions may be."""
        kept = [*self.known]
        for one in where:
            reference = one.reference
            if one.relation != "in" or not (reference.rooms or reference.is_asker):
                continue
            meant = self.called(reference.rooms) or [self.of_asker]
            ids = {room.id for room in meant}
            kept = [room for room in kept if (room.id in ids) != one.negated]
        return kept

    def places_of(self, found: Matches) -> IntArray:
        """Return the place of each object's room among the rooms, shape (N,); -1 for none.

        A room is its own.
        """
        places = rooms_of_points(self.known, found.centroids)
        are_rooms = found.are_of(ROOMS)
        if are_rooms.any():
            by_id = {room.id: place for place, room in enumerate(self.known)}
            places[are_rooms] = [by_id[one] for one in found.column("ids")[are_rooms].tolist()]
        return places

    def of(self, found: Matches) -> list[Room]:
        """Return the rooms in which there are some objects."""
        there = set(self.places_of(found).tolist())
        return [room for place, room in enumerate(self.known) if place in there]

    def are_in(self, rooms: Sequence[Room], found: Matches, only_rooms: bool) -> BoolArray:
        """Return which objects are in one of some rooms, shape (N,); no room is in another.

        Where rooms alone are asked, it is these rooms themselves.
        """
        ids = {room.id for room in rooms}
        if only_rooms:
            return np.isin(found.column("ids"), [*ids])
        places = [place for place, room in enumerate(self.known) if room.id in ids]
        return np.isin(self.places_of(found), places) & ~found.are_of(ROOMS)

    def have(self, others: Matches, found: Matches) -> BoolArray:
        """Return which objects are rooms in which there is one of some others, shape (N,)."""
        ids = [room.id for room in self.of(others)]
        return found.are_of(ROOMS) & np.isin(found.column("ids"), ids)

    def are_next_door(self, reference: Reference, found: Matches) -> BoolArray:
        """Return which objects are rooms that have a door to one of some rooms, shape (N,)."""
        rooms = self.called(reference.rooms) or self.meant(reference)
        ids = {room.id for room in rooms}
        ways = [way for door in self.known.doors for way in (door.rooms, door.rooms[::-1])]
        beyond = [there for here, there in ways if here in ids]
        return found.are_of(ROOMS) & np.isin(found.column("ids"), beyond)

    def are_only(self, others: Matches, found: Matches) -> BoolArray:
        """Return which objects are in a room of some others because they are one of these alone."""
        own = self.places_of(others)
        _, place, count = np.unique(own, return_inverse=True, return_counts=True)
        return np.isin(found.keys, others.keys[count[place] == 1])
