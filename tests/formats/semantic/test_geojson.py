from __future__ import annotations

import contextlib
import datetime
import json
import sys
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from hypermap.core.errors import FormatError, MissingExtra
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.formats.semantic.geojson import from_geojson, to_geojson
from hypermap.formats.semantic.geopandas_bridge import to_geodataframe
from hypermap.testing import assert_same_layer, square

CUP = SemanticObject(
    name="cup",
    footprint=shapely.Polygon([(0, 0), (0.5, 0), (0.5, 0.25)]),
    id=7,
    tags=("cup", "bowl"),
    confidence=(0.5, 0.25),
    existence=2.5,
    attributes={"z_max": 1.2},
)
LAYER = SemanticLayer("objects", "lab", [CUP])


def test_a_layer_is_a_collection_of_features_in_metres() -> None:
    document = json.loads(to_geojson(LAYER))
    assert document["type"] == "FeatureCollection"
    assert (document["name"], document["frame_id"]) == ("objects", "lab")
    assert document["crs"]["properties"]["name"].startswith('ENGCRS["lab",')
    assert document["features"] == [
        {
            "type": "Feature",
            "id": 7,
            "geometry": {
                "type": "Polygon",
                "coordinates": [[[0, 0], [0.5, 0], [0.5, 0.25], [0, 0]]],
            },
            "properties": {
                "id": 7,
                "name": "cup",
                "tags": ["cup", "bowl"],
                "confidence": [0.5, 0.25],
                "existence": 2.5,
                "z_max": 1.2,
            },
        }
    ]


def test_the_name_of_a_file_in_the_place_of_its_content_is_refused_with_the_remedy() -> None:
    with pytest.raises(FormatError, match=r"; of a file, give the content: Path\(file\).read_text"):
        from_geojson("cups.geojson")
    with pytest.raises(FormatError) as caught:
        from_geojson("{", path="cups.geojson")
    assert "give the content" not in str(caught.value)


def test_heights_of_coordinates_are_left_out_and_a_byte_order_mark_is_read(
    caplog: pytest.LogCaptureFixture,
) -> None:
    document = json.loads(to_geojson(LAYER))
    corners = [[x, y, 0.8] for x, y in ([0, 0], [0.5, 0], [0.5, 0.25], [0, 0])]
    document["features"][0]["geometry"]["coordinates"] = [corners]
    (cup,) = from_geojson(f"\ufeff{json.dumps(document)}").objects()
    assert shapely.equals_identical(cup.footprint, CUP.footprint)
    assert "the heights in the coordinates of 1 object are left out" in caplog.text


def test_a_file_without_frame_needs_one_and_a_name_can_be_given() -> None:
    document = json.loads(to_geojson(LAYER))
    del document["frame_id"], document["name"], document["crs"]
    with pytest.raises(FormatError) as error:
        from_geojson(json.dumps(document), path="cups.geojson")
    assert str(error.value) == (
        "cups.geojson: crs: is missing, because GIS programs omit it; if coordinates are meters in "
        "a frame of the map, name it: --frame map of `hypermap convert`, or "
        'frame_id="map" in Python'
    )
    layer = from_geojson(json.dumps(document), frame_id="odom")
    assert (layer.name, layer.frame_id) == ("semantic", "odom")
    layer = from_geojson(to_geojson(LAYER), name="cups", frame_id="odom")
    assert (layer.name, layer.frame_id) == ("cups", "odom")


def test_the_crs_alone_names_the_frame_too() -> None:
    layer = SemanticLayer("s", 'the "old" lab', LAYER.objects())
    document = json.loads(to_geojson(layer))
    del document["frame_id"]
    assert from_geojson(json.dumps(document)).frame_id == 'the "old" lab'


@pytest.mark.parametrize(
    ("crs", "named"),
    [
        ("urn:ogc:def:crs:OGC:1.3:CRS84", "urn:ogc:def:crs:OGC:1.3:CRS84"),
        ("EPSG:32632", "EPSG:32632"),
        ('PROJCRS["WGS 84 / UTM zone 32N",BASEGEOGCRS["WGS 84"]]', "WGS 84 / UTM zone 32N"),
        ("", ""),
        (None, "a crs that is not known here"),
    ],
)
@pytest.mark.parametrize("frame_id", [None, "map"])
def test_coordinates_in_another_system_are_refused(
    crs: str | None, named: str, frame_id: str | None
) -> None:
    document = json.loads(to_geojson(LAYER))
    document["crs"] = {"type": "name", "properties": {"name": crs}}
    with pytest.raises(FormatError) as error:
        from_geojson(json.dumps(document), frame_id=frame_id, path="t.geojson")
    assert str(error.value).startswith(f"t.geojson: crs: coordinates are in {named}, not in meters")


def test_gis_programs_may_leave_open_rings_nulls_and_ids_of_their_own() -> None:
    document = json.loads(to_geojson(LAYER))
    feature = document["features"][0]
    feature["geometry"]["coordinates"][0].pop()
    feature["properties"] = {"name": "cup", "tags": None, "existence": None, "attributes": None}
    feature["id"] = 9
    (item,) = from_geojson(json.dumps(document)).objects()
    assert item.id == 9
    assert item.footprint.equals(CUP.footprint)


@pytest.mark.parametrize("theirs", ["way/1205", "7", -3, 2**70, 0.5])
def test_an_id_that_is_no_number_of_ours_is_kept_as_an_attribute(theirs: object) -> None:
    feature = {"type": "Feature", "id": theirs, "geometry": shapely.geometry.mapping(CUP.footprint)}
    feature["properties"] = {"name": "cup"}
    document = {"type": "FeatureCollection", "frame_id": "lab", "features": [feature]}
    layer = from_geojson(json.dumps(document))
    (item,) = layer.objects()
    assert (item.id, item.attributes) == (0, {"feature_id": theirs})
    assert_same_layer(from_geojson(to_geojson(layer)), layer)
    feature["properties"] = {"name": "cup", "id": 7}  # as in our file once GeoPandas has written it
    (item,) = from_geojson(json.dumps(document)).objects()
    assert (item.id, item.attributes) == (7, {})


def test_a_property_that_is_null_is_no_attribute_and_what_is_none_stays_so() -> None:
    item = square("cup", 0, 0, attributes={"color": None, "z_max": 0.9, "name": "mug"})
    layer = SemanticLayer("objects", "lab", [item])
    text = to_geojson(layer)
    assert_same_layer(from_geojson(text), layer)
    document = json.loads(text)
    document["features"][0]["properties"] |= {"weight": None, "id": None}
    document["features"][0]["id"] = 7
    (again,) = from_geojson(json.dumps(document)).objects()
    assert again.attributes == item.attributes
    assert again.id == 7


def changed(**changes: Any) -> str:
    """The cup's collection with other members in its feature."""
    document = json.loads(to_geojson(LAYER))
    document["features"][0].update(changes)
    return json.dumps(document)


def polygon(*points: Any) -> dict[str, Any]:
    return {"type": "Polygon", "coordinates": [list(points)]}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is not valid JSON: "),
        ("{", "is not valid JSON: "),
        ("[" * 100_000, "is not valid JSON: "),
        ("[]", "expected keys and values, found a list"),
        ("{}", "type: is required, but missing"),
        ('{"type": "Feature"}', "type: input should be 'FeatureCollection', found 'Feature'"),
        ('{"type": "FeatureCollection"}', "features: is required, but missing"),
        (changed(type="Point"), "features[0].type: input should be 'Feature', found 'Point'"),
        (
            changed(geometry={"type": "Point", "coordinates": [1, 2]}),
            "features[0].geometry.type: expected Polygon or MultiPolygon, found 'Point'; objects h",
        ),
        (
            changed(geometry={"type": "GeometryCollection", "geometries": []}),
            "features[0].geometry.type: expected Polygon or MultiPolygon, found 'GeometryColl",
        ),
        (changed(geometry=None), "features[0].geometry: is missing; leave out features without"),
        (
            changed(geometry={"type": "Polygon", "coordinates": []}),
            "features[0].geometry.coordinates: list should have at least 1 item",
        ),
        (
            changed(geometry=polygon([0, 0], [1, 1])),
            "features[0].geometry: is not a valid Polygon: ",
        ),
        (
            changed(
                geometry={
                    "type": "Polygon",
                    "coordinates": [[[0, 0], [1, 0], [1, 1], [0, 0]], []],
                }
            ),
            "features[0].geometry: is not a valid Polygon: a hole of a footprint must have corners",
        ),
        (
            changed(geometry=polygon([0, 0], [float("nan"), 0], [1, 1])),
            "is not valid JSON: NaN is not a number",
        ),
        (
            changed(geometry=polygon([0, 0], [12345, 0], [1, 1])).replace("12345", "1e999"),
            "features[0].geometry: is not a valid Polygon: a footprint must be finite",
        ),
        (
            changed(geometry=polygon([0, 0], [10**400, 0], [1, 1])),
            "features[0].geometry: is not a valid Polygon: ",
        ),
        (
            changed(geometry=polygon("a", {}, 3)),
            "features[0].geometry: is not a valid Polygon: ",
        ),
        (
            changed(properties={}),
            "features[0].properties.name: is required, but missing: it is the class of the object;",
        ),
        (
            changed(properties={"label": "cup", "score": 0.5}),
            "features[0].properties.name: is required, but missing: it is the class of the object; "
            "rename the property that has it (found: label, score)",
        ),
        (
            changed(properties={"name": "cup", "id": "cup-7"}),
            "features[0].properties.id: expected a whole number, found 'cup-7'; rename the propert",
        ),
        (
            changed(properties={"name": "cup", "id": -2}),
            "features[0].properties: id: input should be greater than or equal to 0, found -2",
        ),
        (
            changed(properties={"name": "cup", "tags": "['cup' 'bowl']"}),
            "features[0].properties: tags: input should be a list, found",
        ),
    ],
    ids=lambda value: value[:40],
)
def test_what_is_wrong_is_named_with_its_place(text: str, message: str) -> None:
    with pytest.raises(FormatError) as error:
        from_geojson(text, path="t.geojson")
    assert str(error.value).startswith(f"t.geojson: {message}")


def test_coordinates_that_lie_too_deep_are_an_error() -> None:
    deep = "[" * 700 + "]" * 700  # once, this ended in an error of Python
    with pytest.raises(FormatError, match="is not"):
        from_geojson(changed(geometry=polygon("here")).replace('"here"', deep))


@pytest.mark.parametrize("times", [2, 20_000])  # once, many took minutes
def test_an_id_that_is_there_twice_is_an_error(times: int) -> None:
    document = json.loads(to_geojson(LAYER))
    document["features"] *= times
    with pytest.raises(FormatError, match="features: the id 7 appears twice; features witho"):
        from_geojson(json.dumps(document))


def test_a_confidence_may_be_one_number() -> None:
    [read] = from_geojson(changed(properties={"name": "cup", "confidence": 0.5}))
    assert read.confidence == (0.5,)


def test_numbers_of_numpy_are_written_as_numbers() -> None:
    numbers = {"id": np.int64(7), "first_seen": np.float32(1.5), "confidence": [np.float32(0.5)]}
    item = SemanticObject("cup", shapely.box(0, 0, 1, 1), tags=("cup",), **numbers)
    [read] = from_geojson(to_geojson(SemanticLayer("objects", "map", [item])))
    assert (read.id, read.first_seen, read.confidence) == (7, 1.5, (0.5,))


def test_attributes_that_json_cannot_hold_are_an_error() -> None:
    for value in (datetime.date(2019, 5, 6), float("nan")):
        item = SemanticObject("cup", shapely.box(0, 0, 1, 1), attributes={"seen": value})
        with pytest.raises(FormatError, match="objects: cannot be written as JSON: "):
            to_geojson(SemanticLayer("objects", "map", [item]))


@given(st.data())
def test_damage_never_gives_another_error(data: st.DataObject) -> None:
    text = list(to_geojson(LAYER))
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.integers(0, len(text) - 1))
        text[place] = data.draw(st.sampled_from('{}[]",:0159-e.aN '))
    with contextlib.suppress(FormatError):
        from_geojson("".join(text))


def test_gis_programs_read_metres_and_not_degrees(tmp_path: Any) -> None:
    geopandas = pytest.importorskip("geopandas")
    path = tmp_path / "cups.geojson"
    path.write_text(to_geojson(LAYER))
    frame = geopandas.read_file(path)
    assert frame.crs.is_engineering
    assert not frame.crs.is_geographic
    assert frame.loc[0, "name"] == "cup"
    assert frame.area[0] == CUP.footprint.area


def test_a_geodataframe_has_a_row_per_object() -> None:
    pytest.importorskip("geopandas")
    other = SemanticObject("table", shapely.box(0, 0, 2, 1), id=3)
    frame = to_geodataframe(SemanticLayer("objects", "lab", [CUP, other]))
    assert frame.index.tolist() == [7, 3]
    assert frame.index.name == "id"
    assert frame.columns.tolist() == [
        *("name", "tags", "confidence", "existence", "first_seen", "last_seen", "z_max"),
        "geometry",
    ]
    assert frame.loc[7, "tags"] == ["cup", "bowl"]
    assert frame.area.tolist() == [CUP.footprint.area, 2.0]
    assert frame.crs.name == "lab"
    assert frame.crs.axis_info[0].unit_name == "metre"
    empty = to_geodataframe(SemanticLayer("objects", "lab"))
    assert len(empty) == 0


def test_a_missing_geopandas_says_which_extra_brings_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "geopandas", None)
    with pytest.raises(MissingExtra) as error:
        to_geodataframe(LAYER)
    assert str(error.value) == (
        "a GeoDataFrame needs an optional library: pip install 'hypermap[geo]'"
    )
