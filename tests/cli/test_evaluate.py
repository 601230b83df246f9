from __future__ import annotations

import csv
import re
from dataclasses import replace

import numpy as np
import pytest
import shapely
from PIL import Image

from hypermap.core.frames import FrameTree, Pose2D, Transform
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.formats import open_map, save_map
from hypermap.testing import occupancy_from_text, square

from .conftest import assert_one_error

CHAIRS = [square("chair", x, 0) for x in (0, 3, 6)]
TRUE = [*CHAIRS, square("sink", 9, 0)]


@pytest.fixture
def save(tmp_path, monkeypatch):
    """Save objects as NAME.hmap in the folder in which the command runs."""
    monkeypatch.chdir(tmp_path)

    def save(name, things, frame_id="map", transforms=()):
        layer = SemanticLayer("semantic", frame_id, things)
        save_map(Hypermap([layer], FrameTree(transforms)), tmp_path / f"{name}.hmap")
        return f"{name}.hmap"

    return save


@pytest.fixture
def maps(save):
    """A true map, one with its chairs 0.2 m away and a train, and one of a single chair."""
    moved = [
        replace(o, footprint=shapely.transform(o.footprint, lambda xy: xy + np.array([0.2, 0])))
        for o in CHAIRS
    ]
    near = save("near", [*moved, square("train", 5, 5)])
    return save("truth", TRUE), near, save("poor", [square("chair", 0.8, 0)])


def cells_of(result, first):
    """Return the cells of all rows that begin with a word."""
    rows = [line.split() for line in result.out.splitlines()]
    return [row[1:] for row in rows if row[:1] == [first]]


def test_the_tables_show_each_class_and_all(hypermap, maps):
    truth, near, _ = maps
    result = hypermap("evaluate", near, truth)
    assert (result.code, result.err) == (0, "")
    assert result.out.startswith("near.hmap against truth.hmap, frame map\n")
    # Moved by 0.2 of 1 m, 0.8 of 1.2 square meters are shared.
    shapes, loose, strict = cells_of(result, "chair")
    assert shapes == ["3", "3", "1.00", "0.20", "0.67", "0.20", "0%"]
    assert loose == strict == ["3", "0", "0", "0", "1.00", "1.00", "1.00", "0.67"]
    shapes, loose, *_ = cells_of(result, "all")
    assert shapes == ["4", "4", "1.00", "0.20", "0.50", "0.20", "0%"]
    assert loose == ["3", "1", "0", "1", "0.75", "0.75", "0.75", "0.50"]


def test_what_is_not_defined_is_a_dash(hypermap, maps):
    truth, near, _ = maps
    result = hypermap("evaluate", near, truth)
    shapes, loose, _ = cells_of(result, "train")
    assert shapes == ["0", "1", "-", "-", "-", "-", "-"]
    assert loose == ["0", "0", "0", "1", "-", "-", "-", "-"]
    assert re.search(r"^- +not defined *$", result.out, re.MULTILINE)


def test_each_figure_has_its_rule_and_threshold(hypermap, maps):
    truth, near, poor = maps
    result = hypermap("evaluate", near, truth, "--against", poor)
    for words in ("found at an IoU of 0.25 or more", "found at an IoU of 0.5 or more"):
        assert words in result.out
    for rule in ("count", "closest", "matched", "found", "comparison"):
        assert re.search(rf"^{rule} +\w+", result.out, re.MULTILINE)
    assert "comparison" not in hypermap("evaluate", near, truth).out


def test_two_maps_are_compared_over_the_same_true_objects(hypermap, maps):
    truth, near, poor = maps
    result = hypermap("evaluate", near, truth, "--against", poor)
    assert "better than poor.hmap?" in result.out
    _, _, shape, distance, _ = cells_of(result, "closest")  # two heads before, a rule after
    assert shape == ["IoU", "1.000", "1.000", "3", "0", "0", "1.0000", "exact"]
    # Distances of the other map: 0.8, 2.2 and 5.2; all three better is one of eight patterns.
    assert distance == ["off", "by", "[m]", "0.200", "2.733", "3", "3", "0", "0.1250", "exact"]


def test_the_exact_test_is_made_where_it_is_asked_for(hypermap, save):
    things = [square("cup", 2 * i, 0) for i in range(20)]
    truth, other = save("truth", things), save("other", [square("cup", -9, 0)])
    arguments = ("evaluate", truth, truth, "--against", other, "--json")
    # Twenty equal differences, all ranks 10.5: z = (210 - 105 - 0.5) / sqrt(551.25) = 4.451.
    for options, method, p in ([], "normal", 4.28e-6), (["--exact"], "exact", 2**-20):
        test = hypermap(*arguments, *options).json["comparison"][2]["test"]
        assert test["method"] == method
        assert test["p"] == pytest.approx(p, rel=0.02)


def test_json_holds_all_figures_and_nothing_else(hypermap, maps):
    truth, near, poor = maps
    data = hypermap("evaluate", near, truth, "--against", poor, "--json").json
    assert data["ground_truth"]["map"] == truth
    assert data["all"]["closest"] == pytest.approx({"compared": 3, "iou": 1, "distance": 0.2})
    assert data["against"]["all"]["count"] == {"true": 4, "estimated": 1}
    assert [c["test"]["p"] for c in data["comparison"]] == [1, 0.125, 0.125]
    assert data["classes"]["train"]["found"][0]["recall"] is None


def test_figures_and_a_picture_are_saved(hypermap, maps, tmp_path):
    truth, near, _ = maps
    (tmp_path / "x.csv").write_text("old")
    result = hypermap("evaluate", near, truth, "--csv", "x.csv", "--picture", "x.png")
    assert (result.code, result.err) == (0, "saved x.csv\nsaved x.png\n")
    with (tmp_path / "x.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert rows[0]["estimate"] == near
    with Image.open(tmp_path / "x.png") as image:
        assert image.format == "PNG"


def test_another_frame_is_followed_where_it_is_known(hypermap, save):
    there = Transform("map", "odom", Pose2D(x=1.0))
    moved = [square("chair", x - 1, 0) for x in (0, 3, 6)]
    truth, estimate = save("truth", TRUE), save("estimate", moved, "odom", [there])
    data = hypermap("evaluate", estimate, truth, "--json").json
    assert data["frame_id"] == "map"
    assert data["classes"]["chair"]["matched"]["iou"] == pytest.approx(1)


def test_the_published_map_agrees_with_itself(hypermap, shared_data, tmp_path):
    lab = shared_data / "maps" / "lab.hmap"
    data = hypermap("evaluate", lab, lab, "--json", "--picture", tmp_path / "x.svg").json
    assert data["all"]["closest"] == pytest.approx({"compared": 28, "iou": 1, "distance": 0})
    for found in data["all"]["found"]:
        assert (found["found"], found["missed"], found["false"]) == (28, 0, 0)
        assert found["panoptic_quality"] == pytest.approx(1)
        assert found["class_mean_panoptic_quality"] == pytest.approx(1)


def test_the_published_floor_without_its_plants(hypermap, shared_data, save):
    floor = shared_data / "maps" / "floor.hmap"
    things = open_map(floor)["semantic"].objects()
    estimate = save("estimate", [thing for thing in things if thing.name != "pottedplant"])
    data = hypermap("evaluate", estimate, floor, "--json").json
    # Seven of 32 objects are plants; the thesis leaves out what the estimate has none of.
    assert data["all"]["closest"] == pytest.approx({"compared": 25, "iou": 1, "distance": 0})
    assert data["all"]["matched"]["iou"] == pytest.approx(25 / 32)
    assert data["all"]["found"][1]["recall"] == pytest.approx(25 / 32)
    assert data["all"]["found"][1]["precision"] == 1


@pytest.mark.parametrize(
    ("things", "words"),
    [
        ([], "e.hmap: the map has no objects; nothing was found"),
        ([square("train", 0, 0)], "e.hmap: the map and truth.hmap have no class in common"),
        (
            [square("chair", 500, 0)],
            "e.hmap: none of its objects lies on one of truth.hmap, whatever their names; the near",
        ),
        (
            [SemanticObject("sink", shapely.Polygon([(9, 0), (10, 1), (10, 0), (9, 1)]))],
            "e.hmap: 1 outline crosses itself; what is wound around counts as inside",
        ),
    ],
)
def test_what_is_odd_is_said_and_measured_all_the_same(hypermap, save, things, words):
    truth, estimate = save("truth", TRUE), save("e", things)
    result = hypermap("evaluate", estimate, truth, "--json")
    assert result.code == 0
    assert words in result.err
    assert result.json["all"]["count"]["true"] == 4


def test_entries_that_could_not_be_read_are_named_and_counted(hypermap, shared_data):
    office = shared_data / "maps" / "office.hmap"
    result = hypermap("evaluate", office, office, "--json")
    assert "object 22 'tvmonitor' is left out" in result.err
    assert result.json["estimate"] == {
        "map": str(office),
        "objects": 34,
        "repaired": 0,
        "unread": 1,
    }


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["no.hmap", "truth.hmap"], ["no.hmap"]),
        (["grid.hmap", "truth.hmap"], ["grid.hmap: the map has no layer of objects"]),
        (["truth.hmap", "empty.hmap"], ["empty.hmap: the ground truth has no objects"]),
        (["odom.hmap", "truth.hmap"], ["'odom'", "'map'", "add it to the `transforms`"]),
        (["truth.hmap", "truth.hmap", "--against", "odom.hmap"], ["odom.hmap is in the frame"]),
        (["truth.hmap", "truth.hmap", "--exact"], ["--exact needs --against", "--against"]),
        (["truth.hmap", "truth.hmap", "--csv", "truth.hmap"], ["is saved as .csv"]),
        (["truth.hmap", "truth.hmap", "--csv", "no/x.csv"], ["does not exist; create it first"]),
        (["truth.hmap", "truth.hmap", "--picture", "x.jpg"], ["saved as .png or .svg"]),
    ],
)
def test_what_cannot_be_measured_is_said_so(hypermap, save, tmp_path, arguments, words):
    save("truth", TRUE)
    save("empty", [])
    save("odom", TRUE, "odom")
    save_map(Hypermap([occupancy_from_text("..")]), tmp_path / "grid.hmap")
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    assert_one_error(hypermap("evaluate", *arguments), *words)
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.parametrize("kind", ["yaml", "geojson", "parquet"])
def test_files_of_objects_alone_are_compared_as_convert_reads_them(hypermap, maps, kind):
    truth, near, _ = maps
    for path in (truth, near):
        objects = path.replace(".hmap", f".{kind}")
        assert hypermap("convert", path, objects).code == 0
    whole = hypermap("evaluate", near, truth, "--json")
    alone = hypermap("evaluate", f"near.{kind}", f"truth.{kind}", "--json")
    assert (alone.code, alone.err) == (0, "")
    assert alone.json["classes"] == whole.json["classes"]
    mixed = hypermap("evaluate", f"near.{kind}", truth, "--json")
    assert mixed.json["classes"] == whole.json["classes"]
