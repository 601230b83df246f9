"""Columns of values and polygons as GeoParquet.

GeoParquet (version 1.1, geometries as WKB) is what GeoPandas, QGIS, GDAL and DuckDB read. The same
columns give the same bytes each time.
"""

from __future__ import annotations

import json
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from hypermap.core.arrays import ObjectArray, as_objects
from hypermap.core.errors import FormatError, HypermapError
from hypermap.core.shapes import can_be_footprints, check_footprint
from hypermap.formats import limits
from hypermap.formats.columns.arrow import (
    Column,
    from_arrow,
    leaf_of,
    most_values,
    pyarrow_and_parquet,
    to_arrow,
    whole,
    words_in,
)
from hypermap.formats.columns.crs import System, engineering_projjson
from hypermap.formats.columns.footprints import footprints_from_wkb
from hypermap.formats.columns.outlines import outlines_from_wkb
from hypermap.formats.columns.parquet_description import WIDTH, Leaf, leaves_of

if TYPE_CHECKING:
    import pyarrow

MAGIC = b"PAR1"
GEOMETRY = "geometry"
_ROW_GROUP = 1 << 17  # rows; they are read one group after the other
_AT_ONCE = 4096  # footprints, which should fit into the processor's cache


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
        HypermapError: If it is too large to read back.
    """
    pa, parquet = pyarrow_and_parquet()
    arrays = {name: to_arrow(pa, column) for name, column in columns.items()}
    arrays[GEOMETRY] = pa.array(shapely.to_wkb(footprints), pa.binary())
    metadata = {"geo": json.dumps(_geo(footprints, frame_id)), **notes}
    table = pa.table(arrays).replace_schema_metadata(metadata)
    unpacked = WIDTH * (len(footprints) + sum(map(most_values, columns.values())))
    if len(table) > limits.MAX_ROWS or max(unpacked, table.nbytes) > limits.MAX_TABLE_BYTES:
        raise HypermapError(f"{len(table)} objects are too many for one file")
    sink = pa.BufferOutputStream()
    parquet.write_table(
        table,
        sink,
        row_group_size=_ROW_GROUP,
        compression="zstd",
        use_dictionary=[leaf_of(name, c) for name, c in columns.items() if words_in(c) is not None],
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
    pa, parquet = pyarrow_and_parquet()
    try:
        leaves = leaves_of(parquet, content, path)
        _check_geometry(leaves, path)
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
            name: from_arrow(pa, table[name], name, path)
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


def _geo(footprints: ObjectArray, frame_id: str) -> dict[str, Any]:
    """Return the file's metadata by the specification of GeoParquet 1.1."""
    kinds = np.unique(shapely.get_type_id(footprints)).tolist()
    names = {3: "Polygon", 6: "MultiPolygon"}
    column: dict[str, Any] = {
        "encoding": "WKB",
        "geometry_types": [names[kind] for kind in kinds],
        "crs": engineering_projjson(frame_id),
        "edges": "planar",
    }
    if len(footprints):
        column["bbox"] = shapely.total_bounds(footprints).tolist()
    return {"version": "1.1.0", "primary_column": GEOMETRY, "columns": {GEOMETRY: column}}


def system_of(notes: Mapping[str, str]) -> System | None:
    """Return the coordinate reference system that a file names; None if it names none."""
    try:
        crs = json.loads(notes.get("geo", ""))["columns"][GEOMETRY]["crs"]
    except (ValueError, LookupError, TypeError, RecursionError):
        return None
    return System.of_projjson(crs) if isinstance(crs, dict) else None


def _check_geometry(leaves: Mapping[str, Leaf], path: str) -> None:
    """Raise a FormatError if there is no geometry as well-known binary."""
    if GEOMETRY not in leaves:
        is_nested = any(name.startswith(f"{GEOMETRY}.") for name in leaves)
        problem = "is not well-known binary, but of several columns" if is_nested else "is missing"
        raise FormatError(problem, path=path, key=GEOMETRY)


def _footprints(pa: Any, table: pyarrow.Table, path: str) -> ObjectArray:
    column = table[GEOMETRY]
    if column.null_count:
        raise FormatError("is missing in a row", path=path, key=GEOMETRY)
    if pa.types.is_dictionary(column.type):
        words = whole(pa, column)
        rows = words.indices.to_numpy()
        shapes = _shapes(pa, words.dictionary, path, lambda word: int(np.argmax(rows == word)))
        shapes = shapes[rows]
        if shapely.get_num_coordinates(shapes).sum() * 16 > limits.MAX_TABLE_BYTES:
            raise FormatError("has too many points", path=path, key=GEOMETRY)
        return as_objects(shapes)
    footprints: ObjectArray = np.empty(len(column), dtype=object)
    at = 0
    for chunk in column.chunks:
        for start in range(0, len(chunk), _AT_ONCE):
            some = chunk.slice(start, _AT_ONCE)
            footprints[at : at + len(some)] = _shapes(pa, some, path, partial(operator.add, at))
            at += len(some)
    return footprints


def _shapes(pa: Any, wkb: Any, path: str, row_of: Callable[[int], int]) -> ObjectArray:
    """Return the footprints in an Arrow array; errors name the row."""
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
    except (ValueError, TypeError) as error:
        raise FormatError(str(error), path=path, key=GEOMETRY) from None
    good = can_be_footprints(shapes)
    if not good.all():
        wrong = int(np.argmin(good))
        try:
            check_footprint(shapes[wrong])
        except (ValueError, TypeError) as error:
            key = f"{GEOMETRY} in row {row_of(wrong)}"
            raise FormatError(str(error), path=path, key=key) from None
    return shapes
