from __future__ import annotations

import contextlib
import datetime
import io
import math
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry.base import BaseGeometry

from hypermap.core.errors import FormatError, HypermapError, MissingExtra
from hypermap.core.objects import ObjectTable, SemanticObject
from hypermap.core.semantic import Rejected, SemanticLayer
from hypermap.formats import limits
from hypermap.formats.columns import arrow, geoparquet
from hypermap.formats.columns.arrow import Lists, Numbers, Words
from hypermap.formats.columns.geoparquet import write_geoparquet
from hypermap.formats.semantic.parquet_files import dump_parquet, parse_parquet

from ..strategies import exact, object_facts

pa = pytest.importorskip("pyarrow")
parquet = pytest.importorskip("pyarrow.parquet")


def again(layer: SemanticLayer) -> SemanticLayer:
    content = dump_parquet(layer.table, layer.frame_id, layer.rejected)
    assert content == dump_parquet(layer.table, layer.frame_id, layer.rejected)
    table, rejected = parse_parquet(content, "t.hmap/semantic.parquet")
    return SemanticLayer.of_table(layer.name, layer.frame_id, table, None, rejected)


HOLE = shapely.Polygon([(0, 0), (4, 0), (4, 4), (0, 4)], [[(1, 1), (2, 1), (2, 2)]])
OBJECTS = [
    SemanticObject("cup", shapely.box(0, 0, 1, 1), 7, ("cup", "bowl"), (0.5, 0.25), 2.5, 1.0, 2.0,
                   {"z_max": 1.5, "count": 3, "color": "red", "fixed": True}),
    SemanticObject("ring", HOLE, 3, attributes={"z_max": math.nan, "count": -(2**63)}),
    SemanticObject("cup", shapely.MultiPolygon([HOLE, shapely.box(9, 9, 10, 10)]), 0, ("cup",),
                   attributes={"day": datetime.date(2026, 1, 2), "parts": [1, {"a": None}]}),
    SemanticObject("7", shapely.box(0, 0, 1, 1), 1, attributes={7: b"seven", 8: math.inf}),
    SemanticObject("", shapely.box(-1, -1, 0, 0), 2**31 - 1,
                   attributes={"count": 0, "id": "own", "geometry": 1, "a b": 2.0, "none": None}),
]  # fmt: skip


def test_everything_that_an_object_can_hold_comes_back() -> None:
    table, rejected = parse_parquet(dump_parquet(ObjectTable.of(OBJECTS), "map"), "t")
    assert rejected == []
    loaded = [table.object(row) for row in range(len(table))]
    assert [object_facts(item) for item in loaded] == [object_facts(item) for item in OBJECTS]


def test_rows_come_in_several_groups(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(geoparquet, "_ROW_GROUP", 2)
    table, _ = parse_parquet(dump_parquet(ObjectTable.of(OBJECTS), "map"), "t")
    loaded = [table.object(row) for row in range(len(table))]
    assert [object_facts(item) for item in loaded] == [object_facts(item) for item in OBJECTS]


def test_many_objects_of_all_kinds_come_back_in_their_order() -> None:
    kinds = [
        SemanticObject("cup", shapely.box(0, 0, 1, 1), tags=("cup",), confidence=(0.5,)),
        SemanticObject("ring", HOLE, tags=("cup", "ring"), confidence=(0.5, 0.25)),
        SemanticObject("table", shapely.Point(3, 3).buffer(1), tags=(), confidence=(0.125,)),
    ]
    rare = np.arange(10_000) % 7000 == 6999  # some thousands of rows have one ring, some have not
    objects = [kinds[1 if rare[row] else row % 5 % 2 * 2].with_id(row) for row in range(10_000)]
    table, _ = parse_parquet(dump_parquet(ObjectTable.of(objects), "map"), "t")
    loaded = [table.object(row) for row in range(len(table))]
    assert [object_facts(item) for item in loaded] == [object_facts(item) for item in objects]
    assert len({id(tags) for tags in table.tags}) == 3  # equal ones are the same


def test_entries_that_could_not_be_read_are_kept() -> None:
    rejected = [Rejected(4, "cup", "its shape is missing", {"name": "cup", "mass": 3})]
    layer = SemanticLayer("semantic", "map", OBJECTS, rejected=rejected)
    assert again(layer).rejected == layer.rejected


def test_numbers_and_texts_have_columns_of_their_own_and_the_others_stand_as_json() -> None:
    file = parquet.read_table(pa.BufferReader(dump_parquet(ObjectTable.of(OBJECTS), "map")))
    assert file.column_names == [
        "id", "name", "tags", "confidence", "existence", "first_seen", "last_seen",
        "z_max", "count", "color", "fixed", "attributes", "geometry",
    ]  # fmt: skip
    assert file["count"].to_pylist() == [3, -(2**63), None, None, 0]
    assert file["existence"].to_pylist() == [2.5, None, None, None, None]
    assert file["attributes"].to_pylist()[4] == (
        '{"id": "own", "geometry": 1, "a b": 2.0, "none": null}'
    )


def test_geopandas_reads_the_file_and_its_frame(tmp_path: Path) -> None:
    geopandas = pytest.importorskip("geopandas")
    path = tmp_path / "semantic.parquet"
    path.write_bytes(dump_parquet(ObjectTable.of(OBJECTS), "room 1"))
    frame = geopandas.read_parquet(path)
    assert frame.name.tolist() == ["cup", "ring", "cup", "7", ""]
    assert frame.crs.name == "room 1"
    assert [exact(g) for g in frame.geometry] == [exact(item.footprint) for item in OBJECTS]
    frame["checked"] = [True, False, True, True, True]
    frame.to_parquet(path)  # and we read what GeoPandas writes
    table, _ = parse_parquet(path.read_bytes(), str(path))
    assert [attributes["checked"] for attributes in table.attributes] == [
        True,
        False,
        True,
        True,
        True,
    ]
    assert table.ids.tolist() == [7, 3, 0, 1, 2**31 - 1]
    assert [exact(g) for g in table.footprints] == [exact(item.footprint) for item in OBJECTS]


INTACT = dump_parquet(ObjectTable.of(OBJECTS), "map", [Rejected(9, "x", "why", [1])])


@given(st.data())
def test_damage_never_gives_another_error(data: Any) -> None:
    content = bytearray(INTACT)
    for _ in range(data.draw(st.integers(1, 6))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    cut = data.draw(st.sampled_from([0, 0, 1, 8, 100, len(content) // 2]))
    with contextlib.suppress(FormatError):
        parse_parquet(bytes(content[: len(content) - cut]), "t")


def test_damage_to_the_description_of_columns_never_ends_the_program() -> None:
    start = len(INTACT) - 8 - int.from_bytes(INTACT[-8:-4], "little")
    refused = 0
    for at in range(start, start + 400):
        for bits in (1, 2, 4):  # Arrow would call `terminate` for some
            content = bytearray(INTACT)
            content[at] ^= bits
            try:
                parse_parquet(bytes(content), "t")
            except FormatError:
                refused += 1
    assert refused > 100


def edited(**columns: Any) -> bytes:
    """The file with other columns; None takes one away."""
    file = parquet.read_table(pa.BufferReader(INTACT))
    for name, values in columns.items():
        if name in file.column_names:
            file = file.drop_columns([name])
        if values is not None:
            file = file.append_column(name, values)
    sink = io.BytesIO()
    parquet.write_table(file, sink)
    return sink.getvalue()


POINTS = pa.array(shapely.to_wkb(shapely.points([[0, 0]] * 5)))
SCRIBBLE = shapely.Polygon(np.random.default_rng(0).random((3000, 2)) * 10)
HOLLOW = shapely.from_wkt("POLYGON((0 0, 1 0, 1 1, 0 0), EMPTY)")
HOLLOWS = pa.array(shapely.to_wkb([shapely.box(0, 0, 1, 1)] * 3 + [HOLLOW] * 2))
TANGLED = pa.array(shapely.to_wkb([shapely.box(0, 0, 1, 1)] * 3 + [SCRIBBLE] * 2))


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"name": None}, "t: name: is missing"),
        ({"name": pa.array(["a", None, "c", "d", "e"])}, "t: name: is missing in row 1"),
        ({"name": pa.array([1, 2, 3, 4, 5])}, "t: name: expected texts"),
        ({"geometry": None}, "t: geometry: is missing"),
        ({"geometry": POINTS}, "t: geometry in row 0: a footprint must be a polygon or"),
        ({"geometry": HOLLOWS}, "t: geometry in row 3: a hole of a footprint must have corners"),
        ({"geometry": pa.array([b"x"] * 5)}, "t: geometry: is not well-known binary: "),
        ({"geometry": pa.array([None] * 5, pa.binary())}, "t: geometry: is missing in a row"),
        ({"geometry": TANGLED}, "t: geometry in row 3: an outline of 3001 corners crosses"),
        ({"id": pa.array([1, 1, 2, 3, 4])}, "t: two objects have the id 1"),
        ({"id": pa.array([-1, 1, 2, 3, 4])}, "t: an object's id must be between 0 and"),
        ({"id": pa.array([0.5, 1, 2, 3, 4])}, "t: id: expected a whole number in each row"),
        ({"id": pa.array(["a"] * 5)}, "t: id: expected numbers"),
        ({"tags": pa.array([[1]] * 5)}, "t: tags: expected lists of texts"),
        ({"tags": pa.array([["a", None]] * 5)}, "t: tags: expected lists of texts"),
        ({"confidence": pa.array([[math.nan]] * 5)}, "t: confidence: must be finite"),
        ({"confidence": pa.array([["a"]] * 5)}, "t: confidence: expected lists of numbers"),
        ({"last_seen": pa.array([math.inf] * 5)}, "t: last_seen must be finite"),
        ({"attributes": pa.array(["{"] * 5)}, "t: attributes: is not JSON: "),
        ({"attributes": pa.array(["hello"] * 5)}, "t: attributes: expected keys and values"),
        ({"when": pa.array([datetime.date(2026, 1, 2)] * 5)}, "t: when: is of the type date32"),
    ],
)  # fmt: skip
def test_a_wrong_column_is_one_clear_error(columns: dict[str, Any], message: str) -> None:
    with pytest.raises(FormatError) as error:
        parse_parquet(edited(**columns), "t")
    assert str(error.value).startswith(message)


def test_a_geometry_of_several_columns_is_distinguished_from_none() -> None:
    points = pa.array([{"x": 0.0, "y": 0.0}] * 5)
    with pytest.raises(FormatError, match="t: geometry: is not well-known binary, but of several"):
        parse_parquet(edited(geometry=points), "t")


def test_a_column_that_is_there_twice_is_refused() -> None:
    file = parquet.read_table(pa.BufferReader(INTACT)).append_column("color", pa.array(["red"] * 5))
    sink = io.BytesIO()
    parquet.write_table(file, sink)
    with pytest.raises(FormatError, match="t: color: appears twice"):
        parse_parquet(sink.getvalue(), "t")


def test_coordinates_on_the_globe_are_refused(tmp_path: Path) -> None:
    geopandas = pytest.importorskip("geopandas")
    path = tmp_path / "t.parquet"
    frame = geopandas.GeoDataFrame({"name": ["cup"]}, geometry=[shapely.box(0, 0, 1, 1)])
    frame.to_parquet(path)
    assert len(parse_parquet(path.read_bytes(), "t")[0]) == 1
    frame.set_crs("EPSG:4326").to_parquet(path)
    with pytest.raises(FormatError, match=r"t: geometry: coordinates are in WGS 84, not in meters"):
        parse_parquet(path.read_bytes(), "t")


def test_columns_that_are_missing_are_those_of_objects_without() -> None:
    content = edited(id=None, tags=None, confidence=None, existence=None, attributes=None)
    table, _ = parse_parquet(content, "t")
    assert table.ids.tolist() == [0, 1, 2, 3, 4]
    assert table.tags.tolist() == table.confidence.tolist() == [()] * 5


@pytest.mark.parametrize(
    ("limit", "value", "message"),
    [
        ("MAX_ROWS", 3, "t: has 5 rows and"),
        ("MAX_COLUMNS", 5, "t: has 5 rows and"),
        ("MAX_TABLE_BYTES", 100, "t: unpacks to more than 100 bytes"),
    ],
)
def test_what_is_too_large_is_not_read(
    monkeypatch: pytest.MonkeyPatch, limit: str, value: int, message: str
) -> None:
    monkeypatch.setattr(limits, limit, value)
    with pytest.raises(FormatError) as error:
        parse_parquet(INTACT, "t")
    assert str(error.value).startswith(message)
    if limit != "MAX_COLUMNS":
        with pytest.raises(HypermapError, match="too many for one file"):
            dump_parquet(ObjectTable.of(OBJECTS), "map")


def test_one_large_shape_in_many_rows_is_not_unpacked(monkeypatch: pytest.MonkeyPatch) -> None:
    circle = shapely.to_wkb(shapely.Point(0, 0).buffer(1, quad_segs=250))
    shapes = pa.array([circle] * 2000).dictionary_encode()
    sink = io.BytesIO()
    parquet.write_table(pa.table({"name": pa.array(["a"] * 2000), "geometry": shapes}), sink)
    monkeypatch.setattr(limits, "MAX_TABLE_BYTES", 10_000_000)
    with pytest.raises(FormatError, match="t: geometry: has too many points"):
        parse_parquet(sink.getvalue(), "t")


@pytest.mark.parametrize("kind", ["items", "columns", "letters", "binary"])
def test_what_is_the_same_all_over_is_not_unpacked(
    monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    table = pa.table({"name": ["a"] * 2000, "geometry": [shapely.box(0, 0, 1, 1).wkb] * 2000})
    if kind == "items":
        table = table.append_column("x", pa.array([[]] * 1999 + [[True] * 200_000]))
    elif kind == "columns":
        for number in range(100):
            table = table.append_column(f"x{number}", pa.array([1] * 2000))
    elif kind == "letters":
        table = table.append_column("x", pa.array([b"x" * 1000] * 2000, pa.binary(1000)))
    else:
        nested = struct.pack("<BII", 1, 7, 1) * 200_000  # GEOS would end the program
        table = pa.table({"name": ["a"], "geometry": [nested]})
    sink = io.BytesIO()
    parquet.write_table(table, sink)
    monkeypatch.setattr(limits, "MAX_TABLE_BYTES", 1_000_000 if kind != "binary" else 1 << 30)
    assert len(sink.getvalue()) < 100_000
    message = "unpacks to more than" if kind != "binary" else "must be a polygon or multipolygon"
    with pytest.raises(FormatError, match=message):
        parse_parquet(sink.getvalue(), "t")


def test_what_is_the_same_all_over_is_not_written(monkeypatch: pytest.MonkeyPatch) -> None:
    shapes = np.array([shapely.box(0, 0, 1, 1)] * 100)
    column = Words(np.zeros(100, np.int32), ["cup"])
    lists = Lists(np.arange(101), column)
    monkeypatch.setattr(limits, "MAX_TABLE_BYTES", 100 * 200)
    content = write_geoparquet({"name": column}, shapes, "map", {})
    assert len(geoparquet.read_geoparquet(content, "t").footprints) == 100
    many = {f"x{number}": lists for number in range(20)}
    with pytest.raises(HypermapError, match="100 objects are too many for one file"):
        write_geoparquet(many, shapes, "map", {})


def test_unusual_encodings_are_refused() -> None:
    file = parquet.read_table(pa.BufferReader(INTACT)).select(["name", "geometry"])
    sink = io.BytesIO()
    parquet.write_table(
        file, sink, use_dictionary=False, column_encoding={"name": "DELTA_BYTE_ARRAY"}
    )
    with pytest.raises(FormatError, match="t: name: has the encoding DELTA_BYTE_ARRAY"):
        parse_parquet(sink.getvalue(), "t")


def test_without_pyarrow_the_error_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    assert not arrow.has_pyarrow()
    with pytest.raises(MissingExtra, match=r"pip install 'hypermap\[parquet\]'"):
        parse_parquet(INTACT, "t")


def test_a_table_of_anything_beside_polygons_can_be_kept() -> None:
    shapes: list[BaseGeometry] = [shapely.box(0, 0, 1, 1), shapely.box(2, 2, 3, 3)]
    column = Numbers(np.array([1.5, 0.0]), np.array([True, False]))
    content = write_geoparquet({"x": column}, np.array(shapes), "map", {"made": "by hand"})
    file = geoparquet.read_geoparquet(content, "t")
    assert file.notes["made"] == "by hand"
    read = file.columns["x"]
    assert isinstance(read, Numbers)
    assert read.there.tolist() == [True, False]
    assert read.values[0] == 1.5
