"""Semantic layers as GeoParquet: one row per object, readable by GeoPandas, QGIS and DuckDB.

The specification is docs/formats/semantic.md. Attributes that are numbers, truth values or texts in
all objects that have them get columns of their own; the others stand as JSON in one.
"""

from __future__ import annotations

import itertools
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pydantic_core
from numpy.typing import NDArray

from hypermap.core.arrays import ObjectArray, as_objects
from hypermap.core.errors import FormatError
from hypermap.core.objects import ObjectTable
from hypermap.core.semantic import Rejected, SemanticLayer
from hypermap.formats.checked import Checked, check
from hypermap.formats.columns.arrow import Column, Lists, Numbers, Words, kinds_of
from hypermap.formats.columns.crs import check_meters, frame_of
from hypermap.formats.columns.geoparquet import (
    GEOMETRY,
    GeoParquet,
    read_geoparquet,
    system_of,
    write_geoparquet,
)
from hypermap.formats.columns.ragged import as_tuples
from hypermap.formats.semantic.records import KNOWN_KEYS, is_json
from hypermap.formats.yaml_text import plain_value, read_yaml, write_yaml

NOTES = "hypermap"
"""The key of the file's metadata for entries that could not be read."""

_OWN_COLUMNS = KNOWN_KEYS | {GEOMETRY}
_STAMPS = ("existence", "first_seen", "last_seen")
_ATTRIBUTE = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,99}")
_MOST_ATTRIBUTES = 100  # columns; further attributes are stored as JSON
_INT64 = range(-(2**63), 2**63)


class _Rejected(Checked):
    position: int
    name: str
    reason: str


def dump_parquet(table: ObjectTable, frame_id: str, rejected: Iterable[Rejected] = ()) -> bytes:
    """Return a GeoParquet file; `parse_parquet` gives exactly the same objects again.

    Raises:
        MissingExtra: If pyarrow is not installed.
        TypeError: If an attribute is of a type that YAML does not have.
        HypermapError: If it is too large to read back.
    """
    everywhere = np.ones(len(table), dtype=bool)
    columns: dict[str, Column] = {
        "id": Numbers(table.ids, everywhere),
        "name": Words(table.codes, list(table.vocabulary)),
        "tags": _lists(table.tags, _words),
        "confidence": _lists(table.confidence, _floats),
    }
    for key in _STAMPS:
        values = getattr(table, key)
        columns[key] = Numbers(values, ~np.isnan(values))
    columns.update(_attribute_columns(table.attributes))
    return write_geoparquet(columns, table.footprints, frame_id, {NOTES: _notes(rejected)})


def parse_parquet(content: bytes, path: str) -> tuple[ObjectTable, list[Rejected]]:
    """Return the objects of a GeoParquet file, and the entries that could not be read.

    Columns that are not ours become attributes. Where there is no `id`, it is the row.

    Args:
        content: the file.
        path: how messages name it.

    Raises:
        MissingExtra: If pyarrow is not installed.
        FormatError: If it is damaged, a column or value is none of an object, or coordinates are
            not meters in a frame.
    """
    file = read_geoparquet(content, path)
    check_meters(system_of(file.notes), path, GEOMETRY)
    return _objects(file, path)


def layer_of_parquet(content: bytes, path: str, frame_id: str | None) -> SemanticLayer:
    """Return the objects of a GeoParquet file that stands alone as a layer.

    Args:
        content: the file.
        path: how messages name it.
        frame_id: the frame of its coordinates; None takes that which the file names.

    Raises:
        MissingExtra, FormatError: As `parse_parquet`, and if no frame is named.
    """
    file = read_geoparquet(content, path)
    frame = frame_of(system_of(file.notes), frame_id, path, f"{GEOMETRY}: crs")
    table, rejected = _objects(file, path)
    return SemanticLayer.of_table("semantic", frame, table, rejected=rejected)


def _objects(file: GeoParquet, path: str) -> tuple[ObjectTable, list[Rejected]]:
    columns, count = file.columns, len(file.footprints)
    names = _column(columns, "name", Words, path)
    if names is None:
        raise FormatError("is missing", path=path, key="name")
    if (names.codes < 0).any():
        row = np.flatnonzero(names.codes < 0)[0]
        raise FormatError(f"is missing in row {row}", path=path, key="name")
    vocabulary: dict[str, int] = {}
    codes = [vocabulary.setdefault(name, len(vocabulary)) for name in names.vocabulary]
    table = ObjectTable(
        ids=_ids(_column(columns, "id", Numbers, path), count, path),
        codes=np.array(codes, dtype=np.int32)[names.codes],
        footprints=file.footprints,
        tags=_tags(_column(columns, "tags", Lists, path), count, path),
        confidence=_confidence(_column(columns, "confidence", Lists, path), count, path),
        existence=_numbers(_column(columns, "existence", Numbers, path), count),
        first_seen=_numbers(_column(columns, "first_seen", Numbers, path), count),
        last_seen=_numbers(_column(columns, "last_seen", Numbers, path), count),
        attributes=_attributes(columns, count, path),
        vocabulary=vocabulary,
    )
    try:
        table.check(footprints=False)  # which were looked at
    except (ValueError, TypeError) as error:
        raise FormatError(str(error), path=path) from None
    return table, _rejected(file.notes.get(NOTES), path)


# Objects into columns


def _lists(rows: ObjectArray, items: Any) -> Lists:
    offsets = np.append(0, np.cumsum([len(row) for row in rows], dtype=np.int64))
    return Lists(offsets, items([item for row in rows for item in row]))


def _words(texts: Sequence[str | None]) -> Words:
    """Return texts as codes; -1 for None."""
    known: dict[str, int] = {}
    codes = [-1 if text is None else known.setdefault(text, len(known)) for text in texts]
    return Words(np.array(codes, dtype=np.int32), list(known))


def _floats(values: Sequence[float]) -> Numbers:
    return Numbers(np.array(values, dtype=np.float64), np.ones(len(values), dtype=bool))


def _attribute_columns(attributes: ObjectArray) -> dict[str, Column]:
    kinds: dict[Any, type] = {}
    for mapping in attributes:
        for key, value in mapping.items():
            if kinds.setdefault(key, type(value)) is not type(value):
                kinds[key] = object
    columns: dict[str, Column] = {}
    for key, kind in kinds.items():
        if not isinstance(key, str) or key in _OWN_COLUMNS or not _ATTRIBUTE.fullmatch(key):
            continue
        values = [mapping.get(key) for mapping in attributes]
        column = _attribute_column(values, kind)
        if column is not None and len(columns) < _MOST_ATTRIBUTES:
            columns[key] = column
    rest = [
        {key: value for key, value in mapping.items() if key not in columns} if mapping else {}
        for mapping in attributes
    ]
    if any(rest):
        columns["attributes"] = _words(
            [attributes_as_text(mapping) if mapping else None for mapping in rest]
        )
    return columns


def _attribute_column(values: list[Any], kind: type) -> Column | None:
    """Return values as a column if they have one type, with None for missing ones."""
    there = np.array([value is not None for value in values], dtype=bool)
    if kind is str:
        return _words(values)
    if kind is float:
        return Numbers(np.array([v if v is not None else 0 for v in values], np.float64), there)
    if kind is bool:
        return Numbers(np.array([bool(value) for value in values]), there)
    if kind is int and all(value in _INT64 for value in values if value is not None):
        return Numbers(np.array([v or 0 for v in values], np.int64), there)
    return None


def attributes_as_text(attributes: Mapping[Any, Any]) -> str:
    """Return attributes as JSON, or as YAML if JSON cannot represent them."""
    plain = plain_value(attributes)
    if is_json(plain):
        return json.dumps(plain, ensure_ascii=False)
    return write_yaml(plain).decode()


def _notes(rejected: Iterable[Rejected]) -> str:
    entries = [
        {"position": r.position, "name": r.name, "reason": r.reason, "entry": r.entry}
        for r in rejected
    ]
    return write_yaml({"version": 1, "rejected": entries}).decode()


# Columns into objects


def _column(columns: Mapping[str, Column], name: str, kind: type, path: str) -> Any:
    """Return a column of a kind; None if it is missing or empty."""
    column = columns.get(name)
    if isinstance(column, Words) and kind is not Words and not column.vocabulary:
        return None
    if column is not None and not isinstance(column, kind):
        expected = {Words: "texts", Numbers: "numbers", Lists: "lists"}[kind]
        raise FormatError(f"expected {expected}", path=path, key=name)
    return column


def _ids(column: Numbers | None, count: int, path: str) -> NDArray[np.int64]:
    if column is None:
        return np.arange(count)
    if column.values.dtype != np.int64 or not column.there.all():
        raise FormatError("expected a whole number in each row", path=path, key="id")
    ids: NDArray[np.int64] = column.values
    return ids


def _numbers(column: Numbers | None, count: int) -> NDArray[np.float64]:
    if column is None:
        return np.full(count, np.nan)
    return np.where(column.there, column.values.astype(np.float64), np.nan)


def _tags(column: Lists | None, count: int, path: str) -> ObjectArray:
    if column is None:
        return as_objects([()] * count)
    items = column.items
    if not isinstance(items, Words) or (items.codes < 0).any():
        raise FormatError("expected lists of texts", path=path, key="tags")
    kinds, rows = kinds_of(column)
    starts, ends = column.offsets[rows].tolist(), column.offsets[rows + 1].tolist()
    words = as_objects(items.vocabulary)
    lists = as_objects(
        tuple(words[items.codes[start:end]]) for start, end in zip(starts, ends, strict=True)
    )
    return lists[kinds]  # equal ones are the same


def _confidence(column: Lists | None, count: int, path: str) -> ObjectArray:
    if column is None or column.offsets[-1] == 0:
        return as_objects([()] * count)
    items = column.items
    if not isinstance(items, Numbers) or not items.there.all():
        raise FormatError("expected lists of numbers", path=path, key="confidence")
    values = items.values.astype(np.float64)
    if not np.isfinite(values).all():
        raise FormatError("must be finite", path=path, key="confidence")
    return as_objects(as_tuples(values.tolist(), column.lengths))


def _attributes(columns: Mapping[str, Column], count: int, path: str) -> ObjectArray:
    rows: list[dict[Any, Any]] = [{} for _ in range(count)]
    for name, column in columns.items():
        if name in _OWN_COLUMNS:
            continue
        if isinstance(column, Lists):
            items: list[Any] = [
                list(row) for row in as_tuples(_values(column.items), column.lengths)
            ]
            there = np.ones(count, dtype=bool)
        elif isinstance(column, Words):
            items, there = _values(column), column.codes >= 0
        else:
            items, there = column.values.tolist(), column.there
        for row, value in itertools.compress(zip(rows, items, strict=True), there.tolist()):
            row[name] = value
    rest = _column(columns, "attributes", Words, path)
    if rest is not None:
        for number in np.flatnonzero(rest.codes >= 0).tolist():
            rows[number].update(attributes_of_text(rest.vocabulary[rest.codes[number]], path))
    return as_objects(rows)


def _values(column: Words | Numbers) -> list[Any]:
    if isinstance(column, Words):
        return [column.vocabulary[c] if c >= 0 else None for c in column.codes.tolist()]
    return [v if t else None for v, t in zip(column.values.tolist(), column.there, strict=True)]


def attributes_of_text(text: str, path: str) -> dict[Any, Any]:
    """Return the attributes in a text of `attributes_as_text`.

    Raises:
        FormatError: If it has none.
    """
    if text.startswith("{"):
        try:
            attributes = pydantic_core.from_json(text, allow_inf_nan=False)
        except ValueError as error:
            raise FormatError(f"is not JSON: {error}", path=path, key="attributes") from None
    else:
        attributes = read_yaml(text.encode(), f"{path}: attributes")
    if not isinstance(attributes, dict):
        raise FormatError("expected keys and values", path=path, key="attributes")
    return attributes


def _rejected(notes: str | None, path: str) -> list[Rejected]:
    if notes is None:
        return []
    document = read_yaml(notes.encode(), f"{path}: {NOTES}")
    entries = document.get("rejected") if isinstance(document, dict) else None
    if not isinstance(entries, list):
        raise FormatError("expected a list of entries", path=path, key=NOTES)
    rejected = []
    for raw in entries:
        known = check(_Rejected, raw, path, NOTES)
        rejected.append(Rejected(known.position, known.name, known.reason, raw.get("entry")))
    return rejected
