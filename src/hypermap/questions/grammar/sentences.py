"""Questions about objects, distances and times."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from hypermap.core.hypermap import ROOMS
from hypermap.questions.grammar.parts import (
    conditions_of,
    counted,
    left_out,
    number_of,
    only,
    query_in_room,
    query_of_parts,
    rooms_of,
    tags_of,
    types_of,
    which_of,
)
from hypermap.questions.grammar.rooms import RoomSentences
from hypermap.questions.query import Condition, Query, Reference, When


class Sentences(RoomSentences):
    """Turns a question into its query: a method for each rule of `english.lark`."""

    def start(self, parts: list[Query]) -> Query:
        return parts[0]

    # What is asked

    def show(self, parts: list[Any]) -> Query:
        return query_of_parts(parts)

    def show_all(self, parts: list[Any]) -> Query:
        query = Query(where=conditions_of(parts), besides=left_out(parts))
        return replace(query, tags=tags_of(parts))

    def show_but(self, parts: list[Any]) -> Query:
        return replace(query_of_parts(parts), besides=only(parts, tuple))

    def show_all_but(self, parts: list[Any]) -> Query:
        return Query(where=conditions_of(parts), besides=only(parts, tuple))

    def who(self, parts: list[Any]) -> Query:
        return Query(names=("person",), where=conditions_of(parts))

    def who_when(self, parts: list[Any]) -> Query:
        return replace(self.who(parts), when=(self._when(parts),))

    def where_am_i(self, parts: list[Any]) -> Query:  # noqa: ARG002
        return Query(layers=(ROOMS,), where=(Condition("at", Reference(is_asker=True)),))

    def seen_from(self, parts: list[Any]) -> Query:
        return Query(where=(Condition("visible from", only(parts, Reference)),))

    def some_of_how_many(self, parts: list[Any]) -> Query:
        number = types_of(parts)["NUMBER"]
        raise ValueError(f"{number} of how many? say which, as 'the {number} nearest'")

    def many_tagged(self, parts: list[Any]) -> Query:
        return replace(self.plain(parts), give="count")

    def surest(self, parts: list[Any]) -> Query:
        return Query(names=only(parts, tuple), which="surest")

    def how_many(self, parts: list[Any]) -> Query:
        return replace(query_of_parts(parts), give="count")

    def how_many_in(self, parts: list[Any]) -> Query:
        return replace(query_in_room(parts), give="count")

    def is_there(self, parts: list[Any]) -> Query:
        self._check_either()
        return replace(query_of_parts(parts), give="exists")

    def has_it(self, parts: list[Any]) -> Query:
        self._check_either()
        return replace(query_in_room(parts), give="exists")

    def is_number(self, parts: list[Any]) -> Query:
        self._check_either()
        return replace(counted(parts), give="exists", number=number_of(parts))

    def has_number(self, parts: list[Any]) -> Query:
        self._check_either()
        counted(parts)
        return replace(query_in_room(parts), give="exists", number=number_of(parts))

    def room_of(self, parts: list[Any]) -> Query:
        return replace(query_of_parts(parts), give="room")

    def show_counts(self, parts: list[Query]) -> Query:
        return parts[0]

    def show_rooms(self, parts: list[Query]) -> Query:
        return parts[0]

    # Distances

    def how_far(self, parts: list[Any]) -> Query:
        return replace(query_of_parts(parts), give="distance")

    def how_far_from(self, parts: list[Any]) -> Query:
        return replace(query_of_parts(parts), give="distance", start=only(parts, Reference))

    def how_far_by(self, parts: list[Any]) -> Query:
        query: Query = parts[0]
        return replace(query, by="path") if "BY_PATH" in types_of(parts) else query

    def how_far_room(self, parts: list[Any]) -> Query:
        *start, room = [part for part in parts if isinstance(part, Reference)]
        if start and not room.rooms:
            (room,), start = start, [room]
        return Query("distance", rooms=room.rooms, start=start[0] if start else None)

    # Sizes

    def how_big(self, parts: list[Any]) -> Query:
        return replace(query_of_parts(parts), give="size")

    def how_big_room(self, parts: list[Any]) -> Query:
        rooms = rooms_of(parts) or ("room",)
        return Query("size", rooms=rooms, **which_of(types_of(parts)))

    def how_big_here(self, parts: list[Any]) -> Query:
        return replace(self.where_am_i(parts), give="size")

    # Times

    def last_seen(self, parts: list[Any]) -> Query:
        return replace(query_of_parts(parts), give="last_seen")

    def seen(self, parts: list[Any]) -> Query:
        return replace(query_of_parts(parts), when=(self._when(parts),))

    def seen_count(self, parts: list[Any]) -> Query:
        return replace(self.seen(parts), give="count")

    def seen_any(self, parts: list[Any]) -> Query:
        return replace(self.seen(parts), give="exists")

    def _when(self, parts: list[Any]) -> When:
        types = types_of(parts)
        span = self._times[int(types["TIME"])]
        if "UNSEEN" not in types:
            return When("new" if "NEW" in types else "seen", span.since, span.until)
        if span.since is None or span.until is not None:
            raise ValueError(f"not seen {span.text}: say since when")
        return When("not seen", span.since)
