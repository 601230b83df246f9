"""How many objects there are in each room."""

from __future__ import annotations

import numpy as np

from hypermap.core.hypermap import Matches
from hypermap.questions.finder import Finder
from hypermap.questions.query import Query
from hypermap.rooms.rooms import Room


def counted_by_room(
    finder: Finder, query: Query, found: Matches
) -> tuple[Matches, list[Room], list[int]]:
    """Return the rooms that a query asks for, with how many objects are in each.

    Rooms without any count, too. All that have most, or fewest, are given, unless the query says
    how many.

    Args:
        finder: which knows the rooms.
        query: with `per`.
        found: the objects that meet its conditions.

    Returns:
        The objects in these rooms; the rooms, those with most or fewest first if the query asks for
        them; and the counts.
    """
    places = finder.rooms.places_of(found)
    counts = np.bincount(places[places >= 0], minlength=len(finder.rooms.known)).tolist()
    asked = {room.id for room in finder.rooms.within(query.where)}
    rooms = [place for place, room in enumerate(finder.rooms.known) if room.id in asked]
    if query.number is not None:
        rooms = [place for place in rooms if query.number.holds(counts[place])]
    if query.which is not None:
        rooms.sort(key=lambda place: counts[place], reverse=query.which == "most")
        best = counts[rooms[0]] if rooms else 0
        tied = [place for place in rooms if counts[place] == best]
        rooms = tied if query.count is None else rooms[: query.count]
    elsewhere = int(np.count_nonzero(places < 0))
    if elsewhere:
        finder.notes.append(f"{elsewhere} more {'is' if elsewhere == 1 else 'are'} in no room")
    shown = [finder.rooms.known.rooms[place] for place in rooms]
    return found.take(np.isin(places, rooms)), shown, [counts[place] for place in rooms]
