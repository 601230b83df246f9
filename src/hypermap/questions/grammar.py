"""The grammar of questions in English: from tokens to a `Query`.

`english.lark` says which sentences there are, and names their parts; here each part becomes what it
means in a query.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from lark import Lark, Token, Transformer
from lark.exceptions import UnexpectedInput, VisitError
from lark.lexer import Lexer

from hypermap.core.hypermap import ROOMS
from hypermap.questions.query import (
    Condition,
    Give,
    Measure,
    Number,
    Query,
    Reference,
    Relation,
    When,
    Which,
)
from hypermap.questions.taxonomy import EVERYTHING
from hypermap.questions.times import Span
from hypermap.questions.words import meters_of

_GRAMMAR = Path(__file__).with_name("english.lark")
_WHICH: dict[str, Which] = {
    "nearest": "nearest",
    "closest": "nearest",
    "next": "nearest",
    "farthest": "farthest",
    "furthest": "farthest",
    "largest": "largest",
    "biggest": "largest",
    "smallest": "smallest",
    "tiniest": "smallest",
    "surest": "surest",
    "most certain": "surest",
    "newest": "newest",
    "most recent": "newest",
}
# How many a comparison with a number asks for: at least so many more, or at most.
_LEAST = {"more than": 1, "over": 1} | dict.fromkeys(
    ("at least", "no fewer than", "not fewer than", "no less than", "not less than"), 0
)
_MOST = {"less than": -1, "fewer than": -1} | dict.fromkeys(
    ("at most", "up to", "no more than", "not more than"), 0
)

# Of rooms, these words say what is not there, and not what else the things are.
_LACKING = ("but no", "but not", "and no")
_ONE_AT_A_TIME = "this cannot be combined with what else is in a room; ask one at a time"
_RELATIONS: dict[str, Relation] = {
    "IN": "in",
    "ON": "on",
    "UNDER": "under",
    "NEXT_TO": "near",
    "VISIBLE": "visible from",
}
# A thing may be near both of two others, or in front of both; it is on one of them only.
_AND_IS_UNCLEAR = {"WITHIN", "NEXT_TO", "SIDE", "VISIBLE"}


def query_of(tokens: list[Token], times: list[Span]) -> Query:
    """Return the query that a sentence asks.

    Args:
        tokens: its words.
        times: what its time marks stand for.

    Raises:
        ValueError: If the sentence cannot be read, or has two meanings; its text says so.
    """
    try:
        query: Query = _Parts(times, tokens).transform(_parser().parse(tokens))
    except UnexpectedInput as error:
        last = getattr(error, "token", None)
        where = f" from {str(last)!r} on" if last else ""
        raise ValueError(f"cannot read this question{where}") from None
    except VisitError as error:
        raise ValueError(str(error.orig_exc)) from None
    return query


class _Tokens(Lexer):
    """Hands on tokens that have been made already."""

    def __init__(self, _configuration: Any) -> None:
        pass

    def lex(self, lexer_state: Any, parser_state: Any = None) -> Iterator[Token]:  # noqa: ARG002
        """Yield them."""
        yield from lexer_state


@cache
def _parser() -> Lark:
    return Lark(_GRAMMAR.read_text(encoding="utf-8"), parser="earley", lexer=_Tokens)


class _Parts(Transformer[Token, Query]):
    """Makes the query out of the parts that the grammar has found."""

    def __init__(self, times: list[Span], tokens: list[Token]) -> None:
        super().__init__()
        self._times = times
        self._tokens = tokens
        self._are_joined = False  # objects by "and"
        self._all_of: set[tuple[str, ...]] = set()  # objects that are joined by "and" alone

    # What is asked

    def start(self, parts: list[Query]) -> Query:
        return parts[0]

    def show(self, parts: list[Any]) -> Query:
        return _query(parts)

    def show_all(self, parts: list[Any]) -> Query:
        query = Query(where=_conditions(parts), besides=_besides(parts))
        return replace(query, tags=_tags(parts))

    def show_but(self, parts: list[Any]) -> Query:
        return replace(_query(parts), besides=_only(parts, tuple))

    def show_all_but(self, parts: list[Any]) -> Query:
        return Query(where=_conditions(parts), besides=_only(parts, tuple))

    def who(self, parts: list[Any]) -> Query:
        return Query(names=("person",), where=_conditions(parts))

    def who_when(self, parts: list[Any]) -> Query:
        return replace(self.who(parts), when=(self._when(parts),))

    def where_am_i(self, parts: list[Any]) -> Query:  # noqa: ARG002
        return Query(layers=(ROOMS,), where=(Condition("at", Reference(is_asker=True)),))

    def seen_from(self, parts: list[Any]) -> Query:
        return Query(where=(Condition("visible from", _only(parts, Reference)),))

    def some_of_how_many(self, parts: list[Any]) -> Query:
        number = _types(parts)["NUMBER"]
        raise ValueError(f"{number} of how many? say which, as 'the {number} nearest'")

    def many_tagged(self, parts: list[Any]) -> Query:
        return replace(self.plain(parts), give="count")

    def surest(self, parts: list[Any]) -> Query:
        return Query(names=_only(parts, tuple), which="surest")

    def how_many(self, parts: list[Any]) -> Query:
        return replace(_query(parts), give="count")

    def how_many_in(self, parts: list[Any]) -> Query:
        return replace(_in_room(parts), give="count")

    def is_there(self, parts: list[Any]) -> Query:
        self._check_either()
        return replace(_query(parts), give="exists")

    def has_it(self, parts: list[Any]) -> Query:
        self._check_either()
        return replace(_in_room(parts), give="exists")

    def room_of(self, parts: list[Any]) -> Query:
        return replace(_query(parts), give="room")

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
        query, rooms, lacked = _query(parts), _rooms(parts), _lacked(parts)
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

    @property
    def _but(self) -> str:
        """The word before what is left out."""
        return _types(self._tokens).get("BUT", "")

    def _check_nothing_after_but(self) -> None:
        """Raise a ValueError if there is a place after "but no cups": of the cups, or of all?"""
        at = max(i for i, token in enumerate(self._tokens) if token.type == "BUT")
        if any(token.type not in ("THING", "AND", "OR") for token in self._tokens[at + 1 :]):
            raise ValueError(_ONE_AT_A_TIME)

    def _check_either(self) -> None:
        """Raise a ValueError if both of two objects, or all places, are asked for, not any."""
        if any(" all" in token for token in self._tokens if token.type in ("IN", "ON")):
            raise ValueError('"all" may mean each of them; ask for one of them')
        if self._are_joined:
            raise ValueError('"and" may mean both or either here; ask for one, or say "or"')

    def how_far(self, parts: list[Any]) -> Query:
        return replace(_query(parts), give="distance")

    def how_far_from(self, parts: list[Any]) -> Query:
        return replace(_query(parts), give="distance", start=_only(parts, Reference))

    def how_far_by(self, parts: list[Any]) -> Query:
        query: Query = parts[0]
        return replace(query, by="path") if "BY_PATH" in _types(parts) else query

    def how_far_room(self, parts: list[Any]) -> Query:
        *start, room = [part for part in parts if isinstance(part, Reference)]
        if start and not room.rooms:
            (room,), start = start, [room]
        return Query("distance", rooms=room.rooms, start=start[0] if start else None)

    # Times

    def last_seen(self, parts: list[Any]) -> Query:
        return replace(_query(parts), give="last_seen")

    def seen(self, parts: list[Any]) -> Query:
        return replace(_query(parts), when=(self._when(parts),))

    def seen_count(self, parts: list[Any]) -> Query:
        return replace(self.seen(parts), give="count")

    def seen_any(self, parts: list[Any]) -> Query:
        return replace(self.seen(parts), give="exists")

    def _when(self, parts: list[Any]) -> When:
        types = _types(parts)
        span = self._times[int(types["TIME"])]
        if "UNSEEN" not in types:
            return When("new" if "NEW" in types else "seen", span.since, span.until)
        if span.since is None or span.until is not None:
            raise ValueError(f"not seen {span.text}: say since when")
        return When("not seen", span.since)

    # How many

    def show_counts(self, parts: list[Query]) -> Query:
        return parts[0]

    def count_each(self, parts: list[Any]) -> Query:
        return self._per_room(parts, "count")

    def rooms_with_most(self, parts: list[Any]) -> Query:
        types = _types(parts)
        which: Which = "most" if "MOST" in types else "fewest"
        count = _whole(types["NUMBER"]) if "NUMBER" in types else None
        return replace(self._rooms_with(parts, "rooms"), which=which, count=count)

    def rooms_with(self, parts: list[Any]) -> Query:
        return replace(self._rooms_with(parts, "rooms"), number=_number(parts))

    def is_room_with(self, parts: list[Any]) -> Query:
        return replace(self._rooms_with(parts, "count"), give="exists", number=_number(parts))

    def many_rooms_with(self, parts: list[Any]) -> Query:
        return replace(self._rooms_with(parts, "count"), number=_number(parts))

    def is_number(self, parts: list[Any]) -> Query:
        self._check_either()
        return replace(_counted(parts), give="exists", number=_number(parts))

    def has_number(self, parts: list[Any]) -> Query:
        self._check_either()
        _counted(parts)
        return replace(_in_room(parts), give="exists", number=_number(parts))

    def number(self, parts: list[Token]) -> Number:
        types = _types(parts)
        if "SEVERAL" in types:
            return Number(2)
        count = _whole(types["NUMBER"])
        if "EXACTLY" in types or count == 0:
            return Number(count, count)
        if "BEYOND" in types and types["BEYOND"] in _LEAST:
            return Number(count + _LEAST[types["BEYOND"]])
        if "WITHIN" in types and types["WITHIN"] in _MOST:
            return Number(0, count + _MOST[types["WITHIN"]])
        if "OR_FEWER" in types:
            return Number(0, count)
        if {"BEYOND", "WITHIN"} & set(types):
            raise ValueError(f"{types.get('BEYOND', types.get('WITHIN'))} {count} of them?")
        if count == 1 and "OR_MORE" not in types:
            raise ValueError("one or more? say 'exactly one' or 'at least one'")
        return Number(count)

    def _rooms_with(self, parts: list[Any], give: Give) -> Query:
        """Return the query for rooms by how many objects are in them.

        "No chairs and no tables" are neither; with another number, each has its own.
        """
        self._check_either()
        query = self._per_room(parts, give)
        if not query.besides or self._but not in (*_LACKING, "but"):
            return query
        if "LACK" not in _types(parts) or self._but == "but" or _query(parts).where:
            raise ValueError(_ONE_AT_A_TIME)
        names = (*query.names, *query.besides) if query.names else ()
        return replace(query, names=names, besides=())

    def _per_room(self, parts: list[Any], give: Give) -> Query:
        """Return the query that counts objects in each room, or in each of some rooms."""
        query, rooms = _counted(parts), _rooms(parts)
        if rooms:
            query = replace(query, where=(*query.where, Condition("in", Reference(rooms=rooms))))
        return replace(query, give=give, per="room")

    # Rooms

    def show_rooms(self, parts: list[Query]) -> Query:
        return parts[0]

    def where_room(self, parts: list[Any]) -> Query:
        return Query("rooms", rooms=_rooms(parts))

    def is_room(self, parts: list[Any]) -> Query:
        return Query("exists", rooms=_rooms(parts))

    def many_rooms(self, parts: list[Any]) -> Query:
        return Query("count", rooms=_rooms(parts) or ("room",))

    def best_room(self, parts: list[Any]) -> Query:
        return replace(self.where_room(parts), which=_WHICH[_types(parts)["THE_MOST"]])

    def best_room_to(self, parts: list[Any]) -> Query:
        # The last reference is where distances are measured; one before it is the kind of rooms.
        *rooms, start = [part for part in parts if isinstance(part, Reference)]
        names = rooms[0].rooms if rooms else ()
        which = _WHICH[_types(parts)["THE_MOST"]]
        if which not in ("nearest", "farthest"):
            raise ValueError(f"the {which} to what? say the nearest or the farthest")
        return Query("rooms", rooms=names, which=which, start=start)

    # Objects

    def plain(self, parts: list[Any]) -> Query:
        query = replace(_chosen(parts), where=_conditions(parts))
        return replace(query, besides=_besides(parts), tags=_tags(parts))

    def nearest_to(self, parts: list[Any]) -> Query:
        return replace(_chosen(parts), start=_only(parts, Reference))

    def nouns(self, parts: list[Any]) -> tuple[str, ...]:
        names = tuple(dict.fromkeys(part for part in parts if not isinstance(part, Token)))
        types = _types(parts)
        if "AND" in types:
            self._are_joined = True
            if types.get("OR", ",") == ",":
                self._all_of.add(names)
        return names

    def noun(self, parts: list[Any]) -> str:
        return str(parts[0])

    # Conditions

    def conditions(self, parts: list[Any]) -> list[Condition]:
        return [
            one
            for part in parts
            for one in (part if isinstance(part, list) else [part])
            if isinstance(one, Condition)
        ]

    def at_room(self, parts: list[Any]) -> Condition:
        types = _types(parts)
        is_negated = "NOT" in types
        if {"ME", "HERE", "PLACE_HERE"} & set(types):
            parts = [*parts, Reference(is_asker=True)]
        reference = _only(parts, Reference)
        if "BEYOND" in types:
            return Condition("beyond", reference, _only(parts, float), is_negated)
        if "WITHIN" in types:
            return Condition("near", reference, _only(parts, float), is_negated)
        if "VISIBLE" in types:
            return Condition("visible from", reference, negated=is_negated)
        if "NEXT_TO" in types or "HERE" in types:
            return Condition("near", reference, negated=is_negated)
        return Condition("in" if reference.rooms else "at", reference, negated=is_negated)

    def at_thing(self, parts: list[Any]) -> Condition:
        types, reference = _types(parts), _only(parts, Reference)
        is_negated = "NOT" in types
        if _AND_IS_UNCLEAR & set(types) and reference.names in self._all_of:
            self._check_either()
        if "BEYOND" in types:
            return Condition("beyond", reference, _only(parts, float), is_negated)
        if "WITHIN" in types:
            return Condition("near", reference, _only(parts, float), is_negated)
        if "SIDE" in types:
            return Condition(_side(types["SIDE"]), reference, negated=is_negated)
        relation = next(_RELATIONS[name] for name in types if name in _RELATIONS)
        return Condition(relation, reference, negated=is_negated)

    def in_here(self, parts: list[Any]) -> Condition:
        types = _types(parts)
        first = self._tokens[0].type
        is_clear = first in ("WHAT", "WHICH", "HOW_MANY", "THE_MOST")
        if "PLACE_HERE" in types and not (is_clear and not _types(self._tokens).get("TIME")):
            raise ValueError("here? say 'in this room', 'near me' or 'within 3 m of me'")
        return Condition("in", Reference(is_asker=True), negated="NOT" in types)

    def between(self, parts: list[Any]) -> Condition:
        one, other = (_place(part) for part in parts if _is_place(part))
        return Condition("between", one, negated="NOT" in _types(parts), other=other)

    def nouns_there(self, parts: list[Any]) -> Reference:
        return Reference(
            names=_only(parts, tuple),
            where=tuple(part for part in parts if isinstance(part, Condition)),
        )

    def reference(self, parts: list[Any]) -> Reference:
        (part,) = parts
        return Reference(is_asker=True) if isinstance(part, Token) else part

    def room(self, parts: list[Any]) -> Reference:
        return Reference(rooms=tuple(str(p) for p in parts if p.type == "ROOM_NAME"))

    def point(self, parts: list[Any]) -> Reference:
        x, y = (float(number) for number in str(parts[0]).split(","))
        return Reference(point_xy=(x, y))

    def length(self, parts: list[Any]) -> float:
        return meters_of(*map(str, parts))


def _types(parts: list[Any]) -> dict[str, str]:
    return {part.type: str(part) for part in parts if isinstance(part, Token)}


def _only(parts: list[Any], kind: type[Any]) -> Any:
    return next(part for part in parts if isinstance(part, kind) and not isinstance(part, Token))


def _tags(parts: list[Any]) -> tuple[str, ...]:
    return tuple(str(part) for part in parts if isinstance(part, Token) and part.type == "TAG")


def _is_place(part: Any) -> bool:
    """Return whether a part of "between" is one of its two places."""
    return not isinstance(part, Token) or part.type in ("ME", "PLACE_HERE")


def _place(part: Any) -> Reference:
    if isinstance(part, Token):
        return Reference(is_asker=True)
    return part if isinstance(part, Reference) else Reference(names=(part,))


def _counted(parts: list[Any]) -> Query:
    """Return the query about the objects that are counted, with the conditions after them."""
    query = _query(parts)
    if query.which is not None or query.by != "air":
        raise ValueError(f"how many, or the {query.which}? ask for one of both")
    return query


def _lacked(parts: list[Any]) -> tuple[tuple[str, ...], ...]:
    """Return the nouns after "without"."""
    return (_only(parts[::-1], tuple),) if "LACK" in _types(parts) else ()


def _number(parts: list[Any]) -> Number:
    """Return the number among some parts; at least one if there is none, none after "without"."""
    if "LACK" in _types(parts):
        return Number(0, 0)
    return next((part for part in parts if isinstance(part, Number)), Number(1))


def _whole(text: str) -> int:
    if not text.isdigit():
        raise ValueError(f"{text} objects cannot be counted")
    return int(text)


def _conditions(parts: list[Any]) -> tuple[Condition, ...]:
    return tuple(one for part in parts if isinstance(part, list) for one in part)


def _rooms(parts: list[Any]) -> tuple[str, ...]:
    """Return the rooms that are named among some parts."""
    return next((part.rooms for part in parts if isinstance(part, Reference)), ())


def _besides(parts: list[Any]) -> tuple[str, ...]:
    """Return the nouns after "except"."""
    at = next((i for i, part in enumerate(parts) if _types([part]) == {"BUT": str(part)}), None)
    names: tuple[str, ...] = () if at is None else _only(parts[at:], tuple)
    return names


def _query(parts: list[Any]) -> Query:
    """Return the query about the objects among some parts, with the conditions after them."""
    query = next((part for part in parts if isinstance(part, Query)), Query())
    return replace(query, where=(*query.where, *_conditions(parts)))


def _in_room(parts: list[Any]) -> Query:
    """Return the query about the objects in the room among some parts."""
    query = _query(parts)
    return replace(query, where=(*query.where, Condition("in", _only(parts, Reference))))


def _chosen(parts: list[Any]) -> Query:
    """Return the query about objects of which some are chosen."""
    types = _types(parts)
    which = _WHICH[types["THE_MOST"]] if "THE_MOST" in types else None
    count = None
    if "NUMBER" in types:
        count = int(types["NUMBER"]) if types["NUMBER"].isdigit() else 0
        if count < 1:
            raise ValueError(f"{types['NUMBER']} objects cannot be listed")
    by: Measure = "path" if "BY_PATH" in types else "air"
    nouns = next((part for part in parts if isinstance(part, tuple)), ())
    names = tuple(name for name in nouns if name != EVERYTHING)
    return Query(names=names, which=which, count=count, by=by)


def _side(text: str) -> Relation:
    """Return the relation that words such as "to the left of" mean."""
    words = text.split()
    if "left" in words:
        return "left of"
    if "right" in words:
        return "right of"
    return "in front of" if "front" in words else "behind"
