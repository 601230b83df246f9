"""A question about a map as a value: what, where, which of it, and what to give back."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timezone
from typing import Any, Literal, TypeAlias, get_args

from hypermap.core.errors import FormatError

Give: TypeAlias = Literal["objects", "count", "exists", "distance", "room", "rooms", "last_seen"]
Relation: TypeAlias = Literal[
    "in", "at", "near", "beyond", "on", "under", "left of", "right of", "in front of", "behind"
]
Which: TypeAlias = Literal["nearest", "farthest", "largest", "smallest", "surest", "newest"]
Measure: TypeAlias = Literal["air", "path"]
Seen: TypeAlias = Literal["seen", "not seen", "new"]

WITH_DISTANCE = ("near", "beyond")


@dataclass(frozen=True)
class Reference:
    """What a condition or a distance refers to: one of these.

    Attributes:
        names: of objects, any of which matches; names, synonyms or kinds of things.
        where: conditions on these objects.
        rooms: names or kinds of rooms, any of which will do.
        point_xy: a point in the base frame [m].
        is_asker: whether it is where the asker is.
    """

    names: tuple[str, ...] = ()
    where: tuple[Condition, ...] = ()
    rooms: tuple[str, ...] = ()
    point_xy: tuple[float, float] | None = None
    is_asker: bool = False

    def __post_init__(self) -> None:
        given = [self.names != (), self.rooms != (), self.point_xy is not None, self.is_asker]
        if sum(given) != 1:
            raise ValueError("a reference is exactly one of names, rooms, a point, and the asker")
        if self.where and not self.names:
            raise ValueError("only a reference by names has conditions")


@dataclass(frozen=True)
class Condition:
    """A condition on where objects are.

    Attributes:
        relation: "near" and "beyond" compare the distance between shapes with `within`; the sides
            are those of the reference as the asker sees it.
        reference: the place, room or objects that it refers to; any of the objects will do.
        within: a distance [m]; None for "next to" (`NEXT_TO` in `answer`).
        negated: whether the opposite is asked for.
    """

    relation: Relation
    reference: Reference
    within: float | None = None
    negated: bool = False

    def __post_init__(self) -> None:
        if self.relation not in get_args(Relation):
            raise ValueError(f"there is no relation {self.relation!r}")
        if self.within is not None and not (math.isfinite(self.within) and self.within >= 0):
            raise ValueError(f"a distance is finite and not negative, got {self.within}")
        if self.within is not None and self.relation not in WITH_DISTANCE:
            raise ValueError(f"{self.relation!r} takes no distance")
        if self.relation == "beyond" and self.within is None:
            raise ValueError("'beyond' needs a distance")


@dataclass(frozen=True)
class When:
    """A condition on when objects were seen.

    Of each object, the map knows when it was seen first and last. In a time that is over, an object
    counts as seen if either was then.

    Attributes:
        seen: "seen" in that time, "not seen" from its begin on, or "new": seen then first.
        since: when the time begins, with its time zone; None for ever before.
        until: when it ends, with its time zone; None for now.
    """

    seen: Seen = "seen"
    since: datetime | None = None
    until: datetime | None = None

    def __post_init__(self) -> None:
        if self.seen not in get_args(Seen):
            raise ValueError(f"{self.seen!r} is none of {', '.join(get_args(Seen))}")
        if self.since is None and self.until is None:
            raise ValueError("a time needs its begin or its end")
        if self.seen == "not seen" and (self.since is None or self.until is not None):
            raise ValueError("'not seen' needs the time since when, and no end")
        for moment in (self.since, self.until):
            if moment is not None and moment.tzinfo is None:
                raise ValueError(f"{moment.isoformat()} needs a time zone, as +01:00")


@dataclass(frozen=True)
class Query:
    """A question.

    Attributes:
        give: the objects, how many there are, whether there are any, how far they are, the rooms
            that they are in ("room"), the rooms that have them ("rooms"; all without names), or
            when they were last seen.
        names: of the objects, any of which matches; none for all. A name matches the objects of a
            map that are called so, and those that are of that kind by the taxonomy.
        besides: names that the objects must not have.
        rooms: names or kinds of rooms, if these and not objects are asked for.
        where: conditions, all of which the objects meet.
        when: when the objects were seen; None for whenever.
        which: which of the objects are wanted; None for all.
        count: how many of those; None for one if `which` is given.
        start: from where distances are measured; None for where the asker is.
        by: whether distances are straight ("air"), or along paths for a robot.
    """

    give: Give = "objects"
    names: tuple[str, ...] = ()
    besides: tuple[str, ...] = ()
    rooms: tuple[str, ...] = ()
    where: tuple[Condition, ...] = ()
    when: When | None = None
    which: Which | None = None
    count: int | None = None
    start: Reference | None = None
    by: Measure = "air"

    def __post_init__(self) -> None:
        for value, choices in ((self.give, Give), (self.which, Which), (self.by, Measure)):
            if value is not None and value not in get_args(choices):
                raise ValueError(f"{value!r} is none of {', '.join(get_args(choices))}")
        if self.rooms and (self.names or self.besides or self.where or self.when):
            raise ValueError("a query asks for rooms or for objects, not for both")
        if self.count is not None and self.count < 1:
            raise ValueError(f"count must be at least 1, got {self.count}")

    @property
    def asks_rooms(self) -> bool:
        """Whether the answer is rooms."""
        return self.give == "rooms" or bool(self.rooms)

    def to_json(self) -> dict[str, Any]:
        """Return the query as JSON values, without what is left at its default."""
        return _to_json(self)

    @classmethod
    def from_json(cls, values: Any) -> Query:
        """Return the query that JSON values describe; the schema is `QUERY_SCHEMA`.

        Raises:
            FormatError: If they describe none; it names the key.

        >>> Query.from_json({"names": ["cup"], "which": "nearest"}).which
        'nearest'
        """
        given = _checked(values, "the query", cls)
        where = given.get("where", ())
        conditions = [_condition(one, f"where[{i}]") for i, one in enumerate(_list(where, "where"))]
        given |= {"where": tuple(conditions)}
        given |= {key: _names(given.get(key, ()), key) for key in ("names", "besides", "rooms")}
        if given.get("when") is not None:
            given["when"] = _when(given["when"])
        if given.get("start") is not None:
            given["start"] = _reference(given["start"], "start")
        count = given.get("count")
        if count is not None and (isinstance(count, bool) or not isinstance(count, int)):
            raise FormatError("count: expected a whole number")
        made: Query = _made(cls, given, "the query")
        return made


_DEEPEST = 8  # references within each other
_JSON_KEYS = {"reference": "what", "is_asker": "asker", "point_xy": "point"}


def _to_json(value: Any) -> dict[str, Any]:
    result: dict[str, Any] = {}
    for name, spec in value.__dataclass_fields__.items():
        part = getattr(value, name)
        if part == spec.default:
            continue
        key = _JSON_KEYS.get(name, name)
        if isinstance(part, Reference | When):
            result[key] = _to_json(part)
        elif isinstance(part, datetime):
            result[key] = part.isoformat()
        elif isinstance(part, tuple):
            result[key] = [_to_json(one) if isinstance(one, Condition) else one for one in part]
        else:
            result[key] = part
    return result


def _checked(values: Any, where: str, cls: type[Any]) -> dict[str, Any]:
    """Return the values of a JSON object by the names of a class's attributes."""
    names = {_JSON_KEYS.get(name, name): name for name in cls.__dataclass_fields__}
    if not isinstance(values, Mapping):
        raise FormatError(f"{where}: expected an object, got {type(values).__name__}")
    for key in values:
        if key not in names:
            raise FormatError(f"{where}: there is no key {key!r}; known: {', '.join(names)}")
    return {names[key]: value for key, value in values.items()}


def _made(cls: type[Any], given: Mapping[str, Any], where: str) -> Any:
    try:
        return cls(**given)
    except (TypeError, ValueError) as error:
        raise FormatError(f"{where}: {error}") from None


def _list(values: Any, where: str) -> list[Any]:
    if not isinstance(values, list | tuple):
        raise FormatError(f"{where}: expected a list, got {type(values).__name__}")
    return list(values)


def _names(values: Any, where: str) -> tuple[str, ...]:
    names = _list(values, where)
    if not all(isinstance(name, str) for name in names):
        raise FormatError(f"{where}: expected names")
    return tuple(names)


def _when(values: Any) -> When:
    given = _checked(values, "when", When)
    for key in ("since", "until"):
        if given.get(key) is not None:
            given[key] = parse_moment(given[key], f"when.{key}")
    made: When = _made(When, given, "when")
    return made


def parse_moment(value: Any, where: str) -> datetime:
    """Return a moment out of a text as 2026-11-20T10:00+01:00; without a zone, it is in UTC.

    Raises:
        FormatError: If it is none; it begins with `where`.
    """
    try:
        moment = datetime.fromisoformat(str(value).strip().replace("Z", "+00:00"))
    except ValueError:
        raise FormatError(
            f"{where}: {str(value)[:40]!r} is no date or time as 2026-11-20T10:00+01:00"
        ) from None
    return moment if moment.tzinfo else moment.replace(tzinfo=timezone.utc)


def _condition(values: Any, where: str) -> Condition:
    given = _checked(values, where, Condition)
    if "reference" not in given:
        raise FormatError(f"{where}: the key 'what' is missing")
    given["reference"] = _reference(given["reference"], f"{where}.what")
    made: Condition = _made(Condition, given, where)
    return made


def _reference(values: Any, where: str) -> Reference:
    given = _checked(values, where, Reference)
    conditions = _list(given.get("where", ()), f"{where}.where")
    if where.count(".what") > _DEEPEST:
        raise FormatError(f"{where}: more than {_DEEPEST} references within each other")
    given["where"] = tuple(
        _condition(one, f"{where}.where[{i}]") for i, one in enumerate(conditions)
    )
    given |= {key: _names(given.get(key, ()), f"{where}.{key}") for key in ("names", "rooms")}
    if given.get("point_xy") is not None:
        point = _list(given["point_xy"], f"{where}.point")
        numbers = [one for one in point if isinstance(one, int | float) and math.isfinite(one)]
        if len(point) != 2 or len(numbers) != 2:
            raise FormatError(f"{where}.point: expected two finite numbers")
        given["point_xy"] = (float(numbers[0]), float(numbers[1]))
    made: Reference = _made(Reference, given, where)
    return made
