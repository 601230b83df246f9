"""Semantic layers as YAML text, written line by line where that gives the same result.

The general writer takes some ten times as long. It still writes each entry that holds more than
plain words and numbers, so that the whole reads as if it had written all.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from typing import Any

from hypermap.core.errors import HypermapError
from hypermap.core.objects import ObjectTable
from hypermap.core.semantic import Rejected
from hypermap.formats import limits
from hypermap.formats.columns.footprints import footprints_to_wkt
from hypermap.formats.semantic.records import KNOWN_KEYS, record_from_object
from hypermap.formats.yaml_text import count_values, plain_scalar, plain_value, write_yaml

_WORDS = re.compile(r"\w+(?:[ ./-]\w+)*", re.ASCII)
_MAX_KEY = 100  # letters; longer keys are written in another way


class TooLarge(HypermapError):
    """A layer is too large to be read back from YAML."""


class _Elaborate(Exception):
    """A value is not a plain word or number."""


def dump_table(table: ObjectTable, rejected: Iterable[Rejected] = ()) -> bytes:
    """Return a semantic YAML file that gives exactly the same objects again.

    Args:
        table: the objects.
        rejected: entries that could not be read, which go to the end.

    Raises:
        TypeError: If an attribute is of a type that YAML does not have.
        TooLarge: If it would be too large to read back.
        HypermapError: If something is nested too deeply to be read again.
    """
    writer = _Writer()
    shapes = footprints_to_wkt(table.footprints)
    names, ids = table.names.tolist(), table.ids.tolist()
    numbers = zip(
        table.existence.tolist(), table.first_seen.tolist(), table.last_seen.tolist(), strict=True
    )
    columns = zip(names, shapes, table.tags, table.confidence, table.attributes, strict=True)
    rejected = list(rejected)
    claimed = {_id_in(left_out.entry) for left_out in rejected}
    for row, (columns_of_row, known) in enumerate(zip(columns, numbers, strict=True)):
        # If a rejected entry claims the position, too, the object's id is written explicitly.
        number = None if ids[row] == row and row not in claimed else ids[row]
        try:
            writer.add_line_by_line(*columns_of_row, known, number)
        except _Elaborate:
            record = record_from_object(table.object(row))
            entry = {"name": record.pop("name"), "shape": shapes[row], **record}
            writer.add(entry if number is None else {**entry, "id": number})
    taken = set(ids)
    for left_out in rejected:
        entry = left_out.entry
        position = left_out.position
        if isinstance(entry, Mapping) and "id" not in entry and position not in taken:
            entry = dict(entry) if position == writer.entries else {**entry, "id": position}
        writer.add(entry)
    return writer.content()


class _Writer:
    """The entries written so far."""

    def __init__(self) -> None:
        self.entries = 0
        self._texts: list[str] = []
        self._values = 1  # the list itself
        self._words: dict[str, str] = {}
        self._keys: dict[Any, str] = {}

    def add(self, entry: Any) -> None:
        """Write an entry of any kind."""
        plain = plain_value(entry)
        self._values += count_values(plain)
        # A second entry makes it a list in blocks, whatever the first one is.
        self._texts.append(write_yaml([plain, {}]).decode().removesuffix("- {}\n"))
        self.entries += 1

    def add_line_by_line(
        self,
        name: str,
        shape: str,
        tags: tuple[str, ...],
        confidence: tuple[float, ...],
        attributes: Mapping[Any, Any],
        known: tuple[float, float, float],
        number: int | None,
    ) -> None:
        """Write an object.

        Args:
            name: of the object.
            shape: as well-known text.
            tags: of the object.
            confidence: of the object.
            attributes: of the object.
            known: existence and when it was seen first and last; NaN where not known.
            number: its id, if that differs from its position.

        Raises:
            _Elaborate: If something is more than a plain word or number; nothing is written then.
        """
        text = f"- name: {self._word(name)}\n  shape: {shape}\n"
        values = 3 + len(tags) + len(confidence)
        if tags:
            text += f"  tags: [{', '.join(map(self._word, tags))}]\n"
        if confidence:
            text += f"  confidence: [{', '.join(map(_number, confidence))}]\n"
        for key, value in zip(("existence", "first_seen", "last_seen"), known, strict=True):
            if value == value:  # not NaN
                text += f"  {key}: {_number(value)}\n"
                values += 1
        for key, value in attributes.items():
            text += f"  {self._key(key)}: {self._scalar(value)}\n"
        if number is not None:
            text += f"  id: {number}\n"
        self._values += (
            values + bool(tags) + bool(confidence) + len(attributes) + (number is not None)
        )
        self._texts.append(text)
        self.entries += 1

    def content(self) -> bytes:
        """Return all entries as a file.

        Raises:
            TooLarge: If it would be too large to read back.
        """
        content = ("".join(self._texts) or "[]\n").encode()
        if len(content) > limits.MAX_YAML_BYTES or self._values > limits.MAX_YAML_VALUES:
            raise TooLarge(
                f"{len(content)} bytes of YAML are too large to read back; save the semantic "
                "layers as GeoParquet (pip install 'hypermap[parquet]')"
            )
        return content

    def _word(self, text: str) -> str:
        """Return a text, quoted if it would otherwise mean something else."""
        written = self._words.get(text)
        if written is None:
            if type(text) is not str or not _WORDS.fullmatch(text):
                raise _Elaborate
            written = self._words[text] = text if _is_text(text) else f"'{text}'"
        return written

    def _key(self, key: Any) -> str:
        written = self._keys.get(key) if type(key) is str else None
        if written is None:
            if type(key) is not str or key in KNOWN_KEYS or len(key) > _MAX_KEY:
                raise _Elaborate
            written = self._keys[key] = self._word(key)
        return written

    def _scalar(self, value: Any) -> str:
        return self._word(value) if type(value) is str else _number(value)


def _id_in(entry: Any) -> Any:
    claim = entry.get("id") if isinstance(entry, Mapping) else None
    return claim if type(claim) is int else None


def _number(value: Any) -> str:
    if type(value) is int:
        return repr(value)
    if type(value) is not float or not math.isfinite(value):
        raise _Elaborate
    text = repr(value)
    # YAML 1.1 has no exponent without a decimal point.
    return text if "." in text else text.replace("e", ".0e")


def _is_text(word: str) -> bool:
    try:
        return bool(plain_scalar(word) == word)
    except ValueError:  # looks like a date, but is none
        return False
