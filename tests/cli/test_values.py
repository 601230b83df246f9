"""`hypermap values`: samples become a layer that commands ask, draw and convert."""

from __future__ import annotations

import csv
import json
import re

import numpy as np
import pytest
import shapely
from PIL import Image

from hypermap import (
    FrameTree,
    GridGeometry,
    Hypermap,
    OccupancyLayer,
    Pose2D,
    SemanticLayer,
    SemanticObject,
    Transform,
    ValueLayer,
    open_map,
    save_map,
)
from hypermap.questions import cells
from hypermap.values import Samples
from hypermap.viewer.picture import compose

from ..prepared import run
from ..recordings.test_samples import START, BagBuilder, add_drive, add_temperature
from .conftest import assert_one_error

SETTINGS = ("--length-scale", "3", "--deviation", "4", "--sensor-noise", "0.2")


def assert_last_error(result, said):
    """Assert that a command ended with one error, after it had said what it was doing."""
    assert result.code == 2
    assert result.out == ""
    last = result.err.splitlines()[-1]
    assert last.startswith("hypermap: error: ")
    assert said in last


@pytest.fixture(scope="module")
def flat(tmp_path_factory):
    """Two rooms of 4 x 4 m with a wall between them, and a desk in each."""
    cells = np.zeros((40, 82), dtype=np.int8)
    cells[:, 40:42] = 100
    layers = [
        OccupancyLayer("occupancy", "map", GridGeometry(82, 40, 0.1), cells),
        SemanticLayer(
            "things",
            "map",
            [
                SemanticObject("desk", shapely.box(0.5, 0.5, 1.5, 1)),
                SemanticObject("desk", shapely.box(6, 0.5, 7, 1)),
            ],
        ),
        SemanticLayer(
            "rooms",
            "map",
            [
                SemanticObject("kitchen", shapely.box(0, 0, 4, 4)),
                SemanticObject("cellar", shapely.box(4.2, 0, 8.2, 4)),
            ],
        ),
    ]
    path = tmp_path_factory.mktemp("flat") / "flat.hmap"
    save_map(Hypermap(layers), path)
    return path


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """Samples in degF: 24 degC in the left room, 12 degC in the right one."""
    points = np.random.default_rng(2).uniform([0.2, 0.2], [8, 3.8], (60, 2))
    path = tmp_path_factory.mktemp("samples") / "temperature.csv"
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["x", "y", "value", "stamp"])
        for i, (x, y) in enumerate(points.round(3).tolist()):
            rows.writerow([x, y, 75.2 if x < 4 else 53.6, 1000 + i])
    return path


@pytest.fixture(scope="module")
def warm(flat, table, tmp_path_factory):
    """The map with the temperatures, made once by the command.

    In a process of its own: loggers that it set up here would stay so for all later tests.
    """
    path = tmp_path_factory.mktemp("warm") / "warm.hmap"
    units = ["--sample-unit", "degF", "--unit", "degC", *SETTINGS]
    run("values", table, "--onto", flat, "-o", path, *units).check_returncode()
    return path


def test_samples_of_a_table_become_a_layer_in_another_unit(warm):
    layer = open_map(warm)["temperature"]
    assert isinstance(layer, ValueLayer)
    assert layer.unit == "°C"
    np.testing.assert_allclose(layer.value_at([[1, 2], [3.8, 2], [4.4, 2]]), [24, 24, 12], atol=0.5)
    assert layer.samples is not None
    assert layer.samples.stamps.min() == 1000
    assert layer.made_by == {
        "method": "gmrf",
        "length": 3.0,
        "deviation": 4.0,
        "noise": 0.2,
        "through_walls": 0.0,
        "away_from_walls": 1.0,
        "occupancy": "occupancy",
    }


def test_the_coldest_room_and_the_places_and_desks_that_are_warm(hypermap, warm):
    def rows(*question):
        return hypermap("query", warm, *question, "--json").json["answers"]

    coldest, _ = rows("--layer", "rooms", "--measured", "temperature")
    assert coldest["label"] == "cellar"
    assert coldest["measured"]["mean"] == pytest.approx(12, abs=0.5)
    (desk,) = rows("--name", "desk", "--measured", "temperature", "--above", "20")
    assert desk["x"] == pytest.approx(1)
    (place,) = rows("--above", "20")
    assert place["label"] == "above 20 °C"
    assert shapely.from_wkt(place["outline"]).area == pytest.approx(place["area"]) == 16
    assert rows("--above", "20", "--in", "cellar") == []
    (near,) = rows("--layer", "temperature", "--below", "20", "--nearest", "--from", "1,2")
    assert near["x"] == pytest.approx(4.375)
    assert near["distance"] == pytest.approx(np.hypot(3.375, near["y"] - 2))
    (point,) = rows("--layer", "temperature", "--at", "1,2")
    assert (point["unit"], point["deviation"] < 2) == ("°C", True)


def test_of_very_many_cells_the_mean_and_range_are_told(hypermap, warm, monkeypatch):
    area = warm, "--in", "0,0,3,3", "--layer", "temperature"
    listed = hypermap("query", *area)
    rows = hypermap("query", *area, "--json").json["answers"]
    monkeypatch.setattr(cells, "MOST_LISTED", 20)
    (one,) = hypermap("query", *area, "--json").json["answers"]
    assert one["cells"] == len(rows)
    assert one["value"] == pytest.approx(np.mean([row["value"] for row in rows]))
    assert [one["min"], one["max"]] == pytest.approx(
        [extreme(row["value"] for row in rows) for extreme in (min, max)]
    )
    told = hypermap("query", *area).out
    numbers = [re.findall(r"[\d.]+", text) for text in (listed.out, told)]
    assert [float(n) for n in numbers[1]] == pytest.approx([float(n) for n in numbers[0]], abs=0.1)


def test_answers_are_tables_of_few_lines(hypermap, warm):
    said = hypermap("query", warm, "--layer", "rooms", "--measured", "temperature").out
    assert said.splitlines()[0].split() == ["layer", "label", "measured", "value", "x", "y"]
    said = hypermap("query", warm, "--in", "kitchen", "--layer", "temperature").out
    assert said.startswith("temperature: 23.")
    assert said.endswith("in 256 cells\n")
    said = hypermap("query", warm, "--in", "20,20,21,21", "--layer", "temperature")
    assert "nothing found" in said.err
    shell = hypermap("shell", warm, stdin="query --layer rooms --measured temperature\n").out
    assert shell.index("cellar") < shell.index("kitchen")


@pytest.mark.parametrize(
    ("question", "said"),
    [
        (["--above", "20", "--name", "desk"], "give --measured LAYER, too"),
        (["--above", "20", "--within", "2"], "give --measured LAYER, too"),
        (["--above", "20", "--layer", "things"], "which holds no measured values"),
        (["--measured", "temperature"], "there is no query"),
        (["--name", "desk", "--measured", "warmth"], "there is no layer 'warmth'"),
        (["--at", "1,1", "--above", "3"], "--at queries a point"),
        (["--above", "20", "--layer", "things", "--layer", "rooms"], "need a single layer"),
    ],
)
def test_a_question_without_a_meaning_is_refused(hypermap, warm, question, said):
    assert_one_error(hypermap("query", warm, *question), said)


def test_info_and_pictures_show_the_layer(hypermap, warm, tmp_path):
    (answer,) = (
        layer
        for layer in hypermap("info", warm, "--json").json["layers"]
        if layer["class"] == "ValueLayer"
    )
    assert (answer["unit"], answer["samples"]) == ("°C", 60)
    assert answer["max"] == pytest.approx(24, abs=0.5)
    picture = tmp_path / "warm.svg"
    assert hypermap("render", warm, "-o", picture).code == 0
    assert "°C" in picture.read_text(encoding="utf-8")
    plain, lines = tmp_path / "plain.png", tmp_path / "lines.png"
    assert hypermap("render", warm, "-o", plain, "--layer", "temperature").code == 0
    assert hypermap("render", warm, "-o", lines, "--layer", "temperature", "--contours").code == 0
    assert plain.read_bytes() != lines.read_bytes()
    result = hypermap("render", warm, "-o", lines, "--layer", "things", "--contours")
    assert_one_error(result, "none of these layers has measured values")


def test_walls_stay_visible_above_values_and_rooms_are_lines(warm):
    drawing = compose(open_map(warm))
    occupancy, _ = drawing.rasters
    (walls,) = drawing.walls
    is_wall = open_map(warm).occupancy().cells == 100
    assert np.array_equal(walls.picture.rgba[..., 3] > 0, is_wall)
    assert (occupancy.picture.rgba[..., 3] > 0).all()
    assert {part.layer: part.are_outlines for part in drawing.shapes} == {
        "rooms": True,
        "things": False,
    }
    assert compose(open_map(warm), layers=["occupancy", "rooms"]).walls == ()


def test_the_layer_is_converted_with_its_unit(hypermap, warm, tmp_path):
    rasterio = pytest.importorskip("rasterio")
    target = tmp_path / "warm.tif"
    assert hypermap("convert", warm, target, "--layer", "temperature").code == 0
    layer = open_map(warm)["temperature"]
    with Image.open(target) as image:
        np.testing.assert_array_equal(np.asarray(image)[::-1], layer.cells)
    with rasterio.open(target) as band:  # as programs of geographic information systems read it
        assert (band.units, band.descriptions) == (("°C",), ("temperature",))
    target = tmp_path / "warm.csv"
    assert hypermap("convert", warm, target, "--layer", "temperature").code == 0
    with target.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == np.count_nonzero(~np.isnan(layer.cells))
    places = [(float(row["x"]), float(row["y"])) for row in rows]
    assert [np.float32(row["value"]) for row in rows] == layer.value_at(places).tolist()
    assert {row["unit"] for row in rows} == {"°C"}


def test_a_layer_is_made_again_and_gets_more_samples(hypermap, warm, table, tmp_path):
    again = tmp_path / "again.hmap"
    answer = hypermap("values", warm, "--method", "nearest", "-o", again, "--json").json
    assert (answer["samples"], answer["made_by"]["method"], answer["unit"]) == (60, "nearest", "°C")
    assert [layer.name for layer in open_map(again)] == [layer.name for layer in open_map(warm)]
    joined, later = tmp_path / "joined.hmap", tmp_path / "later.csv"
    # Ten samples are those of the map, the others were taken elsewhere at the same times.
    head, *rows = table.read_text().splitlines()
    moved = [f"{float(x) - 0.01:.3f},{rest}" for x, rest in (row.split(",", 1) for row in rows)]
    later.write_text("\n".join([head, *rows[:10], *moved[10:]]))
    more = (later, "--onto", warm, "-o", joined, "--sample-unit", "degF", "--json")
    added = hypermap("values", *more, "--add", "--method", "nearest", "--quantity", "temperature")
    assert "temperature: 10 samples already in the map" in added.err
    answer = added.json
    assert (answer["samples"], answer["unit"]) == (110, "°C")
    assert answer["max"] == pytest.approx(24)
    assert_one_error(
        hypermap("values", *more, "--force", "--quantity", "temperature"),
        "already has a layer 'temperature'; give --add",
    )


def test_corrected_poses_move_the_samples_of_their_time(hypermap, warm, tmp_path):
    poses, moved = tmp_path / "poses.txt", tmp_path / "moved.hmap"
    poses.write_text("".join(f"{1000 + i} {1 + 0.1 * i} 2 0 0 0 0 1\n" for i in range(11)))
    result = hypermap("values", warm, "--poses", poses, "--method", "nearest", "-o", moved)
    assert result.code == 0, result.err
    assert "49 samples without a pose in" in result.err
    before, after = (open_map(path)["temperature"].samples for path in (warm, moved))
    np.testing.assert_allclose(after.points_xy[:11], [[1 + 0.1 * i, 2] for i in range(11)])
    np.testing.assert_array_equal(after.points_xy[11:], before.points_xy[11:])
    poses.write_text("1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n")
    said = "has no pose at the time of any sample"
    assert_one_error(hypermap("values", warm, "--poses", poses, "-o", tmp_path / "x.hmap"), said)


def test_old_samples_count_less_where_that_is_asked(hypermap, tmp_path):
    samples, again = tmp_path / "samples.csv", tmp_path / "again.hmap"
    rows = "\n".join(
        f"{x},{y},{20 + 5 * t},{3600 * t}" for x in (0, 1) for y in (0, 1) for t in (0, 1)
    )
    samples.write_text(f"x,y,value,stamp\n{rows}\n")
    made = ("values", samples, *SETTINGS, "-o", again, "--json", "--force")
    assert hypermap(*made).json["max"] == pytest.approx(22.5, abs=0.1)
    answer = hypermap(*made, "--half-life", "600").json
    assert answer["min"] == pytest.approx(25, abs=0.3)
    assert answer["made_by"]["half_life"] == 600


def test_samples_of_a_bag_become_a_layer(hypermap, flat, tmp_path):
    with BagBuilder(tmp_path, "ros1") as bag:
        add_drive(bag)
        for tenth in range(35):
            add_temperature(bag, tenth / 10, 290 + tenth)
        add_temperature(bag, 60, 0)
    out = tmp_path / "out.hmap"
    result = hypermap(
        "values", bag.path, "--topic", "/warmth", "--onto", flat, "-o", out, "--unit", "K",
        *SETTINGS,
    )  # fmt: skip
    assert result.code == 0, result.err
    assert "left out: 1 sample without a pose at their time" in result.err
    assert "reading: 36 messages" in result.err
    layer = open_map(out)["temperature"]
    assert isinstance(layer, ValueLayer)
    assert layer.value_at([2.5, 1])[0] == pytest.approx(310 + 273.15, abs=1.5)


def test_a_map_frame_of_another_name_in_tf_is_that_of_the_map(hypermap, flat, tmp_path):
    with BagBuilder(tmp_path, "mcap") as bag:
        for second in range(4):
            bag.add_tf("/tf", START + second * 10**9, "world", "sensor", (second, 1, 0))
        for second in range(3):
            add_temperature(bag, second, 20 + second)
    out = tmp_path / "out.hmap"
    ways = (bag.path, "--topic", "/warmth", "--onto", flat, "-o", out, "--method", "nearest")
    assert_last_error(hypermap("values", *ways), "tf has no frame 'map'; it has world, sensor")
    assert hypermap("values", *ways, "--map-frame", "world").code == 0
    assert open_map(out)["temperature"].frame_id == "map"
    assert open_map(out).value_at("temperature", [[2, 1]]).tolist() == [22]


def test_kept_samples_in_another_frame_are_brought_to_that_of_the_walls(hypermap, tmp_path):
    samples = Samples.of([[1, 0.5]], [7.0])
    layer = ValueLayer("noise", "lab", GridGeometry(4, 4, 1.0), np.ones((4, 4)), samples=samples)
    walls = OccupancyLayer("occupancy", "map", GridGeometry(20, 20, 1.0), np.zeros((20, 20), int))
    frames = FrameTree([Transform("map", "lab", Pose2D(x=10))])
    save_map(Hypermap([walls, layer], frames), tmp_path / "in.hmap")
    out = tmp_path / "out.hmap"
    assert hypermap("values", tmp_path / "in.hmap", "-o", out, "--method", "nearest").code == 0
    assert open_map(out)["noise"].frame_id == "map"
    assert open_map(out).value_at("noise", [[11, 0.5]]).tolist() == [7]


def test_a_bag_places_the_samples_of_a_table(hypermap, flat, tmp_path):
    with BagBuilder(tmp_path, "mcap") as bag:
        add_drive(bag)
    log = tmp_path / "co2.csv"
    log.write_text("stamp,ppm\n" + "".join(f"{START / 1e9 + i},{400 + i}\n" for i in range(4)))
    out = tmp_path / "out.hmap"
    ways = ("--field", "ppm", "--method", "nearest", "--onto", flat, "-o", out, "--json")
    answer = hypermap("values", bag.path, "--samples", log, "--unit", "ppm", *ways).json
    assert (answer["layer"], answer["samples"], answer["min"], answer["max"]) == (
        "ppm",
        4,
        400,
        403,
    )


def test_a_trajectory_places_them_too_and_without_a_map_there_are_no_walls(hypermap, tmp_path):
    poses = tmp_path / "groundtruth.txt"
    poses.write_text("1 0 0 0 0 0 0 1\n1.5 2 0 0 0 0 0 1\n")
    log = tmp_path / "light.csv"
    log.write_text("stamp,value\n1.25,300\n")
    out = tmp_path / "out.hmap"
    result = hypermap("values", poses, "--samples", log, "-o", out, "--method", "nearest")
    assert "so there are no walls" in result.err
    assert open_map(out).value_at("light", [[1, 0]]).tolist() == [300]


def test_what_was_not_heard_is_reported(hypermap, flat, tmp_path):
    log = tmp_path / "wifi.csv"
    unheard = "".join(f"{3 + 0.1 * i},{1 + 0.1 * i},{['', '-99'][i % 2]}\n" for i in range(8))
    log.write_text(f"x,y,value\n1,1,-50\n2,1,-60\n2.5,1,-70\n{unheard}")
    out = tmp_path / "out.hmap"
    ways = (log, "--onto", flat, "-o", out, "--unit", "dBm", "--method", "gmrf")
    censored = ("--censored-below", "-95", "--length-scale", "3", "--deviation", "15")
    result = hypermap("values", *ways, *censored, "--sensor-noise", "2")
    assert "below the limit: 8 samples" in result.out
    at = json.loads(hypermap("query", out, "--layer", "wifi", "--at", "3.2,1.2", "--json").out)
    assert at["answers"][0]["value"] < -75


@pytest.mark.parametrize(
    ("text", "options", "said"),
    [
        (
            "x,y,value\n1,1,20\n",
            [],
            "1 sample with a value is too few to estimate",
        ),
        ("x,y,value\n1,1,-99\n", ["--censored-below", "-95"], "no sample of 1 has a value"),
        ("x,y,value\n99,1,20\n", [], "no sample of 1 is on the map, which reaches from"),
        ("x,y,value\n1,1,20\n", ["--resolution", "0", "--method", "nearest"], "resolution must be"),
        ("x,y,value\n1,1,nan\n", [], "no usable sample: 1 sample without a number"),
        ("x,y,value\n1,1,20\n", ["--method", "krig"], "expected one of gmrf, kernel, nearest"),
        (
            "x,y,value\n1,1,20\n",
            ["--length-scale", "3"],
            "needs all of --length-scale, --deviation",
        ),
        ("x,y,value\n1,1,20\n", ["--sample-unit", "V", "--unit", "K"], "cannot be converted to"),
        ("x,y,value\n1,1,20\n", ["--add"], "the map has no layer 'samples' yet"),
        ("x,y,value\n1,1,20\n", ["--topic", "/t"], "give either --topic or"),
        ("x,y,value\n1,1,20\n", ["--quantity", "things", "--add"], "holds no measured values"),
    ],
)
def test_bad_input_is_one_error_and_saves_nothing(hypermap, flat, tmp_path, text, options, said):
    (tmp_path / "samples.csv").write_text(text)
    out = tmp_path / "out.hmap"
    files = (tmp_path / "samples.csv", "--onto", flat, "-o", out)
    assert_last_error(hypermap("values", *files, *options), said)
    assert not out.exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "no samples: give a table"),
        (["drive.bag"], "drive.bag: give --topic TOPIC"),
        (["drive.bag", "--topic", "/t"], "give -o OUT.hmap"),
        (["drive.bag", "--topic", "/t", "-o", "x.hmap"], "drive.bag: there is no such file"),
        (["a.csv", "-o", "x.yaml"], "is saved as .hmap"),
        (["a.csv", "--poses", "p.txt", "-o", "x.hmap"], "--poses corrects the samples of a map"),
    ],
)
def test_what_is_missing_is_asked_for(hypermap, arguments, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert_one_error(hypermap("values", *arguments), said)


def test_a_file_of_another_kind_is_refused(hypermap, flat, tmp_path):
    foreign = tmp_path / "office.png"
    foreign.write_bytes(b"PNG")
    out = ("-o", tmp_path / "out.hmap")
    result = hypermap("values", foreign, "--topic", "/t", *out)
    assert_one_error(result, "office.png: expected a table of samples (.csv), a bag")
    result = hypermap("values", foreign, "--samples", foreign, *out)
    assert_one_error(result, "office.png: expected a bag (.bag, .mcap, .db3 or a folder) or a traj")
    assert_one_error(hypermap("values", flat, *out), f"{flat}: the map has no layer of measured")
    assert_one_error(
        hypermap("values", flat, "--quantity", "co2", *out), f"{flat}: there is no layer 'co2'"
    )
