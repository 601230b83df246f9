"""A fast reader for semantic YAML in its regular form, straight into columns.

Nearly all files have it, since both ours and the first program write it: objects with known keys in
one order, a line for each, with plain words and numbers. Reading YAML event by event takes
about ten times as long. If any part of a file is not in this form, the general reader reads it
all, so that only one reader defines what YAML means; this one accepts only what is unambiguous.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import ObjectArray, as_objects
from hypermap.core.objects import MAX_ID, ObjectTable
from hypermap.core.shapes import can_be_footprints
from hypermap.formats import limits
from hypermap.formats.columns.footprints import footprint_from_wkt
from hypermap.formats.columns.numbers import numbers_from_json
from hypermap.formats.columns.outlines import outlines_from_wkt
from hypermap.formats.columns.ragged import as_tuples
from hypermap.formats.semantic.records import KNOWN_KEYS
from hypermap.formats.yaml_text import plain_scalar

_CHUNK = 1 << 18  # bytes; each chunk should fit into the processor's cache

_ENTRY = re.compile(
    b"(?m:^)- name: (.+)\n"  # of a line alone: many in one would be tried to its end each
    b"  shape: (.+)\n"
    rb"(?:  tags: \[(.*)\]" + b"\n)?"
    rb"(?:  confidence: \[(.*)\]" + b"\n)?"
    b"(?:  existence: (.+)\n)?"
    b"(?:  first_seen: (.+)\n)?"
    b"(?:  last_seen: (.+)\n)?"
    b"((?:  (?!id:)[a-z][a-z0-9_]{0,99}: .+\n)*)"
    b"(?:  id: (0|[1-9][0-9]{0,9})\n)?"
)
_GROUPS = _ENTRY.groups + 1

_PLAIN = r"\w+(?:[ ./-]\w+)*"
_WORDS = re.compile(rf"{_PLAIN}|'(?:{_PLAIN})?'")
_WORD_LIST = re.compile(rf"(?:(?:{_WORDS.pattern})(?:, (?:{_WORDS.pattern}))*)?")
_ATTRIBUTE = re.compile(r"[+-]?\w+(?:[ ./+-]\w+)*")
_LETTERS = b"ABCDEFGHIJKLMNOPQRSTUVWXYZ(),-+0123456789.e \n"  # of well-known text
_NUMBERS = b"-+0123456789.eE, "

_Text: TypeAlias = bytes | None
T = TypeVar("T")


class _Irregular(Exception):
    """The file is not of the regular form."""


def read_regular(content: bytes) -> ObjectTable | None:
    """Return the objects of a semantic YAML file of the regular form; None for all others.

    A file is left to the other reader as well where an object of it cannot be read, or claims an
    id that is another's.
    """
    if len(content) > limits.MAX_YAML_BYTES or not content.startswith(b"- name: "):
        return None
    columns = _Columns()
    try:
        for chunk in _chunks(content):
            columns.add(chunk)
        return columns.table()
    except (_Irregular, ValueError, OverflowError):  # of texts that are not shapes or not UTF-8
        return None


def _chunks(content: bytes) -> Iterator[bytes]:
    """Yield chunks of whole entries."""
    start = 0
    while start < len(content):
        end = content.find(b"\n- ", start + _CHUNK) + 1 or len(content)
        chunk = content[start:end]
        yield chunk if chunk.endswith(b"\n") else chunk + b"\n"
        start = end


class _Known(dict[_Text, T]):
    """The values of texts; each distinct text is parsed once."""

    def __init__(self, meaning: Callable[[_Text], T]) -> None:
        self._meaning = meaning

    def __missing__(self, text: _Text) -> T:
        value = self[text] = self._meaning(text)
        return value

    def all(self, texts: Iterable[_Text]) -> Iterator[T]:
        """Return the value of each text."""
        return map(self.__getitem__, texts)


class _Columns:
    """The objects read so far."""

    def __init__(self) -> None:
        self._vocabulary: dict[str, int] = {}
        self._codes: list[int] = []
        self._claims: list[_Text] = []
        self._footprints: list[ObjectArray] = []
        self._tags: list[tuple[str, ...]] = []
        self._confidence: list[tuple[float, ...]] = []
        self._stamps: tuple[list[NDArray[np.float64]], ...] = ([], [], [])
        self._attributes: list[dict[str, Any]] = []
        self._known_names = _Known(partial(_code, self._vocabulary))
        self._known_tags = _Known(_words)
        self._count = 1  # the list itself

    def add(self, chunk: bytes) -> None:
        """Add the objects of a chunk."""
        parts = _ENTRY.split(chunk)
        if any(parts[0::_GROUPS]):
            raise _Irregular
        groups: list[list[Any]] = [parts[1 + group :: _GROUPS] for group in range(_GROUPS - 1)]
        names, shapes, tag_lists, confidence_lists, *stamps, others, claims = groups
        tags = list(self._known_tags.all(tag_lists))
        confidence = _number_lists(confidence_lists)
        lines = np.count_nonzero(np.frombuffer(chunk, np.uint8) == ord("\n"))
        self._count += len(tags) + int(lines) + sum(map(len, tags)) + sum(map(len, confidence))
        if self._count > limits.MAX_YAML_VALUES:
            raise _Irregular
        self._codes += self._known_names.all(names)
        self._footprints.append(_footprints(shapes))
        self._tags += tags
        self._confidence += confidence
        for column, texts in zip(self._stamps, stamps, strict=True):
            column.append(_numbers(texts))
        self._attributes += [_attributes(lines) if lines else {} for lines in others]
        self._claims += claims

    def table(self) -> ObjectTable:
        """Return all objects."""
        existence, first_seen, last_seen = map(np.concatenate, self._stamps)
        return ObjectTable(
            ids=_ids(self._claims),
            codes=np.array(self._codes, dtype=np.int32),
            footprints=np.concatenate(self._footprints),
            tags=as_objects(self._tags),
            confidence=as_objects(self._confidence),
            existence=existence,
            first_seen=first_seen,
            last_seen=last_seen,
            attributes=as_objects(self._attributes),
            vocabulary=self._vocabulary,
        )


def _code(vocabulary: dict[str, int], text: _Text) -> int:
    """Return the number of a name, which the vocabulary gets if it is new."""
    return vocabulary.setdefault(_word((text or b"").decode()), len(vocabulary))


def _words(text: _Text) -> tuple[str, ...]:
    """Return the words of a list."""
    words = (text or b"").decode()
    if not _WORD_LIST.fullmatch(words):
        raise _Irregular
    return tuple(map(_word, words.split(", "))) if words else ()


def _word(text: str) -> str:
    """Return a name or tag, which is text even if it looks like a number."""
    if not _WORDS.fullmatch(text):
        raise _Irregular
    return text.strip("'")


def _footprints(texts: Sequence[bytes]) -> ObjectArray:
    lines = b"\n".join(texts)
    outlines = outlines_from_wkt(lines)
    if outlines is not None:
        return outlines
    if lines.translate(None, _LETTERS):
        raise _Irregular
    footprints = as_objects(footprint_from_wkt(text.decode()) for text in texts)
    if not can_be_footprints(footprints).all():
        raise _Irregular
    return footprints


def _numbers(texts: Sequence[_Text]) -> NDArray[np.float64]:
    """Return the numbers, NaN for missing ones."""
    there = [text for text in texts if text is not None]
    values = _parsed(b",".join(there), len(there))
    if len(there) == len(texts):
        return values
    column = np.full(len(texts), np.nan)
    column[[text is not None for text in texts]] = values
    return column


def _number_lists(texts: Sequence[_Text]) -> list[tuple[float, ...]]:
    counts = [text.count(b",") + 1 if text else 0 for text in texts]
    values: list[float] = _parsed(b",".join(filter(None, texts)), sum(counts)).tolist()
    return as_tuples(values, counts)


def _parsed(text: bytes, count: int) -> NDArray[np.float64]:
    """Return numbers between commas; for these letters, JSON and YAML agree on what is a number."""
    if text.translate(None, _NUMBERS):
        raise _Irregular
    values = numbers_from_json(text)
    if len(values) != count or not np.isfinite(values).all():
        raise _Irregular
    return values


def _attributes(lines: bytes) -> dict[str, Any]:
    """Return free attributes: their keys, numbers and words."""
    attributes: dict[str, Any] = {}
    for line in lines[2:-1].decode().split("\n  "):
        key, _, text = line.partition(": ")
        if key in KNOWN_KEYS or key in attributes or plain_scalar(key) != key:
            raise _Irregular
        attributes[key] = _word(text) if text.startswith("'") else _plain(text)
    return attributes


def _plain(text: str) -> Any:
    if not _ATTRIBUTE.fullmatch(text):
        raise _Irregular
    return plain_scalar(text)


def _ids(claims: Sequence[_Text]) -> NDArray[np.int64]:
    """Return the ids: where no key claims one, the position, or the next free number."""
    positions = np.arange(len(claims))
    if not any(claims):
        return positions
    named = np.array([-1 if claim is None else int(claim) for claim in claims], dtype=np.int64)
    claimed = np.sort(named[named >= 0])
    if (claimed[1:] == claimed[:-1]).any() or claimed[-1] > MAX_ID:
        raise _Irregular
    ids = np.where(named >= 0, named, positions)
    pushed_out = np.flatnonzero((named < 0) & np.isin(positions, claimed))
    taken = set(claimed.tolist())
    free = (number for number in itertools.count(len(claims)) if number not in taken)
    ids[pushed_out] = list(itertools.islice(free, len(pushed_out)))
    return ids
