"""Columns of values beside polygons as GeoParquet; the only module that imports pyarrow.

GeoParquet (version 1.1, geometries as WKB) is what GeoPandas, QGIS, GDAL and DuckDB read. The same
columns give the same bytes each time.
"""

from __future__ import annotations

import contextlib
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray

from hypermap.core.arrays import BoolArray, ObjectArray, as_objects
from hypermap.core.errors import FormatError, HypermapError, MissingExtra
from hypermap.core.shapes import can_be_footprints, check_footprint
from hypermap.formats import limits
from hypermap.formats.footprints import footprints_from_wkb
from hypermap.formats.outlines import outlines_from_wkb

if TYPE_CHECKING:
    import pyarrow

MAGIC = b"PAR1"
GEOMETRY = "geometry"
_ROW_GROUP = 1 << 17  # rows; they are read one group after the other
_WIDTH = 8  # bytes, of numbers
_AT_ONCE = 4096  # footprints, which should fit into the processor's cache
_ENCODINGS = {"PLAIN", "RLE", "BIT_PACKED", "RLE_DICTIONARY", "PLAIN_DICTIONARY"}


@dataclass(frozen=True, eq=False)
class Words:
    """Texts, of which many are the same.

    Attributes:
        codes: each one's place in the vocabulary, int32, shape (N,); -1 where there is none.
        vocabulary: the texts.
    """

    codes: NDArray[np.int32]
    vocabulary: Sequence[str]


@dataclass(frozen=True, eq=False)
class Numbers:
    """Numbers or truth values.

    Attributes:
        values: float64, int64 or bool, shape (N,).
        there: whether there is one, shape (N,).
    """

    values: NDArray[Any]
    there: BoolArray


@dataclass(frozen=True, eq=False)
class Lists:
    """A list for each row.

    Attributes:
        offsets: where each list begins among the items, and where the last one ends, shape (N+1,).
        items: of all lists.
    """

    offsets: NDArray[np.int64]
    items: Words | Numbers

    @property
    def lengths(self) -> list[int]:
        """How many items each list has."""
        lengths: list[int] = np.diff(self.offsets).tolist()
        return lengths


Column: TypeAlias = Words | Numbers | Lists


def kinds_of(lists: Lists) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Return which lists of words or numbers are the same.

    Returns:
        The kind of each list, from 0, shape (N,), and a list of each kind, shape (K,).

    Raises:
        MissingExtra: If pyarrow is not installed.
    """
    pa, _ = _pyarrow()
    items = lists.items.codes if isinstance(lists.items, Words) else lists.items.values
    bounds = lists.offsets * items.itemsize
    buffers = [None, pa.py_buffer(bounds), pa.py_buffer(np.ascontiguousarray(items))]
    rows = pa.Array.from_buffers(pa.large_binary(), len(bounds) - 1, buffers)
    kinds = rows.dictionary_encode().indices.to_numpy()
    firsts = np.empty(kinds.max(initial=-1) + 1, dtype=np.int64)
    firsts[kinds] = np.arange(len(kinds))
    return kinds, firsts


def has_pyarrow() -> bool:
    """Return whether GeoParquet can be written and read."""
    try:
        import pyarrow  # noqa: F401
    except ImportError:
        return False
    return True


def write_geoparquet(
    columns: Mapping[str, Column], footprints: ObjectArray, frame_id: str, notes: Mapping[str, str]
) -> bytes:
    """Return a GeoParquet file.

    Args:
        columns: by name, in the order of the file.
        footprints: polygons and multipolygons, shape (N,); the column `geometry`.
        frame_id: the frame of their coordinates [m].
        notes: texts that go with the file.

    Raises:
        MissingExtra: If pyarrow is not installed.
        HypermapError: If it is too large to be read again.
    """
    pa, parquet = _pyarrow()
    arrays = {name: _to_arrow(pa, column) for name, column in columns.items()}
    arrays[GEOMETRY] = pa.array(shapely.to_wkb(footprints), pa.binary())
    metadata = {"geo": json.dumps(_geo(footprints, frame_id)), **notes}
    table = pa.table(arrays).replace_schema_metadata(metadata)
    unpacked = _WIDTH * sum(_most_values(column) for column in [*columns.values(), footprints])
    if len(table) > limits.MAX_ROWS or max(unpacked, table.nbytes) > limits.MAX_TABLE_BYTES:
        raise HypermapError(f"{len(table)} objects are too many to be read again")
    sink = pa.BufferOutputStream()
    parquet.write_table(
        table,
        sink,
        row_group_size=_ROW_GROUP,
        compression="zstd",
        use_dictionary=[_leaf(name, c) for name, c in columns.items() if _words_in(c) is not None],
    )
    return bytes(sink.getvalue())


@dataclass(frozen=True, eq=False)
class GeoParquet:
    """What a file holds.

    Attributes:
        columns: all but the geometry.
        footprints: geometries that objects can have, shape (N,).
        notes: texts that go with it.
    """

    columns: dict[str, Column]
    footprints: ObjectArray
    notes: dict[str, str]


def read_geoparquet(content: bytes, path: str) -> GeoParquet:
    """Return what a GeoParquet file holds.

    Args:
        content: the file.
        path: how messages name it.

    Raises:
        MissingExtra: If pyarrow is not installed.
        FormatError: If it is damaged, goes beyond the limits, has a geometry that no object can
            have, or a column that is no plain one of texts, numbers or lists of such.
    """
    pa, parquet = _pyarrow()
    try:
        leaves = _leaves(_metadata(parquet, content, path), path)
        has_plain_shapes = not any("DICT" in e for e in leaves[GEOMETRY].encodings)
        texts = [name for name, leaf in leaves.items() if leaf.kind == "BYTE_ARRAY"]
        in_words = [t for t in texts if t != GEOMETRY or not has_plain_shapes]
        file = parquet.ParquetFile(pa.BufferReader(content), read_dictionary=in_words)
        groups = range(file.num_row_groups)  # one by one: Arrow cannot join lists of words itself
        parts = [file.read_row_group(group, use_threads=False) for group in groups]
        table = pa.concat_tables(parts or [file.read(use_threads=False)])
        table.validate(full=True)
        footprints = _footprints(pa, table, path)
        columns = {
            name: _from_arrow(pa, table[name], name, path)
            for name in table.column_names
            if name != GEOMETRY
        }
        raw = file.schema_arrow.metadata or {}
        notes = {key.decode(): value.decode() for key, value in raw.items()}
    except (pa.ArrowException, OSError, ValueError, TypeError) as error:
        reason = " ".join(str(error).split())
        raise FormatError(f"is not an intact Parquet file: {reason}", path=path) from None
    del table
    pa.default_memory_pool().release_unused()
    return GeoParquet(columns, footprints, notes)


def _pyarrow() -> tuple[Any, Any]:
    try:
        import pyarrow
        import pyarrow.compute
        import pyarrow.parquet
    except ImportError:
        raise MissingExtra("a semantic layer as GeoParquet", "parquet") from None
    return pyarrow, pyarrow.parquet


def _geo(footprints: ObjectArray, frame_id: str) -> dict[str, Any]:
    """Return the file's metadata by the specification of GeoParquet 1.1."""
    kinds = np.unique(shapely.get_type_id(footprints)).tolist()
    names = {3: "Polygon", 6: "MultiPolygon"}
    column: dict[str, Any] = {
        "encoding": "WKB",
        "geometry_types": [names[kind] for kind in kinds],
        "crs": _engineering_crs(frame_id),
        "edges": "planar",
    }
    if len(footprints):
        column["bbox"] = shapely.total_bounds(footprints).tolist()
    return {"version": "1.1.0", "primary_column": GEOMETRY, "columns": {GEOMETRY: column}}


def _engineering_crs(frame_id: str) -> dict[str, Any]:
    """Return a coordinate reference system of metres in a frame, as PROJJSON."""
    axes = [
        {"name": axis, "abbreviation": axis, "direction": "unspecified", "unit": "metre"}
        for axis in "xy"
    ]
    return {
        "$schema": "https://proj.org/schemas/v0.7/projjson.schema.json",
        "type": "EngineeringCRS",
        "name": frame_id,
        "datum": {"name": frame_id},
        "coordinate_system": {"subtype": "Cartesian", "axis": axes},
    }


class _Sealed(Exception):
    """Something was read that should not be."""


class _Sealable(io.BytesIO):
    """A file of which no more is read from some time on."""

    is_sealed = False

    def read(self, size: int | None = -1) -> bytes:
        if self.is_sealed:
            raise _Sealed
        return super().read(size)


def _metadata(parquet: Any, content: bytes, path: str) -> Any:
    """Return how a file describes itself, after Arrow has looked at that.

    What is wrong with a chunk's description is an error when Arrow is about to read the chunk, but
    ends the program when it is asked about it first. So it is told to read what it does not get.
    """
    source = _Sealable(content)
    file = parquet.ParquetFile(source, buffer_size=1)
    metadata = file.metadata
    if metadata.num_rows > limits.MAX_ROWS or metadata.num_columns > limits.MAX_COLUMNS:
        raise FormatError(
            f"has {metadata.num_rows} rows and {metadata.num_columns} columns, more than the "
            f"{limits.MAX_ROWS} and {limits.MAX_COLUMNS} that are allowed",
            path=path,
        )
    source.is_sealed = True
    for group in range(file.num_row_groups):
        with contextlib.suppress(_Sealed):
            file.read_row_group(group, use_threads=False)
    return metadata


@dataclass
class _Leaf:
    """A column of plain values, as the file describes it.

    Attributes:
        kind: the physical type.
        width: bytes of a value; of texts, those of its place among the words.
        encodings: of its chunks.
    """

    kind: str
    width: int
    encodings: set[str]


def _leaves(metadata: Any, path: str) -> dict[str, _Leaf]:
    """Return the leaf columns by their paths, of a file within the limits."""
    leaves: dict[str, _Leaf] = {}
    for column in range(metadata.num_columns):
        described = metadata.schema.column(column)
        kind = described.physical_type
        width = described.length if kind == "FIXED_LEN_BYTE_ARRAY" else _WIDTH
        if described.path in leaves:
            raise FormatError("is there twice", path=path, key=described.path)
        leaves[described.path] = _Leaf(kind, width, set())
    groups = [metadata.row_group(i) for i in range(metadata.num_row_groups)]
    unpacked = 0  # bytes; of values that are all the same, the file itself holds next to nothing
    for group in groups:
        for chunk, leaf in zip(
            map(group.column, range(group.num_columns)), leaves.values(), strict=False
        ):
            leaf.encodings.update(chunk.encodings)
            unpacked += max(0, chunk.num_values) * leaf.width
    if max(unpacked, sum(group.total_byte_size for group in groups)) > limits.MAX_TABLE_BYTES:
        raise FormatError(f"unpacks to more than {limits.MAX_TABLE_BYTES} bytes", path=path)
    for name, leaf in leaves.items():
        for unusual in sorted(leaf.encodings - _ENCODINGS)[:1]:
            raise FormatError(f"has the encoding {unusual}", path=path, key=name)
    if GEOMETRY not in leaves:
        is_nested = any(name.startswith(f"{GEOMETRY}.") for name in leaves)
        problem = "is not well-known binary, but of several columns" if is_nested else "is missing"
        raise FormatError(problem, path=path, key=GEOMETRY)
    return leaves


def _footprints(pa: Any, table: pyarrow.Table, path: str) -> ObjectArray:
    column = table[GEOMETRY]
    if column.null_count:
        raise FormatError("is missing in a row", path=path, key=GEOMETRY)
    if pa.types.is_dictionary(column.type):
        words = _whole(pa, column)
        shapes = _shapes(pa, words.dictionary, path)[words.indices.to_numpy()]
        if shapely.get_num_coordinates(shapes).sum() * 16 > limits.MAX_TABLE_BYTES:
            raise FormatError("has too many points", path=path, key=GEOMETRY)
        return as_objects(shapes)
    footprints: ObjectArray = np.empty(len(column), dtype=object)
    at = 0
    for chunk in column.chunks:
        for start in range(0, len(chunk), _AT_ONCE):
            some = chunk.slice(start, _AT_ONCE)
            footprints[at : at + len(some)] = _shapes(pa, some, path)
            at += len(some)
    return footprints


def _shapes(pa: Any, wkb: Any, path: str) -> ObjectArray:
    """Return the geometries of an Arrow array, which objects can have."""
    is_large = pa.types.is_large_binary(wkb.type)
    if len(wkb) and (is_large or pa.types.is_binary(wkb.type)):
        _, offsets, data = wkb.buffers()
        places = np.frombuffer(offsets, np.int64 if is_large else np.int32)
        bounds = places[wkb.offset : wkb.offset + len(wkb) + 1].astype(np.int64)
        outlines = outlines_from_wkb(np.frombuffer(data or b"", np.uint8), bounds)
        if outlines is not None:
            return outlines
    try:
        shapes = footprints_from_wkb(wkb.to_numpy(zero_copy_only=False))
        for wrong in shapes[~can_be_footprints(shapes)][:1]:
            check_footprint(wrong)
    except (ValueError, TypeError) as error:
        raise FormatError(str(error), path=path, key=GEOMETRY) from None
    return shapes


def _leaf(name: str, column: Column) -> str:
    return f"{name}.list.element" if isinstance(column, Lists) else name


def _words_in(column: Column) -> Words | None:
    items = column.items if isinstance(column, Lists) else column
    return items if isinstance(items, Words) else None


def _most_values(column: Column | ObjectArray) -> int:
    """Return how many values a file will say that a column has; lists that are empty have one."""
    if isinstance(column, Lists):
        return len(column.offsets) + _most_values(column.items)
    if isinstance(column, Words):
        return len(column.codes)
    return len(column.values if isinstance(column, Numbers) else column)


def _to_arrow(pa: Any, column: Column) -> Any:
    if isinstance(column, Lists):
        return pa.ListArray.from_arrays(
            pa.array(column.offsets, pa.int32()), _to_arrow(pa, column.items)
        )
    if isinstance(column, Words):
        indices = pa.array(column.codes, mask=column.codes < 0)
        words = pa.array(list(column.vocabulary), pa.string())
        return pa.DictionaryArray.from_arrays(indices, words).dictionary_decode()
    return pa.array(column.values, mask=~column.there)


def _whole(pa: Any, chunked: Any) -> Any:
    """Return a column's chunks as one array."""
    whole = chunked.unify_dictionaries().combine_chunks()
    return whole.chunk(0) if isinstance(whole, pa.ChunkedArray) else whole


def _from_arrow(pa: Any, chunked: Any, name: str, path: str) -> Column:
    array = _whole(pa, chunked)
    kind = array.type
    if pa.types.is_list(kind) or pa.types.is_large_list(kind):
        # A row without a list has an empty one; `flatten` leaves out what such rows may hide.
        counts = pa.compute.fill_null(pa.compute.list_value_length(array), 0).to_numpy()
        items = _plain_from_arrow(pa, array.flatten(), name, path)
        return Lists(np.append(0, np.cumsum(counts, dtype=np.int64)), items)
    return _plain_from_arrow(pa, array, name, path)


def _plain_from_arrow(pa: Any, array: Any, name: str, path: str) -> Words | Numbers:
    kind = array.type
    there = np.asarray(array.is_valid().to_numpy(zero_copy_only=False), dtype=bool)
    if pa.types.is_string(kind) or pa.types.is_large_string(kind):
        array = array.dictionary_encode()
        kind = array.type
    if pa.types.is_dictionary(kind) and (
        pa.types.is_string(kind.value_type) or pa.types.is_large_string(kind.value_type)
    ):
        codes = array.indices.fill_null(-1).to_numpy().astype(np.int32)
        return Words(codes, array.dictionary.to_pylist())
    if pa.types.is_boolean(kind):
        return Numbers(array.fill_null(False).to_numpy(zero_copy_only=False), there)
    if pa.types.is_integer(kind):
        return Numbers(array.fill_null(0).cast(pa.int64()).to_numpy(), there)
    if pa.types.is_floating(kind):
        return Numbers(array.cast(pa.float64()).fill_null(np.nan).to_numpy(), there)
    if pa.types.is_null(kind):
        return Words(np.full(len(array), -1, dtype=np.int32), [])
    raise FormatError(f"is of the type {kind}, which no object has", path=path, key=name)
