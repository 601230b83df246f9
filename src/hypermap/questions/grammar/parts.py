"""What a rule of the grammar finds among the parts of its text.

The parts are tokens, and the values of the rules within.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from lark import Token

from hypermap.questions.keywords import ORDINALS
from hypermap.questions.query import Condition, Measure, Number, Query, Reference, Relation, Which
from hypermap.questions.taxonomy import EVERYTHING

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
    "tallest": "tallest",
    "surest": "surest",
    "most certain": "surest",
    "newest": "newest",
    "most recent": "newest",
}


def types_of(parts: list[Any]) -> dict[str, str]:
    """Return the tokens among some parts, by their types."""
    return {part.type: str(part) for part in parts if isinstance(part, Token)}


def which_of(types: dict[str, str]) -> dict[str, Any]:
    """Return what words as "nearest" or "second nearest" mean, as attributes of a query."""
    if "THE_MOST" not in types:
        return {}
    first, _, rest = types["THE_MOST"].partition(" ")
    if first in ORDINALS:
        return {"which": _WHICH[rest], "rank": ORDINALS[first]}
    return {"which": _WHICH[types["THE_MOST"]]}


def only(parts: list[Any], kind: type[Any]) -> Any:
    """Return the first part of a kind, which is no token."""
    return next(part for part in parts if isinstance(part, kind) and not isinstance(part, Token))


def tags_of(parts: list[Any]) -> tuple[str, ...]:
    """Return the tags among some parts."""
    return tuple(str(part) for part in parts if isinstance(part, Token) and part.type == "TAG")


def is_place(part: Any) -> bool:
    """Return whether a part of "between" is one of its two places."""
    return not isinstance(part, Token) or part.type in ("ME", "PLACE_HERE")


def place_of(part: Any) -> Reference:
    """Return the place that a part of "between" refers to."""
    if isinstance(part, Token):
        return Reference(is_asker=True)
    return part if isinstance(part, Reference) else Reference(names=(part,))


def counted(parts: list[Any]) -> Query:
    """Return the query about the objects that are counted, with the conditions after them."""
    query = query_of_parts(parts)
    if query.which is not None or query.by != "air":
        raise ValueError(f"how many, or the {query.which}? ask for one of both")
    return query


def lacking_nouns(parts: list[Any]) -> tuple[tuple[str, ...], ...]:
    """Return the nouns after "without"."""
    return (only(parts[::-1], tuple),) if "LACK" in types_of(parts) else ()


def number_of(parts: list[Any]) -> Number:
    """Return the number among some parts; at least one if there is none, none after "without"."""
    if "LACK" in types_of(parts):
        return Number(0, 0)
    return next((part for part in parts if isinstance(part, Number)), Number(1))


def whole_number(text: str) -> int:
    """Return the whole number that a token stands for; raise a ValueError if it is none."""
    if not text.isdigit():
        raise ValueError(f"{text} objects cannot be counted")
    return int(text)


def conditions_of(parts: list[Any]) -> tuple[Condition, ...]:
    """Return the conditions among some parts."""
    return tuple(one for part in parts if isinstance(part, list) for one in part)


def rooms_of(parts: list[Any]) -> tuple[str, ...]:
    """Return the rooms that are named among some parts."""
    return next((part.rooms for part in parts if isinstance(part, Reference)), ())


def left_out(parts: list[Any]) -> tuple[str, ...]:
    """Return the nouns after "except"."""
    at = next((i for i, part in enumerate(parts) if types_of([part]) == {"BUT": str(part)}), None)
    names: tuple[str, ...] = () if at is None else only(parts[at:], tuple)
    return names


def query_of_parts(parts: list[Any]) -> Query:
    """Return the query about the objects among some parts, with the conditions after them."""
    query = next((part for part in parts if isinstance(part, Query)), Query())
    return replace(query, where=(*query.where, *conditions_of(parts)))


def query_in_room(parts: list[Any]) -> Query:
    """Return the query about the objects in the room among some parts."""
    query = query_of_parts(parts)
    return replace(query, where=(*query.where, Condition("in", only(parts, Reference))))


def chosen_objects(parts: list[Any]) -> Query:
    """Return the query about objects of which some are chosen."""
    types = types_of(parts)
    count = None
    if "NUMBER" in types:
        count = int(types["NUMBER"]) if types["NUMBER"].isdigit() else 0
        if count < 1:
            raise ValueError(f"{types['NUMBER']} objects cannot be listed")
    by: Measure = "path" if "BY_PATH" in types else "air"
    nouns = next((part for part in parts if isinstance(part, tuple)), ())
    names = tuple(name for name in nouns if name != EVERYTHING)
    return Query(names=names, count=count, by=by, **which_of(types))


def side_of(text: str) -> Relation:
    """Return the relation that words such as "to the left of" mean."""
    words = text.split()
    if "left" in words:
        return "left of"
    if "right" in words:
        return "right of"
    return "in front of" if {"front", "ahead"} & set(words) else "behind"
