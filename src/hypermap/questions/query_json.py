"""Queries as JSON values, and back."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from datetime import datetime, timezone
from typing import Any

from hypermap.core.errors import FormatError
from hypermap.core.iso_times import time_from_iso
from hypermap.questions.query import Condition, Measured, Number, Query, Reference, When

_DEEPEST = 8  # references within each other
_JSON_KEYS = {"reference": "what", "is_asker": "asker", "point_xy": "point", "other": "and"}
_PARTS = (Reference, Condition, When, Measured, Number)


def json_of(query: Query) -> dict[str, Any]:
    """Return a query as JSON values, without what is left at its default."""
    return _object(query)


def query_of(values: Any) -> Query:
    """Return the query that JSON values describe.

    Raises:
        FormatError: If they describe none; it names the key.
    """
    given = _checked(values, "the query", Query)
    where = _list(given.get("where", ()), "where")
    given["where"] = tuple(_condition(one, f"where[{i}]") for i, one in enumerate(where))
    for key in ("names", "besides", "tags", "rooms", "layers"):
        given[key] = _names(given.get(key, ()), key)
    given["ids"] = tuple(_whole(one, "ids") for one in _list(given.get("ids", ()), "ids"))
    given["when"] = _times(given.get("when"))
    if given.get("as_of") is not None:
        given["as_of"] = _moment(given["as_of"], "as_of")
    if given.get("measured") is not None:
        given["measured"] = _measured(given["measured"])
    if given.get("number") is not None:
        given["number"] = _number_of(given["number"])
    if given.get("start") is not None:
        given["start"] = _reference(given["start"], "start")
    for key, spec in Query.__dataclass_fields__.items():
        is_given = given.get(key) is not None or (key in given and spec.type == "bool")
        if is_given and spec.type in _PLAIN:
            given[key] = _PLAIN[spec.type](given[key], key)
    made: Query = _made(Query, given, "the query")
    return made


def _object(value: Any) -> dict[str, Any]:
    result: dict[str, Any] = {}
    for name, spec in value.__dataclass_fields__.items():
        part = getattr(value, name)
        if part == spec.default:
            continue
        shown = [_value(one) for one in part] if isinstance(part, tuple) else _value(part)
        # One time stands for itself, as it did when there could be no more.
        is_one_time = name == "when" and len(part) == 1
        result[_JSON_KEYS.get(name, name)] = shown[0] if is_one_time else shown
    return result


def _value(part: Any) -> Any:
    if isinstance(part, _PARTS):
        return _object(part)
    return part.isoformat() if isinstance(part, datetime) else part


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


def _whole(value: Any, where: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise FormatError(f"{where}: expected a whole number")
    return value


def _number(value: Any, where: str) -> float:
    if not _is_number(value):
        raise FormatError(f"{where}: expected a number")
    return float(value)


def _text(value: Any, where: str) -> str:
    if not isinstance(value, str):
        raise FormatError(f"{where}: expected a text")
    return value


def _flag(value: Any, where: str) -> bool:
    if not isinstance(value, bool):
        raise FormatError(f"{where}: expected true or false")
    return value


# By the annotation of a field; all other fields have a line of their own in `query_of`.
_PLAIN: dict[str, Callable[[Any, str], Any]] = {
    "bool": _flag,
    "float | None": _number,
    "int | None": _whole,
    "str | None": _text,
}


def _is_number(value: Any) -> bool:
    is_one = isinstance(value, int | float) and not isinstance(value, bool)
    return is_one and abs(value) <= sys.float_info.max


def _times(values: Any) -> tuple[When, ...]:
    """Return the times of a query: a list, or one alone."""
    if values is None:
        return ()
    if isinstance(values, Mapping):
        return (_when(values, "when"),)
    return tuple(_when(one, f"when[{i}]") for i, one in enumerate(_list(values, "when")))


def _when(values: Any, where: str) -> When:
    given = _checked(values, where, When)
    for key in ("since", "until"):
        if given.get(key) is not None:
            given[key] = _moment(given[key], f"{where}.{key}")
    made: When = _made(When, given, where)
    return made


def _measured(values: Any) -> Measured:
    given = _checked(values, "measured", Measured)
    if not isinstance(given.get("layer", ""), str | None):
        raise FormatError("measured.layer: expected a name")
    for key in ("above", "below"):
        if given.get(key) is not None:
            given[key] = _number(given[key], f"measured.{key}")
    made: Measured = _made(Measured, given, "measured")
    return made


def _number_of(values: Any) -> Number:
    given = _checked(values, "number", Number)
    for key, value in given.items():
        if key == "at_least" or value is not None:
            given[key] = _whole(value, f"number.{key}")
    made: Number = _made(Number, given, "number")
    return made


def _moment(value: Any, where: str) -> datetime:
    """Return a moment out of a text as 2026-11-20T10:00+01:00; without a zone, it is in UTC.

    Raises:
        FormatError: If it is none; it begins with `where`.
    """
    try:
        moment = time_from_iso(str(value))
    except ValueError:
        raise FormatError(
            f"{where}: {str(value)[:40]!r} is not a date or time such as 2026-11-20T10:00+01:00"
        ) from None
    return moment if moment.tzinfo else moment.replace(tzinfo=timezone.utc)


def _condition(values: Any, where: str) -> Condition:
    given = _checked(values, where, Condition)
    if "reference" not in given:
        raise FormatError(f"{where}: the key 'what' is missing")
    given["reference"] = _reference(given["reference"], f"{where}.what")
    if given.get("within") is not None:
        given["within"] = _number(given["within"], f"{where}.within")
    if given.get("other") is not None:
        given["other"] = _reference(given["other"], f"{where}.what and")
    made: Condition = _made(Condition, given, where)
    return made


def _reference(values: Any, where: str) -> Reference:
    given = _checked(values, where, Reference)
    conditions = _list(given.get("where", ()), f"{where}.where")
    if where.count(".what") > _DEEPEST:
        raise FormatError(f"{where}: more than {_DEEPEST} nested references")
    given["where"] = tuple(
        _condition(one, f"{where}.where[{i}]") for i, one in enumerate(conditions)
    )
    given |= {key: _names(given.get(key, ()), f"{where}.{key}") for key in ("names", "rooms")}
    if given.get("point_xy") is not None:
        point = _list(given["point_xy"], f"{where}.point")
        if len(point) != 2 or not all(map(_is_number, point)):
            raise FormatError(f"{where}.point: expected two finite numbers")
        given["point_xy"] = (float(point[0]), float(point[1]))
    if not isinstance(given.get("area", ""), str | None):
        raise FormatError(f"{where}.area: expected WKT")
    made: Reference = _made(Reference, given, where)
    return made
