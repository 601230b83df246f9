"""What nouns mean in questions about a map: names of things, and of rooms and their kinds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache

from hypermap.questions.keywords import is_reserved
from hypermap.questions.taxonomy import Taxonomy, as_key, load_taxonomy

_PLACES = ("structure", "outdoor thing")  # kinds of things, of which a room may have the name
_ALSO_ROOMS = {
    "hallway": "corridor",
    "hall": "corridor",
    "passage": "corridor",
    "restroom": "bathroom",
    "washroom": "bathroom",
    "lounge": "living room",
    "conference room": "meeting room",
}


@dataclass(frozen=True)
class Vocabulary:
    """What nouns mean.

    Attributes:
        taxonomy: of things.
        objects: names of the objects of the map; keywords such as "in" are not names without
            quotation marks.
        rooms: names and kinds of its rooms; kinds are known without a map, too.
        kinds: of rooms.
    """

    taxonomy: Taxonomy
    objects: tuple[str, ...] = ()
    rooms: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ()
    phrases: Mapping[str, tuple[tuple[str, str], ...]] = field(init=False)

    def __post_init__(self) -> None:
        phrases = dict(_phrases_of(self.taxonomy))

        def add(phrase: str, token: str, value: str) -> None:
            meanings = phrases.get(phrase, ())
            if (token, value) not in meanings:
                phrases[phrase] = (*meanings, (token, value))

        for name in self.objects:
            known = self.taxonomy.usual_name(name)
            for form in (as_key(name), f"{as_key(name)}s"):
                if known is None and form not in phrases and not is_reserved(form):
                    add(form, "THING", name)
        in_use = {self.taxonomy.usual_name(name) for name in self.objects}
        for name in self.rooms:
            key = as_key(name)
            if self._is_place(key) and self.taxonomy.usual_name(key) not in in_use:
                del phrases[key]  # a room called "balcony", and no thing
            if not is_reserved(key):  # a room may be called "room"
                add(key, "ROOM_NAME", name)
        own = {as_key(name) for name in self.rooms}
        names = {kind: kind for kind in self.kinds}
        names |= {f"{kind} room": kind for kind in self.kinds if not kind.endswith("room")}
        names |= {also: kind for also, kind in _ALSO_ROOMS.items() if kind in names}
        for name, kind in names.items():
            for form in sorted({name, f"{name}s", f"{name.removesuffix('y')}ies"} - own):
                add(form, "ROOM_NAME", kind)
        object.__setattr__(self, "phrases", phrases)

    def _is_place(self, name: str) -> bool:
        """Return whether a name is of a part of a building, or of something outdoors."""
        usual = self.taxonomy.usual_name(name)
        return usual is not None and any(self.taxonomy.is_a(usual, kind) for kind in _PLACES)


def _phrases_of(taxonomy: Taxonomy) -> Mapping[str, tuple[tuple[str, str], ...]]:
    """Return what the names of a taxonomy mean; found once for ours, as it is the same always."""
    return _ours() if taxonomy is load_taxonomy() else _all_phrases(taxonomy)


@cache
def _ours() -> Mapping[str, tuple[tuple[str, str], ...]]:
    return _all_phrases(load_taxonomy())


def _all_phrases(taxonomy: Taxonomy) -> Mapping[str, tuple[tuple[str, str], ...]]:
    phrases: dict[str, tuple[tuple[str, str], ...]] = {}
    for names in (taxonomy.plurals, taxonomy.usual):
        for name, usual in names.items():
            if ("THING", usual) not in phrases.get(name, ()):
                phrases[name] = (*phrases.get(name, ()), ("THING", usual))
    return phrases
