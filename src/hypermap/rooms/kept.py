"""Recognizes rooms by their location when rooms are found again."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import shapely

from hypermap.core.errors import HypermapError
from hypermap.core.semantic import SemanticLayer
from hypermap.rooms.rooms import Room, Rooms

_SAME = 0.5  # of the smaller one's area is in both at least, where an old room is a new one
_log = logging.getLogger(__name__)


def numbered(rooms: Rooms, previous: SemanticLayer | None) -> Rooms:
    """Return rooms with the ids, and names given by hand, of those found before.

    Of several new rooms in an old one, that with the largest part of it is the old one. New ones
    get ids that were never given before.

    Raises:
        HypermapError: If the rooms are in different frames.
    """
    if previous is None or not len(previous):
        return rooms
    if previous.frame_id != rooms.frame_id:
        raise HypermapError(
            f"layer {previous.name!r} is in frame {previous.frame_id!r}, the rooms in "
            f"{rooms.frame_id!r}: remove the layer to find rooms again"
        )
    old = Rooms.of_layer(previous)
    same = _same(rooms, old)
    free = previous.snapshot.next_id
    result = []
    for place, room in enumerate(rooms):
        if place not in same:
            result.append(replace(room, id=free))
            free += 1
            continue
        before = old.rooms[same[place]]
        result.append(replace(before, outline=room.outline))
        if before.is_named:
            _tell_of_walls(before, [each for i, each in enumerate(rooms) if i not in same])
    for place in set(range(len(old))) - set(same.values()):
        if old.rooms[place].is_named:
            _log.warning(
                "room %r (id %d), named by hand, is no longer in the map",
                old.rooms[place].name,
                old.rooms[place].id,
            )
    return rooms.replaced(result)


def _tell_of_walls(before: Room, added: list[Room]) -> None:
    """Warn if a room that a person named or drew covered what are other rooms now."""
    outline = shapely.make_valid(before.outline)
    parts = [
        each
        for each in added
        if shapely.intersection(outline, each.outline).area >= _SAME * each.area
    ]
    if parts:
        _log.warning(
            "room %r (id %d) reached through a wall or door: it ends there now; beyond are others",
            before.name,
            before.id,
        )


def _same(new: Rooms, old: Rooms) -> dict[int, int]:
    """Return the place of the old room for the place of each new one that is the same."""
    outlines = np.array([shapely.make_valid(room.outline) for room in new], dtype=object)
    before = np.array([shapely.make_valid(room.outline) for room in old], dtype=object)
    if not len(outlines):
        return {}
    news, olds = shapely.STRtree(before).query(outlines, predicate="intersects")
    shared = shapely.area(shapely.intersection(outlines[news], before[olds]))
    smaller = np.minimum(shapely.area(outlines[news]), shapely.area(before[olds]))
    same: dict[int, int] = {}
    taken: set[int] = set()
    for i in np.lexsort((olds, news, -shared)).tolist():
        one, other = int(news[i]), int(olds[i])
        if shared[i] >= _SAME * smaller[i] and one not in same and other not in taken:
            same[one] = other
            taken.add(other)
    return same
