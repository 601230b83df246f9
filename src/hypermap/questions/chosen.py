"""Which of several objects or rooms a query is about: the nearest, the largest, the newest ones."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely

from hypermap.core.arrays import IntArray
from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Matches
from hypermap.core.objects import probability_of
from hypermap.questions.finder import ASKER, Finder
from hypermap.questions.query import OF_COUNTS, Query
from hypermap.questions.relations import NO_HEIGHTS, heights_of
from hypermap.rooms.questions import rooms_called
from hypermap.rooms.rooms import Room


def chosen_objects(finder: Finder, query: Query, found: Matches) -> Matches:
    """Return the chosen ones of all that meet the conditions."""
    is_later = query.which in ("highest", "lowest", *OF_COUNTS)  # when there are numbers
    if query.give == "distance" or query.which in ("nearest", "farthest"):
        found = _with_distances(finder, query, found)
        if query.which == "farthest":
            found = found.take(slice(None, None, -1))
    elif query.which == "tallest":
        found = _tallest_first(finder, found)
    elif query.which is not None and not is_later:
        found = found.take(_order(query.which, found))
    if query.which is not None and not is_later:
        _note_rank(finder, query, len(found))
        found = found.take(query.chosen)
    return found.take(_order("newest", found)) if query.give == "last_seen" else found


def _note_rank(finder: Finder, query: Query, count: int) -> None:
    """Note how many there are if none has the rank that is asked for."""
    if 0 < count < (query.rank or 0):
        finder.notes.append(f"there {'is' if count == 1 else 'are'} {count}")


def _tallest_first(finder: Finder, found: Matches) -> Matches:
    """Return the objects whose heights the map has, the tallest first."""
    low, high = heights_of(found).T
    known = np.flatnonzero(~np.isnan(high - low))
    if len(found) and not len(known):
        raise HypermapError(NO_HEIGHTS)
    if len(known) < len(found):
        more = len(found) - len(known)
        said = f"{more} more {'has' if more == 1 else 'have'} no known height"
        finder.notes.append(said)
    return found.take(known[np.argsort((low - high)[known], kind="stable")])


def _with_distances(finder: Finder, query: Query, found: Matches) -> Matches:
    """Return objects with their distances, nearest first; ties by those of their middles."""
    others = finder.others(query.start or ASKER)
    if not len(found) or not len(others):
        return found.take(slice(0, 0))
    if query.by == "path":
        return _by_path(finder, found, others)
    meters = found.distances_to(others)
    order = np.lexsort((found.centroid_distances_to(others), meters))
    return found.with_distances(meters).take(order[np.isfinite(meters[order])])


def _by_path(finder: Finder, found: Matches, others: Matches) -> Matches:
    if len(others) != 1:
        raise HypermapError(f"a path begins at one place; the question names {len(others)}")
    is_thing = others.keys[0] >= 0
    start: Any = int(others.column("ids")[0]) if is_thing else others.centroids[0]
    objects = found.first()
    rows = {(one.layer, one.object.id): row for row, one in enumerate(objects)}
    reached = finder.planner.by_path(objects, start)
    order = [rows[one.layer, one.object.id] for one in reached]
    return found.take(np.array(order, dtype=np.int64)).with_distances(
        np.array([one.distance for one in reached], dtype=np.float64)
    )


def _order(which: str, found: Matches) -> IntArray:
    """Return the rows of objects, the largest, smallest, surest or newest first."""
    if which in ("largest", "smallest"):
        areas = shapely.area(found.shapes)
        keys = areas if which == "smallest" else -areas
    elif which == "surest":
        columns = zip(found.column("confidence"), found.column("existence"), strict=True)
        keys = -np.nan_to_num([probability_of(*known) for known in columns])
    else:
        keys = -np.nan_to_num(found.column("last_seen"), nan=-np.inf, neginf=-np.inf)
    return np.argsort(keys, kind="stable")


def chosen_rooms(finder: Finder, query: Query) -> list[Room]:
    """Return the rooms of some names or kinds, of any if there are none."""
    if query.rooms in ((), ("room",)):  # any
        rooms = [*finder.rooms.known]
    else:
        called = {r.id: r for name in query.rooms for r in rooms_called(finder.rooms.known, name)}
        rooms = [*called.values()]
    far: dict[int, float] = {}
    if query.which in ("largest", "smallest"):
        rooms.sort(key=lambda room: room.area, reverse=query.which == "largest")
    elif query.which in ("nearest", "farthest") or query.give == "distance":
        near = shapely.union_all(finder.others(query.start or ASKER).shapes)
        far = {room.id: float(shapely.distance(room.outline, near)) for room in rooms}
        rooms.sort(key=lambda room: far[room.id], reverse=query.which == "farthest")
    elif query.which is not None:
        raise HypermapError(f"no room is the {query.which}; ask for the largest or the nearest")
    if query.which is not None:
        _note_rank(finder, query, len(rooms))
        rooms = rooms[query.chosen]
    if far:
        finder.notes += [f"{room.name} is {far[room.id]:.2f} m away" for room in rooms]
    return rooms
