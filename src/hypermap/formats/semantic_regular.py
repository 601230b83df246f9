"""Semantic YAML in its regular form, read straight into columns.

Nearly all files have it, since both ours and the first program write it: objects with known keys in
one order, a line for each, and plain words and numbers behind them. Read event by event, YAML
takes some ten times as long. What is not of this form, however little of it, is left to the
reader of all YAML, so that it alone says what YAML means; here stands only what cannot mean
anything else.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pydantic_core
from numpy.typing import NDArray

from hypermap.core.arrays import ObjectArray, as_objects
from hypermap.core.objects import MAX_ID, ObjectTable
from hypermap.core.shapes import can_be_footprints
from hypermap.formats import limits
from hypermap.formats.footprints import footprints_from_wkt
from hypermap.formats.ragged import as_tuples
from hypermap.formats.records import KNOWN_KEYS
from hypermap.formats.yaml_text import plain_scalar

_CHUNK = 1 << 18  # bytes; what is taken apart at a time should fit into the processor's cache

_ENTRY = re.compile(
    "- name: (.+)\n"
    "  shape: (.+)\n"
    r"(?:  tags: \[(.*)\]" + "\n)?"
    r"(?:  confidence: \[(.*)\]" + "\n)?"
    "(?:  existence: (.+)\n)?"
    "(?:  first_seen: (.+)\n)?"
    "(?:  last_seen: (.+)\n)?"
    "((?:  (?!id:)[a-z][a-z0-9_]{0,99}: .+\n)*)"
    "(?:  id: (0|[1-9][0-9]{0,9})\n)?"
)
_NAME, _SHAPE, _TAGS, _CONFIDENCE, _EXISTENCE, _FIRST_SEEN, _LAST_SEEN, _OTHERS, _ID = range(9)
_GROUPS = _ENTRY.groups + 1

_PLAIN = r"\w+(?:[ ./-]\w+)*"
_WORDS = re.compile(rf"{_PLAIN}|'(?:{_PLAIN})?'")
_WORD_LIST = re.compile(rf"(?:(?:{_WORDS.pattern})(?:, (?:{_WORDS.pattern}))*)?")
_ATTRIBUTE = re.compile(r"[+-]?\w+(?:[ ./+-]\w+)*")
_LETTERS = b"ABCDEFGHIJKLMNOPQRSTUVWXYZ(),-+0123456789.e \n"  # of well-known text
_NUMBERS = b"-+0123456789.eE, "


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
    except (_Irregular, ValueError, OverflowError):  # of texts that are no shapes or no UTF-8
        return None


def _chunks(content: bytes) -> Iterator[str]:
    """Yield whole entries, some at a time."""
    start = 0
    while start < len(content):
        end = content.find(b"\n- ", start + _CHUNK) + 1 or len(content)
        yield content[start:end].decode().removesuffix("\n") + "\n"
        start = end


class _Columns:
    """The objects read so far."""

    def __init__(self) -> None:
        self._vocabulary: dict[str, int] = {}
        self._codes: list[int] = []
        self._claims: list[str | None] = []
        self._footprints: list[ObjectArray] = []
        self._tags: list[tuple[str, ...]] = []
        self._confidence: list[tuple[float, ...]] = []
        self._numbers: dict[int, list[NDArray[np.float64]]] = {
            _EXISTENCE: [],
            _FIRST_SEEN: [],
            _LAST_SEEN: [],
        }
        self._attributes: list[dict[str, Any]] = []
        self._known_names: dict[str, int] = {}
        self._known_tags: dict[str | None, tuple[str, ...]] = {None: ()}
        self._count = 1  # the list itself

    def add(self, text: str) -> None:
        """Take the objects of some lines."""
        parts = _ENTRY.split(text)
        if any(parts[0::_GROUPS]):
            raise _Irregular
        groups = [parts[1 + group :: _GROUPS] for group in range(_ENTRY.groups)]
        if "\n".join(groups[_SHAPE]).encode().translate(None, _LETTERS):
            raise _Irregular
        tags = [self._known_tags.get(words) or self._words(words) for words in groups[_TAGS]]
        confidence = _number_lists(groups[_CONFIDENCE])
        self._count += len(tags) + text.count("\n")
        self._count += sum(map(len, tags)) + sum(map(len, confidence))
        if self._count > limits.MAX_YAML_VALUES:
            raise _Irregular
        known = self._known_names
        self._codes += [known[n] if n in known else self._code(n) for n in groups[_NAME]]
        self._footprints.append(footprints_from_wkt(groups[_SHAPE]))
        self._tags += tags
        self._confidence += confidence
        for group, column in self._numbers.items():
            column.append(_numbers(groups[group]))
        self._attributes += [_attributes(lines) if lines else {} for lines in groups[_OTHERS]]
        self._claims += groups[_ID]

    def table(self) -> ObjectTable:
        """Return all objects."""
        table = ObjectTable(
            ids=_ids(self._claims),
            codes=np.array(self._codes, dtype=np.int32),
            footprints=np.concatenate(self._footprints),
            tags=as_objects(self._tags),
            confidence=as_objects(self._confidence),
            existence=np.concatenate(self._numbers[_EXISTENCE]),
            first_seen=np.concatenate(self._numbers[_FIRST_SEEN]),
            last_seen=np.concatenate(self._numbers[_LAST_SEEN]),
            attributes=as_objects(self._attributes),
            vocabulary=self._vocabulary,
        )
        if not can_be_footprints(table.footprints).all():
            raise _Irregular
        return table

    def _code(self, text: str) -> int:
        """Return the code of a name that was not met before."""
        code = self._vocabulary.setdefault(_word(text), len(self._vocabulary))
        self._known_names[text] = code
        return code

    def _words(self, text: str | None) -> tuple[str, ...]:
        """Return the words of a list, as the same tuple for the same text."""
        words = self._known_tags.get(text)
        if words is None:
            if text is None or not _WORD_LIST.fullmatch(text):
                raise _Irregular
            words = tuple(_word(part) for part in text.split(", ")) if text else ()
            self._known_tags[text] = words
        return words


def _word(text: str) -> str:
    """Return what a name or tag says, which is text however it looks."""
    if not _WORDS.fullmatch(text):
        raise _Irregular
    return text.strip("'")


def _numbers(texts: Sequence[str | None]) -> NDArray[np.float64]:
    """Return the numbers, NaN where there is none."""
    there = [text for text in texts if text is not None]
    column = np.full(len(texts), np.nan)
    if there:
        values = _parsed(",".join(there), len(there))
        column[[text is not None for text in texts]] = values
    return column


def _number_lists(texts: Sequence[str | None]) -> list[tuple[float, ...]]:
    counts = [text.count(",") + 1 if text else 0 for text in texts]
    values: list[float] = _parsed(",".join(filter(None, texts)), sum(counts)).tolist()
    return as_tuples(values, counts)


def _parsed(text: str, count: int) -> NDArray[np.float64]:
    """Return numbers between commas; what JSON takes for a number of these letters, YAML does."""
    encoded = text.encode()
    if encoded.translate(None, _NUMBERS):
        raise _Irregular
    values = np.array(pydantic_core.from_json(b"[" + encoded + b"]"), dtype=np.float64)
    if len(values) != count or not np.isfinite(values).all():
        raise _Irregular
    return values


def _attributes(lines: str) -> dict[str, Any]:
    """Return keys of other programs, and their numbers and words."""
    attributes: dict[str, Any] = {}
    for line in lines[2:-1].split("\n  "):
        key, _, text = line.partition(": ")
        if key in KNOWN_KEYS or key in attributes or plain_scalar(key) != key:
            raise _Irregular
        attributes[key] = _word(text) if text.startswith("'") else _plain(text)
    return attributes


def _plain(text: str) -> Any:
    if not _ATTRIBUTE.fullmatch(text):
        raise _Irregular
    return plain_scalar(text)


def _ids(claims: Sequence[str | None]) -> NDArray[np.int64]:
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
