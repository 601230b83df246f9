"""Questions about rooms: which there are, and what is in them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from hypermap.core.hypermap import ROOMS
from hypermap.questions.grammar.parts import (
    counted,
    lacking_nouns,
    number_of,
    query_of_parts,
    rooms_of,
    types_of,
    which_of,
    whole_number,
)
from hypermap.questions.grammar.phrases import Phrases
from hypermap.questions.query import Condition, Give, Number, Query, Reference, Which

# Of rooms, these words say what is not there, and not what else the things are.
_LACKING = ("but no", "but not", "and no")
_ONE_AT_A_TIME = "this cannot be combined with what else is in a room; ask one at a time"


class RoomSentences(Phrases):
    """Turns questions about rooms into queries: a method for each rule."""

    # What is in them

    def rooms_having(self, parts: list[Any]) -> Query:
        return self._rooms_having(parts, "rooms")

    def is_room_having(self, parts: list[Any]) -> Query:
        return self._rooms_having(parts, "exists")

    def many_rooms_having(self, parts: list[Any]) -> Query:
        return self._rooms_having(parts, "count")

    def _rooms_having(self, parts: list[Any], give: Give) -> Query:
        """Return the query for rooms that have some things, each of them if so said, but no others.

        "Chairs but no tables" are a condition on the room, "seats other than sofas" on the seats.
        """
        query, rooms, lacked = query_of_parts(parts), rooms_of(parts), lacking_nouns(parts)
        if query.besides and self._but in _LACKING:
            self._check_nothing_after_but()
            query, lacked = replace(query, besides=()), (*lacked, query.besides)
        are_all = query.names in self._all_of
        within = (Condition("in", Reference(rooms=rooms)),) if rooms else ()
        if not lacked and not are_all:
            self._check_either()
            query = replace(query, where=(*query.where, *within))
            if give == "rooms":
                return replace(query, give=give)
            return replace(query, give=give, per="room", number=Number(1))
        if self._all_of & {*lacked} or (are_all and query.where):
            self._check_either()
        if query.besides or query.tags or query.which is not None:
            raise ValueError(_ONE_AT_A_TIME)
        wanted = [(name,) for name in query.names] if are_all else [query.names]
        having = [Condition("with", Reference(names, query.where)) for names in wanted if names]
        but = [Condition("with", Reference(names), negated=True) for names in lacked]
        return Query(give, layers=(ROOMS,), where=(*within, *having, *but))

    def _check_nothing_after_but(self) -> None:
        """Raise a ValueError if there is a place after "but no cups": of the cups, or of all?"""
        at = max(i for i, token in enumerate(self._tokens) if token.type == "BUT")
        if any(token.type not in ("THING", "AND", "OR") for token in self._tokens[at + 1 :]):
            raise ValueError(_ONE_AT_A_TIME)

    def how_big_having(self, parts: list[Any]) -> Query:
        query = self._rooms_having(parts, "rooms")
        if query.layers != (ROOMS,):  # it asks for the rooms of objects
            if query != Query("rooms", query.names, where=query.where):
                raise ValueError(_ONE_AT_A_TIME)
            having = Condition("with", Reference(query.names, query.where))
            query = Query(layers=(ROOMS,), where=(having,))
        return replace(query, give="size")

    # How much is in them

    def count_each(self, parts: list[Any]) -> Query:
        return self._per_room(parts, "count")

    def rooms_with_most(self, parts: list[Any]) -> Query:
        types = types_of(parts)
        which: Which = "most" if "MOST" in types else "fewest"
        count = whole_number(types["NUMBER"]) if "NUMBER" in types else None
        return replace(self._rooms_with(parts, "rooms"), which=which, count=count)

    def rooms_with(self, parts: list[Any]) -> Query:
        return replace(self._rooms_with(parts, "rooms"), number=number_of(parts))

    def is_room_with(self, parts: list[Any]) -> Query:
        return replace(self._rooms_with(parts, "count"), give="exists", number=number_of(parts))

    def many_rooms_with(self, parts: list[Any]) -> Query:
        return replace(self._rooms_with(parts, "count"), number=number_of(parts))

    def _rooms_with(self, parts: list[Any], give: Give) -> Query:
        """Return the query for rooms by how many objects are in them.

        "No chairs and no tables" are neither; with another number, each has its own.
        """
        self._check_either()
        query = self._per_room(parts, give)
        if not query.besides or self._but not in (*_LACKING, "but"):
            return query
        if "LACK" not in types_of(parts) or self._but == "but" or query_of_parts(parts).where:
            raise ValueError(_ONE_AT_A_TIME)
        names = (*query.names, *query.besides) if query.names else ()
        return replace(query, names=names, besides=())

    def _per_room(self, parts: list[Any], give: Give) -> Query:
        """Return the query that counts objects in each room, or in each of some rooms."""
        query, rooms = counted(parts), rooms_of(parts)
        if rooms:
            query = replace(query, where=(*query.where, Condition("in", Reference(rooms=rooms))))
        return replace(query, give=give, per="room")

    @property
    def _but(self) -> str:
        """The word before what is left out."""
        return types_of(self._tokens).get("BUT", "")

    # Which are next door

    def next_door(self, parts: list[Any]) -> Query:
        return self._next_door(parts, "rooms")

    def is_next_door(self, parts: list[Any]) -> Query:
        return self._next_door(parts, "exists")

    def many_next_door(self, parts: list[Any]) -> Query:
        return self._next_door(parts, "count")

    def _next_door(self, parts: list[Any], give: Give) -> Query:
        """Return the query for rooms, of a kind if so said, with a door to another one."""
        if "NEXT_TO" in types_of(parts):
            raise ValueError("next to? say 'connected to' for rooms with a door between them")
        *kinds, other = [part for part in parts if isinstance(part, Reference)]
        within = [Condition("in", kind) for kind in kinds]
        return Query(give, layers=(ROOMS,), where=(*within, Condition("next door to", other)))

    # The rooms themselves

    def where_room(self, parts: list[Any]) -> Query:
        return Query("rooms", rooms=rooms_of(parts))

    def rooms_but(self, parts: list[Any]) -> Query:
        named = Condition("in", Reference(rooms=rooms_of(parts)), negated=True)
        return Query("rooms", layers=(ROOMS,), where=(named,))

    def is_room(self, parts: list[Any]) -> Query:
        return Query("exists", rooms=rooms_of(parts))

    def many_rooms(self, parts: list[Any]) -> Query:
        return Query("count", rooms=rooms_of(parts) or ("room",))

    def best_room(self, parts: list[Any]) -> Query:
        return replace(self.where_room(parts), **which_of(types_of(parts)))

    def best_room_to(self, parts: list[Any]) -> Query:
        # The last reference is where distances are measured; one before it is the kind of rooms.
        *rooms, start = [part for part in parts if isinstance(part, Reference)]
        names = rooms[0].rooms if rooms else ()
        chosen = which_of(types_of(parts))
        if chosen["which"] not in ("nearest", "farthest"):
            raise ValueError(f"the {chosen['which']} to what? say the nearest or the farthest")
        return Query("rooms", rooms=names, start=start, **chosen)
