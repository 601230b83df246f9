from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from hypermap import (
    FormatError,
    FrameTree,
    Hypermap,
    Pose2D,
    SemanticLayer,
    SemanticObject,
    Transform,
    from_geodataframe,
    to_geodataframe,
)
from hypermap.formats.semantic.geopandas_bridge import to_geopackage
from hypermap.testing import assert_same_layer, square

geopandas = pytest.importorskip("geopandas")

CUP = square("cup", 1, 2, id=7, tags=("mug",), confidence=(0.5,), attributes={"z_max": 0.9})
PLAIN = square("table", 3, 0, id=3)
SEEN = square("chair", 5, 5, id=4, existence=2.5, first_seen=1.0, last_seen=9.0)


def layer() -> SemanticLayer:
    return SemanticLayer("objects", "lab", [CUP, PLAIN, SEEN])


def test_a_layer_comes_back_from_a_geodataframe() -> None:
    assert_same_layer(from_geodataframe(to_geodataframe(layer()), "objects"), layer())
    empty = SemanticLayer("objects", "lab")
    assert_same_layer(from_geodataframe(to_geodataframe(empty), "objects"), empty)


@pytest.mark.parametrize("name", ["objects.gpkg", "objects.parquet"])
def test_a_layer_comes_back_from_a_file_of_geopandas(name: str, tmp_path: Path) -> None:
    frame = to_geodataframe(layer())
    if name.endswith("gpkg"):  # which has no lists
        frame = frame.drop(columns=["tags", "confidence"])
        frame.reset_index().to_file(tmp_path / name)
        again = from_geodataframe(geopandas.read_file(tmp_path / name), "objects")
        assert again[7].attributes == CUP.attributes
    else:
        frame.to_parquet(tmp_path / name)
        again = from_geodataframe(geopandas.read_parquet(tmp_path / name), "objects")
        assert_same_layer(again, layer())
    assert again.frame_id == "lab"
    assert again.ids.tolist() == [7, 3, 4]
    assert again[4].existence == 2.5
    assert again[3].existence is None


def test_a_map_is_one_table_in_its_base_frame() -> None:
    frames = FrameTree([Transform("map", "lab", Pose2D(10, 0, math.pi / 2))])
    floor = SemanticLayer("floor", "map", [square("sofa", 0, 0)])
    hypermap = Hypermap([floor, layer()], frames)
    frame = to_geodataframe(hypermap)
    assert frame["layer"].tolist() == ["floor", "objects", "objects", "objects"]
    assert frame.index.tolist() == [0, 7, 3, 4]
    assert frame.crs.name == "map"
    expected = [[item.point_xy[0], item.point_xy[1]] for item in hypermap.objects()]
    np.testing.assert_allclose(shapely.get_coordinates(frame.centroid), expected)
    without_place = to_geodataframe(Hypermap([floor, layer()]))
    assert without_place["layer"].tolist() == ["floor"]
    assert len(to_geodataframe(Hypermap())) == 0


def test_rows_without_ids_are_numbered_by_the_layer() -> None:
    shapes = [shapely.box(0, 0, 1, 1), shapely.box(2, 0, 3, 1)]
    frame = geopandas.GeoDataFrame({"name": ["a", "b"], "room": [1, 2]}, geometry=shapes)
    made = from_geodataframe(frame, "rooms", "map")
    assert (made.name, made.frame_id, made.ids.tolist()) == ("rooms", "map", [0, 1])
    assert made[1].attributes == {"room": 2}


@pytest.mark.parametrize(
    ("change", "frame_id", "message"),
    [
        (lambda frame: frame.set_crs(None, allow_override=True), None,
         "the GeoDataFrame: crs: is missing, because GIS programs omit it; if coordinates are "
         "meters in a frame of the map, name it: --frame map of `hypermap convert`, or "
         "frame_id=\"map\" in Python"),
        (lambda frame: frame.set_crs(4326, allow_override=True), "map",
         "the GeoDataFrame: crs: coordinates are in WGS 84, not in meters in a frame of the map"),
        (lambda frame: frame.set_crs(32632, allow_override=True), None,
         "the GeoDataFrame: crs: coordinates are in WGS 84 / UTM zone 32N, not in meters"),
        (lambda frame: frame.drop(columns="name"), None, "the GeoDataFrame: row 0: name: is requ"),
        (lambda frame: frame.set_geometry(frame.centroid), None,
         "the GeoDataFrame: row 0: a footprint must be a polygon or multipolygon, got Point"),
        (lambda frame: frame.iloc[[0, 1, 0]], None, "the GeoDataFrame: id: the id 7 appears twice"),
        (lambda frame: frame.assign(existence=["much"] * 3), None, "the GeoDataFrame: row 0: exis"),
    ],
)  # fmt: skip
def test_what_is_no_layer_is_refused(change: Any, frame_id: str | None, message: str) -> None:
    with pytest.raises(FormatError) as error:
        from_geodataframe(change(to_geodataframe(layer())), frame_id=frame_id)
    assert str(error.value).startswith(message)


def test_another_frame_may_be_given() -> None:
    frame = to_geodataframe(layer())
    assert from_geodataframe(frame, frame_id="map").frame_id == "map"
    bare = frame.set_crs(None, allow_override=True)
    assert from_geodataframe(bare, frame_id="map").frame_id == "map"


def test_the_points_of_a_geodataframe_are_points() -> None:
    assert layer().label_at(to_geodataframe(layer()).centroid).tolist() == ["cup", "table", "chair"]


def test_an_object_that_was_removed_is_not_in_the_table() -> None:
    things = layer()
    things.remove(3)
    assert to_geodataframe(things).index.tolist() == [7, 4]
    assert isinstance(things[7], SemanticObject)


def test_a_geopackage_holds_what_a_layer_can(tmp_path: Path) -> None:
    things = layer()
    things.add(square("odd", 0, 0, attributes={"z_max": "high", "colors": ["red"], "n": {"a": 1}}))
    (tmp_path / "things.gpkg").write_bytes(to_geopackage(things))
    frame = geopandas.read_file(tmp_path / "things.gpkg", layer="objects")
    assert frame["id"].tolist() == [7, 3, 4, 8]
    assert json.loads(frame["tags"][0]) == ["mug"]
    assert json.loads(frame["colors"][3]) == ["red"]
    assert frame["z_max"].tolist()[0] == "0.9"
    assert frame["z_max"].tolist()[3] == "high"
    for item, geometry in zip(things, frame.geometry, strict=True):
        assert geometry.equals(item.footprint)
    assert frame.crs.name == "lab"


def test_an_empty_layer_is_an_empty_geopackage(tmp_path: Path) -> None:
    (tmp_path / "nothing.gpkg").write_bytes(to_geopackage(SemanticLayer("objects", "lab")))
    assert len(geopandas.read_file(tmp_path / "nothing.gpkg")) == 0


def test_what_a_geopackage_cannot_hold_is_reported() -> None:
    wrong = SemanticLayer("objects", "lab", [square("a", 0, 0, attributes={"fid": "x"})])
    with pytest.raises(FormatError, match="objects: cannot be written as GeoPackage: "):
        to_geopackage(wrong)
