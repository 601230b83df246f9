from __future__ import annotations

import csv
import json
import zipfile

import numpy as np
import pytest
import yaml
from PIL import Image

from hypermap.core.errors import NOT_UTF8
from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.formats import open_map, save_map
from hypermap.formats.grid.map_server import load_occupancy
from hypermap.ros.server.zones import draw, keepout_filter, speed_filter
from hypermap.testing import square

from .conftest import assert_one_error


@pytest.mark.parametrize("name", ["lab", "floor", "office", "example"])
def test_a_real_map_goes_to_a_folder_and_back_without_loss(hypermap, shared_data, tmp_path, name):
    folder, again = tmp_path / name, tmp_path / "again.hmap"
    assert hypermap("convert", shared_data / "maps" / f"{name}.hmap", folder).code == 0
    assert (folder / "hmap_config.yaml").is_file()
    assert hypermap("convert", folder, again).code == 0
    before, after = open_map(shared_data / "maps" / f"{name}.hmap"), open_map(again)
    for one, other in zip(before.layers, after.layers, strict=True):
        if isinstance(one, OccupancyLayer):
            assert isinstance(other, OccupancyLayer)
            assert one.grid == other.grid
            assert one.cells is not None
            assert np.array_equal(one.cells, other.cells)
        else:
            assert isinstance(one, SemanticLayer)
            assert isinstance(other, SemanticLayer)
            assert list(one.names) == list(other.names)
            assert [g.wkb for g in one.geometries] == [g.wkb for g in other.geometries]
            assert one.rejected == other.rejected


def test_objects_go_to_geojson_and_back(hypermap, room_map, tmp_path):
    out, again = tmp_path / "objects.geojson", tmp_path / "objects.hmap"
    result = hypermap("convert", room_map, out)
    assert result.code == 0
    assert result.err == f"left out: layer occupancy, frame room\nsaved {out}\n"
    document = json.loads(out.read_text())
    assert document["frame_id"] == "room"
    names = [feature["properties"]["name"] for feature in document["features"]]
    assert names == ["chair", "chair", "potted plant"]
    assert hypermap("convert", out, again).code == 0
    [layer] = open_map(again).layers
    assert (layer.name, layer.frame_id) == ("semantic", "room")


def test_objects_go_to_yaml_and_back(hypermap, room_map, tmp_path):
    out, again = tmp_path / "objects.yaml", tmp_path / "objects.hmap"
    result = hypermap("convert", room_map, out, "--layer", "semantic")
    assert "the file does not say that its frame is 'room'" in result.err
    assert [entry["name"] for entry in yaml.safe_load(out.read_text())][2] == "potted plant"
    assert hypermap("convert", out, again, "--frame", "room").code == 0
    [layer] = open_map(again).layers
    assert layer.frame_id == "room"


def test_a_grid_goes_to_map_server_and_back(hypermap, room_map, tmp_path):
    out, again = tmp_path / "grid.yaml", tmp_path / "grid.hmap"
    assert hypermap("convert", room_map, out, "--layer", "occupancy").code == 0
    assert yaml.safe_load(out.read_text())["image"] == "grid.png"
    assert hypermap("convert", out, again).code == 0
    one, other = open_map(room_map)["occupancy"], open_map(again)["occupancy"]
    assert isinstance(one, OccupancyLayer)
    assert isinstance(other, OccupancyLayer)
    assert one.cells is not None
    assert np.array_equal(one.cells, other.cells)


def test_objects_that_could_not_be_read_are_named_as_left_out(hypermap, shared_data, tmp_path):
    result = hypermap("convert", shared_data / "maps" / "office.hmap", tmp_path / "x.geojson")
    assert "left out: 1 object that could not be read" in result.err


def test_names_in_another_encoding_are_not_guessed(hypermap, room_map, tmp_path):
    out, latin = tmp_path / "objects.geojson", tmp_path / "latin.geojson"
    assert hypermap("convert", room_map, out).code == 0
    text = out.read_text().replace("potted plant", "Büropflanze")
    latin.write_bytes(text.encode("latin-1"))
    assert_one_error(hypermap("convert", latin, tmp_path / "x.hmap"), f"{latin}: {NOT_UTF8}")
    latin.write_text(text, encoding="utf-8-sig")
    assert hypermap("convert", latin, tmp_path / "x.hmap").code == 0
    [layer] = open_map(tmp_path / "x.hmap").layers
    assert "Büropflanze" in [item.name for item in layer.objects()]


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (
            ["x.shp"],
            "unknown file extension '.shp'; known: .hmap, .geojson, .parquet, .gpkg",
        ),
        (["x.yaml"], "choose with --layer occupancy or --layer semantic"),
        (["x.geojson", "--layer", "occupancy"], "can hold the objects of one layer, but there is"),
        (["x.hmap", "--layer", "rooms"], "there is no layer 'rooms'"),
        (["x.hmap", "--frame", "map"], "a whole map names its own frames; leave out --frame"),
        (["no/x.hmap"], "does not exist; create it first"),
    ],
)
def test_what_cannot_be_converted_is_said_so(
    hypermap, room_map, tmp_path, monkeypatch, arguments, reason
):
    monkeypatch.chdir(tmp_path)
    assert_one_error(hypermap("convert", room_map, *arguments), reason)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("bad.geojson", b"{"),
        ("bad.geojson", b'{"type": "Feature"}'),
        ("noframe.geojson", b'{"type": "FeatureCollection", "features": []}'),
        ("bad.yaml", b"- ["),
        ("objects.yaml", b"!!python/object/apply:os.system [ls]"),
        ("words.yaml", b"hello"),
        ("grid.yaml", b"image: nowhere.png\nresolution: 0.1\norigin: [0, 0, 0]\n"),
    ],
)
def test_a_bad_input_names_the_file(hypermap, tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    assert_one_error(hypermap("convert", tmp_path / name, tmp_path / "out.hmap"), name)
    assert not (tmp_path / "out.hmap").exists()


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("floor.pgm", "is a picture; give the map_server YAML file that names it"),
        ("floor.TIF", ".TIF files can be written, but not read"),
    ],
)
def test_what_is_only_written_is_said_so(hypermap, tmp_path, name, message):
    (tmp_path / name).write_bytes(b"P5 1 1 255 x")
    assert_one_error(hypermap("convert", tmp_path / name, tmp_path / "a.hmap"), name, message)


def test_no_folder_is_made_for_standard_output(hypermap, room_map, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert_one_error(hypermap("convert", room_map, "-"), "not written to standard output")
    assert list(tmp_path.glob("-")) == []


def test_what_exists_is_replaced_only_by_force(hypermap, room_map, tmp_path):
    folder = tmp_path / "folder"
    folder.mkdir()
    for name in ("x.hmap", "x.geojson", "objects.yaml", "grid.png", "folder/precious"):
        (tmp_path / name).write_text("precious")
    for arguments in (
        ["x.hmap"],
        ["x.geojson"],
        ["objects.yaml", "--layer", "semantic"],
        ["grid.yaml", "--layer", "occupancy"],
        ["folder"],
    ):
        target = tmp_path / arguments[0]
        assert_one_error(hypermap("convert", room_map, target, *arguments[1:]), "--force")
        assert not target.is_file() or target.read_text() == "precious"
        assert hypermap("convert", room_map, target, *arguments[1:], "--force").code == 0
    assert (folder / "precious").read_text() == "precious"


def test_a_grid_in_capitals_does_not_replace_another(hypermap, room_map, tmp_path):
    (tmp_path / "MAP.yaml").write_text("precious")
    result = hypermap("convert", room_map, tmp_path / "MAP.YAML", "--layer", "occupancy")
    assert_one_error(result, "MAP.YAML: a grid is saved as MAP.yaml")
    assert (tmp_path / "MAP.yaml").read_text() == "precious"


def test_objects_go_to_parquet_and_back(hypermap, room_map, tmp_path):
    geopandas = pytest.importorskip("geopandas")
    out, again = tmp_path / "objects.parquet", tmp_path / "objects.hmap"
    result = hypermap("convert", room_map, out)
    assert result.code == 0
    assert result.err == f"left out: layer occupancy, frame room\nsaved {out}\n"
    frame = geopandas.read_parquet(out)
    assert (list(frame.name), frame.crs.name) == (["chair", "chair", "potted plant"], "room")
    assert hypermap("convert", out, again).code == 0
    [layer] = open_map(again).layers
    assert layer.frame_id == "room"
    assert list(layer.ids) == list(open_map(room_map)["semantic"].ids)


@pytest.mark.parametrize("kind", ["geojson", "parquet"])
def test_files_that_gis_programs_have_saved_say_their_frame_or_need_one(
    hypermap, room_map, tmp_path, kind
):
    geopandas = pytest.importorskip("geopandas")
    ours, theirs, made = (tmp_path / name for name in (f"a.{kind}", f"b.{kind}", "c.hmap"))
    assert hypermap("convert", room_map, ours).code == 0
    read = geopandas.read_file if kind == "geojson" else geopandas.read_parquet
    frame = read(ours)
    for crs in (None, "EPSG:4326", "EPSG:32632"):
        # Written as GeoJSON, our own system is left out.
        is_left_out = crs is None and kind == "geojson"
        there = frame if is_left_out else frame.set_crs(crs, allow_override=True)
        if kind == "geojson":
            there.to_file(theirs)
        else:
            there.to_parquet(theirs)
        if crs is not None:
            for options in ([], ["--frame", "room"]):
                refused = hypermap("convert", theirs, made, *options)
                assert_one_error(refused, str(theirs), "not in meters in a frame of the map")
            continue
        assert_one_error(
            hypermap("convert", theirs, made), str(theirs), "crs: is missing", "--frame"
        )
        assert hypermap("convert", theirs, made, "--frame", "room").code == 0
        [layer] = open_map(made).layers
        assert layer.frame_id == "room"
        expected = [shape.area for shape in open_map(room_map)["semantic"].geometries]
        assert [shape.area for shape in layer.geometries] == pytest.approx(expected)


@pytest.mark.parametrize("target", ["fast.hmap", "folder"])
def test_a_map_keeps_its_objects_as_asked(hypermap, room_map, tmp_path, target):
    pytest.importorskip("pyarrow")
    fast, plain = tmp_path / target, tmp_path / "plain.hmap"
    assert hypermap("convert", room_map, fast, "--semantic", "parquet").code == 0
    assert hypermap("convert", fast, plain).code == 0
    assert list(open_map(fast)["semantic"].ids) == list(open_map(room_map)["semantic"].ids)
    with zipfile.ZipFile(plain) as archive:
        assert not any(name.endswith(".parquet") for name in archive.namelist())
    if target == "fast.hmap":
        with zipfile.ZipFile(fast) as archive:
            assert any(name.endswith(".parquet") for name in archive.namelist())


def test_a_broken_parquet_file_is_named(hypermap, tmp_path):
    (tmp_path / "bad.parquet").write_bytes(b"PAR1 and nothing else")
    result = hypermap("convert", tmp_path / "bad.parquet", tmp_path / "out.hmap")
    assert_one_error(result, "bad.parquet: is not an intact Parquet file")


def test_objects_go_to_a_table_for_spreadsheets(hypermap, room_map, tmp_path):
    out = tmp_path / "objects.csv"
    result = hypermap("convert", room_map, out)
    assert result.err == f"left out: layer occupancy, frame room\nsaved {out}\n"
    with out.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["id"], row["name"]) for row in rows] == [
        ("0", "chair"),
        ("1", "chair"),
        ("2", "potted plant"),
    ]
    assert (rows[1]["x"], rows[1]["y"], rows[1]["area"]) == ("4.5", "0.5", "1.0")
    assert (rows[1]["existence"], rows[1]["z_max"], rows[0]["z_max"]) == ("3.5", "0.9", "")
    assert_one_error(hypermap("convert", room_map, out), "--force")


def test_objects_go_to_a_geopackage(hypermap, room_map, tmp_path):
    geopandas = pytest.importorskip("geopandas")
    out = tmp_path / "objects.gpkg"
    assert hypermap("convert", room_map, out).code == 0
    frame = geopandas.read_file(out, layer="semantic")
    assert frame["name"].tolist() == ["chair", "chair", "potted plant"]
    assert frame["id"].tolist() == [0, 1, 2]
    assert frame.area.tolist() == [1, 1, 1]
    assert frame.crs.name == "room"


def test_a_grid_goes_to_a_pgm_of_three_shades_as_map_saver_writes_it(hypermap, tmp_path):
    values = np.array([[-1, 0, 19, 20], [65, 66, 100, 0]], dtype=np.int8)
    grid = GridGeometry(4, 2, 0.05, Pose2D(-1.0, 2.0, 0.5))
    save_map(Hypermap([OccupancyLayer("floor", "map", grid, values)]), tmp_path / "in.hmap")
    result = hypermap("convert", tmp_path / "in.hmap", tmp_path / "map.pgm")
    assert result.code == 0
    assert "rounded to free, occupied or unknown: 4 cells" in result.err
    head, pixels = (tmp_path / "map.pgm").read_bytes().split(b"\n255\n")
    assert head == b"P5\n4 2"
    assert list(pixels) == [205, 0, 0, 254, 205, 254, 254, 205]  # the upper row first
    described = yaml.safe_load((tmp_path / "map.yaml").read_text())
    assert described == {
        "image": "map.pgm",
        "resolution": 0.05,
        "origin": [-1.0, 2.0, 0.5],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
    }
    again = load_occupancy(tmp_path / "map.yaml")
    assert again.cells is not None
    assert again.grid == grid
    assert again.cells.tolist() == [[-1, 0, 0, -1], [-1, 100, 100, 0]]


def test_a_pgm_replaces_neither_file_unless_forced(hypermap, room_map, tmp_path):
    (tmp_path / "map.yaml").write_text("precious")
    out = tmp_path / "map.pgm"
    assert_one_error(hypermap("convert", room_map, out), str(tmp_path / "map.yaml"), "--force")
    assert not out.exists()
    assert (tmp_path / "map.yaml").read_text() == "precious"
    assert hypermap("convert", room_map, out, "--force").code == 0
    assert load_occupancy(tmp_path / "map.yaml").counts()["Free"] > 0


@pytest.mark.parametrize(
    ("layer", "message"),
    [
        (OccupancyLayer("floor", "map"), "layer 'floor' is empty: there is no grid to save"),
        (
            OccupancyLayer("floor", "map", GridGeometry(1, 1, 1.0), np.array([[200]])),
            "layer 'floor' is a raw map, of values up to 200",
        ),
        (SemanticLayer("floor", "map"), "can hold one grid, but there is none"),
    ],
)
def test_what_is_no_grid_of_three_shades_is_not_saved_as_such(hypermap, tmp_path, layer, message):
    save_map(Hypermap([layer]), tmp_path / "in.hmap")
    result = hypermap("convert", tmp_path / "in.hmap", tmp_path / "map.pgm")
    assert_one_error(result, message)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["in.hmap"]


def test_a_grid_goes_to_geotiff(hypermap, room_map, tmp_path):
    out = tmp_path / "map.tif"
    result = hypermap("convert", room_map, out)
    assert (result.code, result.err) == (0, f"left out: layer semantic, frame room\nsaved {out}\n")
    layer = open_map(room_map)["occupancy"]
    with Image.open(out) as picture:
        assert np.array_equal(np.asarray(picture)[::-1], layer.cells)
    assert_one_error(hypermap("convert", room_map, out), "give --force to replace it")
    objects = hypermap("convert", room_map, tmp_path / "o.tif", "--layer", "semantic")
    assert_one_error(objects, "can hold one grid, but there is none")


def read_as_nav2(path):
    """Return what nav2's map_server publishes of a raw map: map_io.cpp, loadMapFromFile."""
    described = yaml.safe_load(path.read_text())
    assert described["mode"] == "raw"
    for key in ("resolution", "origin", "free_thresh", "occupied_thresh", "negate"):
        assert key in described
    with Image.open(path.parent / described["image"]) as picture:
        shades = np.asarray(picture).astype(int)
    return np.where(shades <= 100, shades, -1)[::-1], described


def test_the_origin_of_a_mask_is_written_as_a_person_would(hypermap, tmp_path):
    things = SemanticLayer("semantic", "map", [square("cup", 0.35, 0.35)])
    save_map(Hypermap([things]), tmp_path / "cups.hmap")
    out = tmp_path / "keepout.yaml"
    result = hypermap("convert", tmp_path / "cups.hmap", out, "--keepout", "cup 0.2")
    assert result.code == 0, result.err
    origin = yaml.safe_load(out.read_text())["origin"]
    assert origin == [-0.35, -0.35, 0]  # -7 * 0.05 is -0.35000000000000003


@pytest.mark.parametrize(
    ("options", "zones"),
    [
        (["--keepout", "chair 0.3"], keepout_filter(["chair 0.3"])),
        (
            ["--keepout", "chair 0.3", "--keepout", "potted plant 1"],
            keepout_filter(["chair 0.3", "potted plant 1"]),
        ),
        (["--speed", "chair 0.5 50%"], speed_filter(["chair 0.5 50%"])),
        (
            ["--speed", "chair 0.5 0.3m/s", "--speed", "potted plant 2 0.6m/s"],
            speed_filter(["chair 0.5 0.3m/s", "potted plant 2 0.6m/s"]),
        ),
    ],
)
def test_masks_are_saved_as_nav2_loads_them(hypermap, room_map, tmp_path, options, zones):
    out = tmp_path / "mask.yaml"
    result = hypermap("convert", room_map, out, *options)
    assert result.code == 0, result.err
    mask = draw(open_map(room_map), zones)
    cells, described = read_as_nav2(out)
    assert (mask.cells != zones.outside).any()
    assert np.array_equal(cells, mask.cells)
    assert described["resolution"] == mask.grid.resolution
    assert described["origin"] == [mask.grid.origin.x, mask.grid.origin.y, 0]
    parameters = yaml.safe_load((tmp_path / "mask_params.yaml").read_text())
    served, answer = (
        parameters[f"{zones.name}_{node}"]["ros__parameters"]
        for node in ("filter_mask_server", "costmap_filter_info_server")
    )
    assert served == {
        "yaml_filename": str(out),
        "topic_name": answer["mask_topic"],
        "frame_id": "map",
    }
    assert answer == {
        "type": zones.type,
        "filter_info_topic": f"/{zones.name}_filter_info",
        "mask_topic": f"/{zones.name}_mask",
        "base": zones.base,
        "multiplier": zones.multiplier,
    }


def test_a_mask_may_have_a_grid_of_its_own(hypermap, room_map, tmp_path):
    out = tmp_path / "mask.pgm"
    options = ("--keepout", "potted plant 0.5", "--mask-resolution", "0.1")
    assert hypermap("convert", room_map, out, *options).code == 0
    cells, described = read_as_nav2(out.with_suffix(".yaml"))
    assert (described["resolution"], cells.shape) == (0.1, (20, 20))


def test_a_class_without_objects_is_reported_of_and_may_be_marked_later(
    hypermap, room_map, tmp_path
):
    result = hypermap("convert", room_map, tmp_path / "mask.yaml", "--keepout", "chiar 0.3")
    assert result.code == 0
    assert "no object is called 'chiar'; did you mean 'chair'?" in result.err
    assert (read_as_nav2(tmp_path / "mask.yaml")[0] == -1).all()


@pytest.mark.parametrize(
    ("out", "options", "message"),
    [
        ("m.yaml", ["--keepout", "chair"], "keepout: 'chair' is not a zone; expected a class and"),
        ("m.yaml", ["--speed", "chair 1 0%"], "a limit must be above 0"),
        ("m.yaml", ["--keepout", "chair 1", "--speed", "chair 1 9%"], "one file holds one mask"),
        ("m.yaml", ["--mask-resolution", "0.1"], "give either --keepout or --speed"),
        ("m.yaml", ["--keepout", "chair 1", "--mask-resolution", "-1"], "--mask-resolution: "),
        ("m.geojson", ["--keepout", "chair 1"], "a mask is saved as .yaml"),
    ],
)
def test_what_is_no_mask_is_said_so(hypermap, room_map, tmp_path, out, options, message):
    assert_one_error(hypermap("convert", room_map, tmp_path / out, *options), message)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["m.yaml", "m.pgm", "m_params.yaml"])
def test_a_mask_replaces_none_of_its_files_unless_forced(hypermap, room_map, tmp_path, name):
    (tmp_path / name).write_text("precious")
    asked = ("convert", room_map, tmp_path / "m.yaml", "--keepout", "chair 1")
    assert_one_error(hypermap(*asked), name, "--force")
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text() == "precious"
    assert hypermap(*asked, "--force").code == 0
