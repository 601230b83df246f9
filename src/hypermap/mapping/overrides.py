"""Overrides: values from a YAML file replace those of a dataclass, checked one by one."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from hypermap.core.errors import FileMissing, FormatError, did_you_mean
from hypermap.formats.checked import found
from hypermap.formats.yaml_text import read_yaml

_MAX_BYTES = 1_000_000

T = TypeVar("T")


def read_overrides(path: Path) -> Mapping[str, Any]:
    """Return the mapping that a YAML file holds; an empty file holds no overrides.

    Raises:
        FileMissing: If there is no such file.
        FormatError: If it is too large, or not a YAML mapping.
    """
    if not path.is_file():
        raise FileMissing(f"{path}: there is no such configuration file")
    if path.stat().st_size > _MAX_BYTES:
        raise FormatError(f"larger than {_MAX_BYTES} bytes; is it a configuration?", path=path)
    values = read_yaml(path.read_bytes(), str(path))
    if values is None:
        return {}
    if not isinstance(values, dict):
        raise FormatError(f"expected keys and values, found {found(values)}", path=path)
    return values


def override(config: T, values: Mapping[str, Any], *, path: Path | None = None, key: str = "") -> T:
    """Return a copy of a dataclass in which the given values replace its own.

    Args:
        config: a dataclass whose fields are numbers, words (Literal), numbers by name (Mapping), or
            such dataclasses.
        values: new values by field name; a field that is a dataclass takes a mapping.
        path: the file that errors name.
        key: the key of `config` itself in that file, as "evidence".

    Raises:
        FormatError: If a key is unknown, or a value has the wrong type or lies out of range.
    """
    hints = get_type_hints(type(config))
    known = [f.name for f in dataclasses.fields(config)]  # type: ignore[arg-type]
    changes: dict[str, Any] = {}
    for name, value in values.items():
        full = f"{key}.{name}" if key else str(name)
        if name not in known:
            raise FormatError(f"unknown key; {did_you_mean(str(name), known)}", path=path, key=full)
        before = getattr(config, name)
        if dataclasses.is_dataclass(before):
            if not isinstance(value, dict):
                message = f"expected keys and values, found {found(value)}"
                raise FormatError(message, path=path, key=full)
            changes[name] = override(before, value, path=path, key=full)
        else:
            try:
                changes[name] = _converted(value, hints[name])
            except ValueError as error:
                raise FormatError(str(error), path=path, key=full) from None
    try:
        return dataclasses.replace(config, **changes)  # type: ignore[type-var]
    except ValueError as error:  # the dataclass checks ranges itself and names the field
        raise FormatError(str(error), path=path, key=key or None) from error


_WORDS = {float: "a number", int: "a whole number", bool: "true or false"}


def _converted(value: Any, hint: Any) -> Any:
    """Return the value as the type that a field is annotated with, or raise ValueError."""
    if get_origin(hint) is Literal:
        if value in get_args(hint):
            return value
        raise ValueError(f"must be one of {', '.join(get_args(hint))}; found {found(value)}")
    if get_origin(hint) is Mapping:
        return _numbers(value)
    is_bool = isinstance(value, bool)
    with suppress(OverflowError):
        if hint is float and isinstance(value, int | float) and not is_bool and value == value:
            return float(value)  # NaN alone is not equal to itself
    if hint is not float and isinstance(value, hint) and is_bool == (hint is bool):
        return value
    raise ValueError(f"must be {_WORDS[hint]}; found {found(value)}")


def _numbers(value: Any) -> dict[str, float]:
    """Return numbers by name, or raise ValueError."""
    if not isinstance(value, dict):
        raise ValueError(f"must be names with numbers; found {found(value)}")
    return {str(name): _number_of(str(name), number) for name, number in value.items()}


def _number_of(name: str, value: Any) -> float:
    try:
        return float(_converted(value, float))
    except ValueError as error:
        raise ValueError(f"{name} {error}") from None
