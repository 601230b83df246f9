"""A question about a map as a value: what, where, which of it, and what to give back."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Literal, TypeAlias, get_args

from hypermap.core.area_text import area_from_wkt
from hypermap.core.errors import HypermapError

Give: TypeAlias = Literal[
    "objects",
    "count",
    "exists",
    "distance",
    "room",
    "rooms",
    "last_seen",
    "size",
    "labels",
    "places",
    "value",
]
Relation: TypeAlias = Literal[
    "in",
    "in the room of",
    "next door to",
    "at",
    "near",
    "beyond",
    "on",
    "under",
    "carrying",
    "left of",
    "right of",
    "in front of",
    "behind",
    "visible from",
    "with",
    "between",
]
Which: TypeAlias = Literal[
    "nearest",
    "farthest",
    "largest",
    "smallest",
    "tallest",
    "surest",
    "newest",
    "highest",
    "lowest",
    "most",
    "fewest",
]
Per: TypeAlias = Literal["room"]
Measure: TypeAlias = Literal["air", "path"]
Seen: TypeAlias = Literal["seen", "not seen", "new"]

MOST_LETTERS = 500
"""The longest text that objects are to look like."""

_FARTHEST = 1e9  # meters

_SEVERAL = ("names", "besides", "ids", "tags", "rooms", "where", "when", "layers")

WITH_DISTANCE = ("near", "beyond")
OF_COUNTS = ("most", "fewest")


class FarAway(HypermapError, ValueError):
    """A place or a distance is too far away for floating-point numbers to be exact."""


@dataclass(frozen=True)
class Reference:
    """The reference of a condition or a distance; exactly one of these is given.

    Attributes:
        names: of objects, any of which matches; names, synonyms or kinds of objects.
        where: conditions on these objects.
        rooms: names or kinds of rooms, any of which will do.
        point_xy: a point in the base frame [m].
        area: an area in the base frame [m], as WKT.
        is_asker: whether it is the position of the asker.
    """

    names: tuple[str, ...] = ()
    where: tuple[Condition, ...] = ()
    rooms: tuple[str, ...] = ()
    point_xy: tuple[float, float] | None = None
    area: str | None = None
    is_asker: bool = False

    def __post_init__(self) -> None:
        _take_several(self, "names", "where", "rooms")
        places = [self.point_xy is not None, self.area is not None, self.is_asker]
        if sum([self.names != (), self.rooms != (), *places]) != 1:
            raise ValueError(
                "a reference is exactly one of names, rooms, a point, an area, and the asker"
            )
        if self.area is not None:
            area_from_wkt(self.area)
        if self.point_xy is not None:
            if len(self.point_xy) != 2:
                raise ValueError(f"a point is (x, y), got {self.point_xy}")
            _check_near("a point", self.point_xy)
        if self.where and not self.names:
            raise ValueError("only a reference by names has conditions")


@dataclass(frozen=True)
class Condition:
    """A condition on where objects are.

    Attributes:
        relation: "near" and "beyond" compare the distance between shapes with `within`; sides, such
            as "left of", are as the asker sees the reference; those of the asker depend on the
            heading. "carrying" holds for objects on which there is such an object. "visible from"
            needs a line of sight without walls; "with" holds for rooms that contain such an object,
            "next door to" for rooms with a door to such a room, "in the room of" for objects that
            share a room with one; "between" is between the reference and the other one.
        reference: the place, room or objects that it refers to. Any of the objects will do, but
            "between" needs a single one. "in" with the asker means in the same room.
        within: a distance [m]; None for "next to" (`NEXT_TO` in `answer`).
        negated: whether to negate the condition.
        other: the second place of "between".
    """

    relation: Relation
    reference: Reference
    within: float | None = None
    negated: bool = False
    other: Reference | None = None

    def __post_init__(self) -> None:
        if self.relation not in get_args(Relation):
            raise ValueError(f"there is no relation {self.relation!r}")
        if self.within is not None and not (math.isfinite(self.within) and self.within >= 0):
            raise ValueError(f"a distance is finite and not negative, got {self.within}")
        if self.within is not None:
            _check_near("a distance", (self.within,))
        if self.within is not None and self.relation not in WITH_DISTANCE:
            raise ValueError(f"{self.relation!r} takes no distance")
        if self.relation == "beyond" and self.within is None:
            raise ValueError("'beyond' needs a distance")
        if (self.other is not None) != (self.relation == "between"):
            raise ValueError("'between', and nothing else, needs a second reference, 'and'")


@dataclass(frozen=True)
class When:
    """A condition on when objects were seen.

    For each object, the map knows when it was first and last seen. An object counts as seen in a
    past period if either time is in it.

    Attributes:
        seen: "seen" in the period, "not seen" since its beginning, or "new": first seen in it.
        since: beginning of the period, with its time zone; None for none.
        until: end of the period, with its time zone; None for now.
    """

    seen: Seen = "seen"
    since: datetime | None = None
    until: datetime | None = None

    def __post_init__(self) -> None:
        if self.seen not in get_args(Seen):
            raise ValueError(f"{self.seen!r} is not one of {', '.join(get_args(Seen))}")
        if self.since is None and self.until is None:
            raise ValueError("a time needs its begin or its end")
        if self.seen == "not seen" and (self.since is None or self.until is not None):
            raise ValueError("'not seen' needs the time since when, and no end")
        for moment in (self.since, self.until):
            if moment is not None and moment.tzinfo is None:
                raise ValueError(f"{moment.isoformat()} needs a time zone, as +01:00")


@dataclass(frozen=True)
class Measured:
    """A condition on measured values, such as temperatures.

    Attributes:
        layer: the layer of the values; None for the only one.
        above: the mean around an object, or the value at a place, is above this; None for any.
        below: it is below this; None for any.
    """

    layer: str | None = None
    above: float | None = None
    below: float | None = None

    def __post_init__(self) -> None:
        for limit in (self.above, self.below):
            if limit is not None and math.isnan(limit):
                raise ValueError("a limit of measured values is a number")

    @property
    def has_limits(self) -> bool:
        """Whether only some values will do."""
        return (self.above, self.below) != (None, None)


@dataclass(frozen=True)
class Number:
    """A condition on how many objects there are.

    Attributes:
        at_least: minimum number.
        at_most: maximum number; None for any.
    """

    at_least: int = 0
    at_most: int | None = None

    def __post_init__(self) -> None:
        if self.at_least < 0 or (self.at_most is not None and self.at_most < self.at_least):
            raise ValueError("a number is at least 0, and at most no less than at least")
        if self.at_least == 0 and self.at_most is None:
            raise ValueError("a number needs 'at_least' or 'at_most'")

    def holds(self, count: int) -> bool:
        """Return whether a number meets the condition.

        >>> Number(at_least=2).holds(3), Number(at_most=0).holds(3)
        (True, False)
        """
        return self.at_least <= count and (self.at_most is None or count <= self.at_most)


@dataclass(frozen=True)
class Query:
    """A question as a value.

    Attributes:
        give: what to return: the objects, how many there are, whether there are any, how far away
            they are, the rooms that they are in ("room"), the rooms that contain them ("rooms";
            all rooms without names), when they were last seen, how large they are ("size"; of
            rooms, too), the objects and the labels of layers without objects ("labels"), the places
            at which `measured` holds ("places"), or the value measured at a point, in a room or
            everywhere ("value").
        names: names of the objects, any of which matches; none for all. A name matches the objects
            with that name in the map, and those of that kind by the taxonomy.
        exact: whether to match only the names in the map, without a taxonomy; includes rooms.
        besides: names that the objects must not have.
        ids: ids of the objects, any of which matches; none for all.
        tags: tags that each object has.
        like: the appearance of the objects, such as "something to sit on": the `count` most similar
            ones, in a map whose objects were embedded.
        rooms: names or kinds of rooms, to query rooms instead of objects.
        where: conditions that all must hold for an object.
        when: conditions on when an object was seen that all must hold.
        as_of: time of the map to query, with its time zone; None for now.
        measured: the values around the objects or at the places; None if they do not matter.
        layers: the layers to query; none for all.
        value: the value of cells of the layers, for "labels".
        which: which of the objects to return; None for all. "highest" and "lowest" refer to
            `measured`, "most" and "fewest" to rooms and their objects, with `per`.
        count: how many of them; None for one if `which` is given, or all rooms that tie.
        rank: 2 for the second nearest (largest, ...) alone, and so on; None for the first.
        start: the start of distances; None for the position of the asker.
        by: whether distances are straight ("air") or along paths for a robot.
        per: "room" counts the objects in each room: "count" returns all rooms with their counts, or
            how many rooms have a `number` of objects; "exists" whether any does; "rooms" those
            that do, or those with `which`.
        number: how many objects there are, for "exists"; with `per`, how many are in a room.
    """

    give: Give = "objects"
    names: tuple[str, ...] = ()
    exact: bool = False
    besides: tuple[str, ...] = ()
    ids: tuple[int, ...] = ()
    tags: tuple[str, ...] = ()
    like: str | None = None
    rooms: tuple[str, ...] = ()
    where: tuple[Condition, ...] = ()
    when: tuple[When, ...] = ()
    as_of: datetime | None = None
    measured: Measured | None = None
    layers: tuple[str, ...] = ()
    value: float | None = None
    which: Which | None = None
    count: int | None = None
    rank: int | None = None
    start: Reference | None = None
    by: Measure = "air"
    per: Per | None = None
    number: Number | None = None

    def __post_init__(self) -> None:
        _take_several(self, *_SEVERAL)
        pairs = ((self.give, Give), (self.which, Which), (self.by, Measure), (self.per, Per))
        for value, choices in pairs:
            if value is not None and value not in get_args(choices):
                raise ValueError(f"{value!r} is not one of {', '.join(get_args(choices))}")
        if self.rooms and self.describes_objects:
            raise ValueError("a query asks for rooms or for objects, not for both")
        if self.count is not None and self.count < 1:
            raise ValueError(f"count must be at least 1, got {self.count}")
        if self.rank is not None and self.rank < 1:
            raise ValueError(f"rank must be at least 1, got {self.rank}")
        if self.rank is not None and (self.which in (None, *OF_COUNTS) or self.count is not None):
            raise ValueError("a rank is of the nearest, the largest and so on, without a count")
        if self.rank is not None and self.give in ("labels", "places"):
            raise ValueError("a rank is of objects or rooms")
        if self.as_of is not None and self.as_of.tzinfo is None:
            raise ValueError(f"{self.as_of.isoformat()} needs a time zone, as +01:00")
        if self.give == "places" and (self.measured is None or not self.measured.has_limits):
            raise ValueError("'places' needs measured values with a limit")
        if self.measured is None and (self.give == "value" or self.which in ("highest", "lowest")):
            raise ValueError("values, the highest and the lowest need measured values")
        if self.like is not None and (self.which is not None or not self.like.strip()):
            raise ValueError("'like' is a text, and gives the most similar instead of 'which'")
        if len(self.like or "") > MOST_LETTERS:
            raise ValueError(f"'like' is a text of at most {MOST_LETTERS} letters")
        if self.value is not None and self.give != "labels":
            raise ValueError("only 'labels' has the values of cells")
        self._check_counts()

    def _check_counts(self) -> None:
        """Raise a ValueError if objects are counted as no question means it."""
        if self.per is None:
            if self.number is not None and self.give != "exists":
                raise ValueError("a number is for 'exists', or goes with 'per'")
            if self.which in OF_COUNTS:
                raise ValueError("the most and the fewest need 'per'")
            return
        if self.give not in ("count", "exists", "rooms"):
            raise ValueError("'per' goes with 'count', 'exists' and 'rooms'")
        if self.like is not None or self.which not in (None, *OF_COUNTS):
            raise ValueError("of what is counted, 'which' is 'most' or 'fewest'")
        if self.number is not None and self.which is not None:
            raise ValueError("a query asks for a number or for the most, not for both")
        if self.give == "exists" and self.number is None:
            raise ValueError("any room with how many? this needs a number")

    @property
    def chosen(self) -> slice:
        """Which of the objects or rooms to return, if the first by `which` come first."""
        if self.rank is not None:
            return slice(self.rank - 1, self.rank)
        return slice(0, self.count or 1)

    @property
    def describes_objects(self) -> bool:
        """Whether it has conditions on the objects, so that the answer is about some of them."""
        which = (self.names, self.besides, self.ids, self.tags, self.like, self.where, self.when)
        return any(which) or self.measured is not None or self.per is not None

    @property
    def asks_rooms(self) -> bool:
        """Whether the answer is rooms."""
        return self.give == "rooms" or bool(self.rooms) or self.per is not None

    @property
    def counts_each_room(self) -> bool:
        """Whether the answer is how many objects there are in each room."""
        return self.per is not None and self.give == "count" and self.number is None

    def to_json(self) -> dict[str, Any]:
        """Return the query as JSON values, without defaults."""
        from hypermap.questions.query_json import json_of  # which knows this class

        return json_of(self)

    @classmethod
    def from_json(cls, values: Any) -> Query:
        """Return the query that JSON values describe; the schema is `QUERY_SCHEMA`.

        Raises:
            FormatError: If they describe none; it names the key.

        >>> Query.from_json({"names": ["cup"], "which": "nearest"}).which
        'nearest'
        """
        from hypermap.questions.query_json import query_of  # which knows this class

        return query_of(values)


def _take_several(part: Reference | Query, *keys: str) -> None:
    """Keep what there may be several of as tuples.

    Raises:
        TypeError: If it is a single one: a text would be taken letter by letter.
    """
    for key in keys:
        value = getattr(part, key)
        if isinstance(value, str) or not isinstance(value, Iterable):
            raise TypeError(f"{key} may be several: write ({value!r},) with a comma for one")
        object.__setattr__(part, key, tuple(value))


def _check_near(what: str, meters: Iterable[float]) -> None:
    if not max(map(abs, meters)) <= _FARTHEST:
        raise FarAway(f"{what} is farther away than {_FARTHEST:g} m")
