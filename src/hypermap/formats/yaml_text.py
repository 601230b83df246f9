"""YAML from untrusted files: bounded, without tags, with every key once.

The text is read event by event, not by PyYAML's constructors: those follow aliases without a bound,
drop the first of two equal keys silently, and the C one overflows its stack on deep nesting.
"""

from __future__ import annotations

import datetime
from collections.abc import Callable, Collection, Mapping
from pathlib import PurePath
from typing import Any

import numpy as np
import yaml
from yaml.constructor import SafeConstructor

from hypermap.core.errors import NOT_UTF8, FormatError, HypermapError
from hypermap.formats import limits
from hypermap.formats.letters import check_savable

_Loader: type[Any] = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_Dumper: type[Any] = getattr(yaml, "CSafeDumper", yaml.SafeDumper)

_construct = SafeConstructor()
_TAG = "tag:yaml.org,2002:"
_SCALARS: dict[str, Callable[[yaml.ScalarNode], Any]] = {
    f"{_TAG}null": lambda _: None,
    f"{_TAG}bool": _construct.construct_yaml_bool,
    f"{_TAG}int": _construct.construct_yaml_int,
    f"{_TAG}float": _construct.construct_yaml_float,
    f"{_TAG}binary": _construct.construct_yaml_binary,
    f"{_TAG}timestamp": _construct.construct_yaml_timestamp,
}
_TOO_DEEP = f"is nested more than {limits.MAX_YAML_DEPTH} deep"
_implicit: Any = yaml.resolver.Resolver()
_AS_TEXT = (f"{_TAG}str", f"{_TAG}merge", f"{_TAG}value")
_PLAIN_COLLECTIONS = (None, "!", f"{_TAG}seq", f"{_TAG}map")


def read_yaml(content: bytes, path: str, text_at: Collection[tuple[str, ...]] = ()) -> Any:
    """Return the content of a YAML file: dict, list, str, int, float, bool, None, bytes and dates.

    Args:
        content: the file.
        path: how messages name it.
        text_at: places whose scalars are text however they look, so that an object may have the
            name `no` or `12`. A place is the keys that lead there, with "*" for any element of a
            list.

    Raises:
        FormatError: If it is not YAML, has a key twice, or goes beyond the limits.

    >>> read_yaml(b"- {name: no, size: 12}", "objects", {("*", "name")})
    [{'name': 'no', 'size': 12}]
    """
    if len(content) > limits.MAX_YAML_BYTES:
        raise FormatError(f"is larger than {limits.MAX_YAML_BYTES} bytes", path=path)
    loader = _Loader(content)
    try:
        return _Reader(loader, path, frozenset(text_at)).document()
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        if isinstance(error, yaml.reader.ReaderError) and not _is_utf8(content):
            raise FormatError(NOT_UTF8, path=path) from None
        if mark is not None and "nesting depth" in str(error):  # libyaml from 0.2.6 on has a limit
            raise FormatError(_TOO_DEEP, path=path, key=f"line {mark.line + 1}") from error
        raise FormatError(f"is not valid YAML: {_one_line(error)}", path=path) from error
    except (ValueError, OverflowError) as error:
        raise FormatError(f"is not valid YAML: {error}", path=path) from error
    finally:
        loader.dispose()


def write_yaml(value: Any) -> bytes:
    """Return YAML that `read_yaml` turns into an equal value; mappings keep their order.

    Numpy's numbers and arrays, tuples and paths become plain YAML.

    Raises:
        TypeError: If a value is of a type that YAML does not have.
        HypermapError: If it is too large or nested too deeply to be read again, or a text holds
            half of a character.

    >>> print(write_yaml({"layers": [{"name": "no", "origin": (0.1, 2.0)}]}).decode(), end="")
    layers:
    - name: 'no'
      origin: [0.1, 2.0]
    """
    plain = plain_value(value)
    dumped = yaml.dump(
        plain,
        Dumper=_PlainDumper,
        default_flow_style=False,
        sort_keys=False,
        allow_unicode=True,
        width=2**31 - 1,
    )
    content = str(dumped).encode()
    if len(content) > limits.MAX_YAML_BYTES or count_values(plain) > limits.MAX_YAML_VALUES:
        raise HypermapError(f"{len(content)} bytes of YAML are too large to read back")
    return content


def plain_scalar(text: str) -> Any:
    """Return what a word or number means where it stands without quotes and tag.

    Raises:
        ValueError: If it looks like a value, but is none.

    >>> plain_scalar("no"), plain_scalar("010"), plain_scalar("0.5"), plain_scalar("a 1")
    (False, 8, 0.5, 'a 1')
    """
    tag: str = _implicit.resolve(yaml.ScalarNode, text, (True, False))
    return _scalar_value(text, tag)


def plain_value(value: Any, place: str = "the value", depth: int = 0) -> Any:
    """Return a value in the types that YAML has, sharing nothing that could change."""
    if depth > limits.MAX_YAML_DEPTH - 2:
        raise HypermapError(f"{place[:80]} is nested too deeply to be saved")
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {
            _plain_scalar(key, f"a key of {place}"): plain_value(
                item, f"{place}[{key!r}]", depth + 1
            )
            for key, item in value.items()
        }
    if isinstance(value, list | tuple):
        return [
            plain_value(item, f"{place}[{index}]", depth + 1) for index, item in enumerate(value)
        ]
    return _plain_scalar(value, place)


def count_values(plain: Any) -> int:
    """Return how many values a reader of such plain values would count."""
    if isinstance(plain, dict):
        return 1 + sum(map(count_values, plain.values()))
    return 1 + sum(map(count_values, plain)) if isinstance(plain, list) else 1


def _plain_scalar(value: Any, place: str) -> Any:
    if value is None or isinstance(value, bool | bytes | datetime.date):
        return value
    if isinstance(value, str):
        check_savable(value, place)
        return str.__str__(value)  # the text of an enumeration, not its name
    if isinstance(value, int):
        return int(value)
    if isinstance(value, float):
        return float(value)
    if isinstance(value, PurePath):
        return str(value)
    raise TypeError(f"{place} cannot be saved: YAML cannot store the type {type(value).__name__}")


class _PlainDumper(_Dumper):  # type: ignore[misc]  # which of two classes is known only here
    """Lists of scalars on one line, everything else in blocks, and no anchors."""

    def ignore_aliases(self, data: Any) -> bool:  # noqa: ARG002
        return True

    def represent_sequence(
        self, tag: str, sequence: Any, flow_style: bool | None = None
    ) -> yaml.SequenceNode:
        flat = not any(isinstance(item, list | dict) for item in sequence)
        node: yaml.SequenceNode = super().represent_sequence(tag, sequence, flat or flow_style)
        return node


_PlainDumper.add_representer(list, _PlainDumper.represent_list)


class _Reader:
    """Turns a stream of YAML events into values."""

    def __init__(self, loader: Any, path: str, text_at: frozenset[tuple[str, ...]]) -> None:
        self._loader = loader
        self._events = iter(loader.get_event, None)
        self._path = path
        self._text_at = text_at
        self._values = 0
        self._anchors: dict[str, tuple[Any, int]] = {}

    def document(self) -> Any:
        """Return the one document of the stream; None when it is empty."""
        value = None
        documents = 0
        for event in self._events:
            if isinstance(event, yaml.DocumentStartEvent):
                documents += 1
                if documents > 1:
                    raise self._error(event, "a second document begins; one is expected")
                value = self._value(next(self._events), ())
        return value

    def _value(self, event: Any, place: tuple[str, ...]) -> Any:
        before = self._values
        self._count(event, 1)
        if isinstance(event, yaml.AliasEvent):
            if event.anchor not in self._anchors:
                raise self._error(event, f"the alias *{event.anchor} has no finished anchor")
            value, size = self._anchors[event.anchor]
            self._count(event, size)
            return value
        if len(place) > limits.MAX_YAML_DEPTH:
            raise self._error(event, _TOO_DEEP)
        if isinstance(event, yaml.ScalarEvent):
            value = self._scalar(event, place in self._text_at)
        elif event.tag not in _PLAIN_COLLECTIONS:
            raise self._error(event, f"the tag {event.tag} is not allowed")
        elif isinstance(event, yaml.SequenceStartEvent):
            value = self._list((*place, "*"))
        else:
            value = self._mapping(place)
        if event.anchor is not None:
            self._anchors[event.anchor] = (value, self._values - before)
        return value

    def _list(self, place: tuple[str, ...]) -> list[Any]:
        values = []
        while not isinstance(event := next(self._events), yaml.SequenceEndEvent):
            values.append(self._value(event, place))
        return values

    def _mapping(self, place: tuple[str, ...]) -> dict[Any, Any]:
        values: dict[Any, Any] = {}
        while not isinstance(event := next(self._events), yaml.MappingEndEvent):
            if not isinstance(event, yaml.ScalarEvent):
                raise self._error(event, "a key must be a single word or number")
            key = self._scalar(event, as_text=False)
            if key in values:
                raise self._error(event, f"the key {key!r} appears twice")
            values[key] = self._value(next(self._events), (*place, str(key)))
        return values

    def _scalar(self, event: Any, as_text: bool) -> Any:
        tag = event.tag
        if tag is None and (as_text or not event.implicit[0]):  # in quotes
            return event.value
        if tag is None or tag == "!":
            tag = self._loader.resolve(yaml.ScalarNode, event.value, event.implicit)
        if as_text and tag in _SCALARS:
            return event.value
        if tag not in _AS_TEXT and tag not in _SCALARS:
            raise self._error(event, f"the tag {tag} is not allowed")
        try:
            return _scalar_value(event.value, tag)
        except ValueError as error:
            raise self._error(event, str(error)) from None

    def _count(self, event: Any, values: int) -> None:
        self._values += values
        if self._values > limits.MAX_YAML_VALUES:
            raise self._error(event, f"holds more than {limits.MAX_YAML_VALUES} values")

    def _error(self, event: Any, message: str) -> FormatError:
        return FormatError(message, path=self._path, key=f"line {event.start_mark.line + 1}")


def _scalar_value(text: str, tag: str) -> Any:
    """Return what a text of a known tag means."""
    if tag in _AS_TEXT:
        return text
    try:
        if tag == f"{_TAG}int" and len(text) > limits.MAX_INTEGER_LETTERS:
            raise ValueError("too long to write back")
        return _SCALARS[tag](yaml.ScalarNode(tag, text))
    except (ValueError, OverflowError, LookupError, AttributeError, yaml.YAMLError):
        raise ValueError(f"{text[:40]!r} is not a valid {tag.removeprefix(_TAG)}") from None


def _is_utf8(content: bytes) -> bool:
    try:
        content.decode()
    except UnicodeDecodeError:
        return False
    return True


def _one_line(error: yaml.YAMLError) -> str:
    mark = getattr(error, "problem_mark", None)
    problem = getattr(error, "problem", None) or " ".join(str(error).split())
    return f"{problem} (line {mark.line + 1})" if mark is not None else str(problem)
