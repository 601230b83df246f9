"""Questions about measured values in English: where it is warm, the coldest room, how warm it is.

The words about the quantity are found first. What is left, as "which offices" or "in the kitchen",
is read by the grammar for objects and places.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import ROOMS, Hypermap
from hypermap.core.value_layer import ValueLayer
from hypermap.questions.query import Condition, Measured, Query, Reference, Which
from hypermap.questions.vocabulary import Vocabulary
from hypermap.values import converted

_QUANTITIES = {
    "temperature": ("temperature", "warmth", "heat"),
    "light": ("illuminance", "light", "brightness"),
    "humidity": ("humidity", "relative humidity"),
    "sound": ("sound", "noise", "sound level"),
}
_UNITS_OF = {"temperature": ("°C", "°F", "K"), "light": ("lx", "lux"), "sound": ("dBA", "dB(A)")}
# What is said of a quantity: of more of it, then of less, as pairs of grades.
_GRADES = {
    "temperature": ("warm|hot", "cold|cool|chilly"),
    "light": ("bright|light", "dark|dim"),
    "humidity": ("humid|damp|moist", "dry"),
    "sound": ("loud|noisy", "quiet|silent"),
}
_COMPARED = {"hot": "hott", "dim": "dimm", "chilly": "chilli", "dry": "dri", "noisy": "noisi"}
_ABOVE = "above|over|more than|higher than|greater than|stronger than|better than|at least"
_BELOW = "below|under|less than|lower than|weaker than|worse than|at most"
_HIGHEST, _LOWEST = "highest|strongest|best|most|largest", "lowest|weakest|worst|least|smallest"
_LIMIT = (
    r"(?P<limit>[-−]?\s?\d+(?:\.\d+)?)\s*(?:degrees?\s*)?(?P<unit>(?:°\s?)?[a-z%µ(][\w%µ/()²³]*)?"
)
_SPELLED = {"c": "°C", "f": "°F", "degc": "°C", "degf": "°F", "lux": "lx", "db": "dB", "°": ""}
_PLACE_WORDS = ("in", "at", "on", "near", "around", "inside", "next", "within", "under", "here")


def value_query(text: str, hypermap: Hypermap, vocabulary: Vocabulary) -> Query | None:
    """Return the query that a question about measured values asks; None for other questions.

    Args:
        text: the question.
        hypermap: which has layers of measured values, or none.
        vocabulary: what nouns mean.

    Raises:
        HypermapError: If the map has no layer, or several, of what is asked, or the limit is in a
            unit that cannot be converted to the layer's.
        NotUnderstood: If the rest of the question cannot be read.
    """
    asked = re.sub(r"[?!.\s]+$", "", " ".join(text.split())).replace("−", "-")
    for read in (_within_limit, _extreme, _how_much):
        query = read(asked, hypermap, vocabulary)
        if query is not None:
            return query
    return None


def _within_limit(text: str, hypermap: Hypermap, vocabulary: Vocabulary) -> Query | None:
    """Read "where is it warmer than 25 degrees" and "desks where the wifi is below -75 dBm"."""
    for pattern, kind, is_more in _comparisons(hypermap):
        found = re.search(rf"\b{pattern}\s+{_LIMIT}(?=\s|$)", text, re.IGNORECASE)
        if found is None:
            continue
        rest, unit = text[found.end() :], found["unit"] or ""
        if unit.lower() in _PLACE_WORDS:
            rest, unit = f"{unit} {rest}", ""
        layer = _layer_of(hypermap, kind)
        limit = _in_unit_of(layer, float(found["limit"].replace(" ", "")), unit)
        limits = {"above": limit} if is_more else {"below": limit}
        measured = Measured(layer.name, **limits)
        before = re.sub(
            r"\b(?:where|have|has|with|get|gets|is|are)$", "", text[: found.start()].strip()
        )
        what = re.sub(r"(?:^|\s)(?:where|is|it|are|the|there|show|me)(?=\s|$)", " ", before.lower())
        if not what.strip():
            return Query("places", measured=measured, where=_places(rest, vocabulary))
        return replace(_things(f"{before} {rest}", vocabulary), measured=measured)
    return None


def _extreme(text: str, hypermap: Hypermap, vocabulary: Vocabulary) -> Query | None:
    """Read "which is the coldest office" and "the desk with the weakest wifi"."""
    for pattern, kind, which in _superlatives(hypermap):
        found = re.search(pattern, text, re.IGNORECASE)
        if found is None:
            continue
        rest = f"{text[: found.start()]} {text[found.end() :]}"
        rest = re.sub(r"\b(?:is|are|the|a|where|it|show|me|find)\b", " ", rest, flags=re.IGNORECASE)
        rest = re.sub(r"^\s*(?:which|what)\b", " ", rest, flags=re.IGNORECASE).strip()
        measured = Measured(_layer_of(hypermap, kind).name)
        if not rest:
            raise HypermapError(f"{found[0].strip()!r} of what? name rooms or objects")
        return replace(_things(rest, vocabulary), measured=measured, which=which)
    return None


def _how_much(text: str, hypermap: Hypermap, vocabulary: Vocabulary) -> Query | None:
    """Read "how warm is it in the kitchen" and "what is the temperature at 3, 2"."""
    names = {**dict.fromkeys(_layer_names(hypermap)), **dict.fromkeys(_QUANTITIES)}
    grades = {
        word: kind for kind, both in _GRADES.items() for one in both for word in one.split("|")
    }
    patterns = [(rf"how {word} (?:is|was) it\b", kind) for word, kind in grades.items()]
    asked = r"(?:what is|what's|how (?:high|strong|good|low|weak|much) is) the"
    patterns += [(rf"{asked} {re.escape(name)}\b", name) for name in names]
    for pattern, kind in patterns:
        found = re.match(
            rf"\s*{pattern}(?: level| signal| strength)?(?= |$)(.*)", text, re.IGNORECASE
        )
        if found is not None:
            layer = _layer_of(hypermap, kind)
            return Query(
                "value", measured=Measured(layer.name), where=_places(found[1], vocabulary)
            )
    return None


def _comparisons(hypermap: Hypermap) -> Iterator[tuple[str, str, bool]]:
    """Yield patterns of comparisons, the quantity that each names, and whether it asks for more."""
    for kind, both in _GRADES.items():
        for words, is_more in zip(both, (True, False), strict=True):
            for word in words.split("|"):
                stem = _COMPARED.get(word, word.removesuffix("e"))
                yield rf"(?:is it |it is )?(?:{stem}er|more {word}) than", kind, is_more
    for name in _layer_names(hypermap):
        about = (
            rf"(?:is |are )?(?:the |a )?{re.escape(name)}(?: level| signal| strength)?(?: is| of)?"
        )
        for words, is_more in ((_ABOVE, True), (_BELOW, False)):
            yield rf"{about} (?:{words})", name, is_more


def _superlatives(hypermap: Hypermap) -> Iterator[tuple[str, str, Which]]:
    directions: tuple[Which, Which] = ("highest", "lowest")
    for kind, both in _GRADES.items():
        for words, which in zip(both, directions, strict=True):
            for word in words.split("|"):
                stem = _COMPARED.get(word, word.removesuffix("e"))
                yield rf"\b(?:{stem}est|most {word})\b", kind, which
    for name in _layer_names(hypermap):
        for words, which in zip((_HIGHEST, _LOWEST), directions, strict=True):
            yield rf"\b(?:with|has|have|gets) the (?:{words}) {re.escape(name)}\b", name, which


def _layers(hypermap: Hypermap) -> list[ValueLayer]:
    return [layer for layer in hypermap if isinstance(layer, ValueLayer)]


def _names_of(layer: ValueLayer) -> set[str]:
    names = {layer.name.lower(), layer.quantity.lower()}
    return names | {name.replace("_", " ") for name in names}


def _layer_names(hypermap: Hypermap) -> list[str]:
    """Return what layers and their quantities are called, the longest first."""
    names = {name for layer in _layers(hypermap) for name in _names_of(layer)}
    return sorted(names, key=lambda name: (-len(name), name))


def _layer_of(hypermap: Hypermap, kind: str) -> ValueLayer:
    """Return the layer of a name, or of what a word such as "warm" is said."""
    names = {kind, *_QUANTITIES.get(kind, ())}
    layers = _layers(hypermap)
    found = [layer for layer in layers if names & _names_of(layer)]
    found = found or [layer for layer in layers if layer.unit in _UNITS_OF.get(kind, ())]
    if len(found) == 1:
        return found[0]
    if found:
        several = ", ".join(layer.name for layer in found)
        raise HypermapError(f"several layers are possible: {several}; name one")
    raise HypermapError(
        f"the map has no layer of measured {kind}; `hypermap values` makes one from samples"
    )


def _in_unit_of(layer: ValueLayer, limit: float, unit: str) -> float:
    given = _SPELLED.get(unit.replace(" ", "").lower(), unit.replace(" ", ""))
    if given == "" or given.lower() == layer.unit.lower():
        return limit
    known = given if given in _SPELLED.values() else given.lower()
    return float(converted(np.array([limit]), known, layer.unit)[0])


def _places(text: str, vocabulary: Vocabulary) -> tuple[Condition, ...]:
    """Return the conditions of a place, as "in the kitchen"; none for everywhere."""
    from hypermap.questions.english import understand  # with a parser that takes time to load

    if not text.strip():
        return ()
    if text.strip().lower() == "here":
        return (Condition("at", Reference(is_asker=True)),)
    query = understand(f"what is {text}", vocabulary)
    conditions = query.where
    if query != Query(where=conditions):
        raise HypermapError(
            f"{text.strip()!r}: questions about values are only about places, and the present"
        )
    for one in conditions:
        is_place = one.reference.rooms or one.reference.point_xy or one.reference.is_asker
        if one.negated or one.relation not in ("in", "at") or not is_place:
            raise HypermapError(f"{text.strip()!r}: questions about values need a room or a point")
    return conditions


def _things(text: str, vocabulary: Vocabulary) -> Query:
    """Return the query for objects or for rooms, which are objects of their layer."""
    from hypermap.questions.english import understand

    query = understand(re.sub(r"^\s*(?:which|what)\b", "", text, flags=re.IGNORECASE), vocabulary)
    if not query.asks_rooms:
        return query
    if query.describes_objects or query.which or query.give not in ("rooms", "count", "exists"):
        raise HypermapError(f"{text.strip()!r}: rooms can only be compared by name and kind")
    return Query(
        "objects" if query.give == "rooms" else query.give,
        layers=(ROOMS,),
        where=tuple(_are_called(query.rooms)),
    )


def _are_called(rooms: tuple[str, ...]) -> Iterable[Condition]:
    return [] if rooms in ((), ("room",)) else [Condition("in", Reference(rooms=rooms))]
