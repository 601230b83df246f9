"""The phrases of questions: objects, numbers, conditions and places."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from lark import Token, Transformer

from hypermap.questions.grammar.parts import (
    chosen_objects,
    conditions_of,
    is_place,
    left_out,
    only,
    place_of,
    side_of,
    tags_of,
    types_of,
    whole_number,
)
from hypermap.questions.keywords import meters_of
from hypermap.questions.query import Condition, Number, Query, Reference, Relation
from hypermap.questions.times import Span

# How many a comparison with a number asks for: at least so many more, or at most.
_LEAST = {"more than": 1, "over": 1} | dict.fromkeys(
    ("at least", "no fewer than", "not fewer than", "no less than", "not less than"), 0
)
_MOST = {"less than": -1, "fewer than": -1} | dict.fromkeys(
    ("at most", "up to", "no more than", "not more than"), 0
)

_RELATIONS: dict[str, Relation] = {
    "IN": "in",
    "IN_ROOM_OF": "in the room of",
    "ON": "on",
    "UNDER": "under",
    "NEXT_TO": "near",
    "VISIBLE": "visible from",
}
# A thing may be near both of two others, or in front of both; it is on one of them only.
_AND_IS_UNCLEAR = {"WITHIN", "NEXT_TO", "SIDE", "VISIBLE", "IN_ROOM_OF"}


class Phrases(Transformer[Token, Query]):
    """Turns phrases into objects, numbers, conditions and places: a method for each rule."""

    def __init__(self, times: list[Span], tokens: list[Token]) -> None:
        super().__init__()
        self._times = times
        self._tokens = tokens
        self._are_joined = False  # objects by "and"
        self._all_of: set[tuple[str, ...]] = set()  # objects that are joined by "and" alone

    # Objects

    def plain(self, parts: list[Any]) -> Query:
        query = replace(chosen_objects(parts), where=conditions_of(parts))
        return replace(query, besides=left_out(parts), tags=tags_of(parts))

    def nearest_to(self, parts: list[Any]) -> Query:
        return replace(chosen_objects(parts), start=only(parts, Reference))

    def nouns(self, parts: list[Any]) -> tuple[str, ...]:
        names = tuple(dict.fromkeys(part for part in parts if not isinstance(part, Token)))
        types = types_of(parts)
        if "AND" in types:
            self._are_joined = True
            if types.get("OR", ",") == ",":
                self._all_of.add(names)
        return names

    def noun(self, parts: list[Any]) -> str:
        return str(parts[0])

    def number(self, parts: list[Token]) -> Number:
        types = types_of(parts)
        if "SEVERAL" in types:
            return Number(2)
        count = whole_number(types["NUMBER"])
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

    def _check_either(self) -> None:
        """Raise a ValueError if both of two objects, or all places, are asked for, not any."""
        if any(" all" in token for token in self._tokens if token.type in ("IN", "ON")):
            raise ValueError('"all" may mean each of them; ask for one of them')
        if self._are_joined:
            raise ValueError('"and" may mean both or either here; ask for one, or say "or"')

    # Conditions

    def conditions(self, parts: list[Any]) -> list[Condition]:
        return [
            one
            for part in parts
            for one in (part if isinstance(part, list) else [part])
            if isinstance(one, Condition)
        ]

    def at_room(self, parts: list[Any]) -> Condition:
        types = types_of(parts)
        is_negated = "NOT" in types
        if {"ME", "HERE", "PLACE_HERE"} & set(types):
            parts = [*parts, Reference(is_asker=True)]
        reference = only(parts, Reference)
        if "BEYOND" in types:
            return Condition("beyond", reference, only(parts, float), is_negated)
        if "WITHIN" in types:
            return Condition("near", reference, only(parts, float), is_negated)
        if "VISIBLE" in types:
            return Condition("visible from", reference, negated=is_negated)
        if "NEXT_TO" in types or "HERE" in types:
            return Condition("near", reference, negated=is_negated)
        return Condition("in" if reference.rooms else "at", reference, negated=is_negated)

    def at_thing(self, parts: list[Any]) -> Condition:
        types, reference = types_of(parts), only(parts, Reference)
        is_negated = "NOT" in types
        if _AND_IS_UNCLEAR & set(types) and reference.names in self._all_of:
            self._check_either()
        if "BEYOND" in types:
            return Condition("beyond", reference, only(parts, float), is_negated)
        if "WITHIN" in types:
            return Condition("near", reference, only(parts, float), is_negated)
        if "SIDE" in types:
            return Condition(side_of(types["SIDE"]), reference, negated=is_negated)
        relation = next(_RELATIONS[name] for name in types if name in _RELATIONS)
        return Condition(relation, reference, negated=is_negated)

    def carrying(self, parts: list[Any]) -> Condition:
        reference = only(parts, Reference)
        if reference.names in self._all_of:
            self._check_either()
        return Condition("carrying", reference, negated="LACK" in types_of(parts))

    def at_side(self, parts: list[Any]) -> Condition:
        types = types_of(parts)
        side = side_of(types.get("MY_SIDE", types.get("SIDE", "")))
        return Condition(side, Reference(is_asker=True), negated="NOT" in types)

    def in_here(self, parts: list[Any]) -> Condition:
        types = types_of(parts)
        first = self._tokens[0].type
        is_clear = first in ("WHAT", "WHICH", "HOW_MANY", "THE_MOST")
        if "PLACE_HERE" in types and not (is_clear and not types_of(self._tokens).get("TIME")):
            raise ValueError("here? say 'in this room', 'near me' or 'within 3 m of me'")
        return Condition("in", Reference(is_asker=True), negated="NOT" in types)

    def between(self, parts: list[Any]) -> Condition:
        one, other = (place_of(part) for part in parts if is_place(part))
        return Condition("between", one, negated="NOT" in types_of(parts), other=other)

    # Places

    def nouns_there(self, parts: list[Any]) -> Reference:
        return Reference(
            names=only(parts, tuple),
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
