from __future__ import annotations

import zipfile

import pytest
import shapely
from PIL import Image

from hypermap import Hypermap, SemanticLayer, SemanticObject, open_map, save_map
from hypermap.core.opaque import OpaqueLayer

from ..recordings.bag_builder import write_bag
from ..recordings.shots import SHOTS
from .conftest import INTRINSICS, assert_one_error, write_drive


def test_a_map_is_described_for_programs(hypermap, room_map):
    content = hypermap("info", room_map, "--json").json
    assert content["kind"] == "map"
    assert content["base_frame"] == "map"
    [frame] = content["frames"]
    assert (frame["parent"], frame["child"]) == ("map", "room")
    assert frame["pose"] == pytest.approx([10, 0, 1.5707963])
    grid, objects = content["layers"]
    assert grid["extent"] == [0, 0, 15, 10]
    assert (grid["width"], grid["height"], grid["resolution"]) == (30, 20, 0.5)
    assert grid["cells"] == {"Free": 180, "Occupied": 20, "Unknown": 400}
    assert (objects["frame_id"], objects["objects"]) == ("room", 3)
    assert objects["names"] == {"chair": 2, "potted plant": 1}
    assert objects["rejected"] == []


def test_a_map_is_described_for_people(hypermap, room_map):
    text = hypermap("info", room_map).out
    assert "semantic: 2 chair, 1 potted plant" in text
    assert "30 x 20 cells of 0.5 m: Free 180, Occupied 20, Unknown 400" in text
    assert "frame room is in map at x 10, y 0, yaw 1.5708" in text


def test_a_backup_is_a_map_too(hypermap, room_map, tmp_path):
    backup = tmp_path / "room.hmap.bak"
    backup.write_bytes(room_map.read_bytes())
    assert hypermap("info", backup).out == hypermap("info", room_map).out


def test_what_is_lost_of_the_history_is_said(hypermap, tmp_path):
    path = tmp_path / "a.hmap"
    found = Hypermap([SemanticLayer("semantic", "map")], metadata={"map_id": "00ff"})
    found.save(path)
    found = open_map(path)
    for name in ("cup", "mug"):
        found.semantic().add(SemanticObject(name, shapely.box(0, 0, 1, 1)))
        found.save(path)
    with zipfile.ZipFile(path) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content[:-20] if name.startswith("history") else content)
    result = hypermap("info", path)
    assert "semantic: 1 cup, 1 mug" in result.out
    assert "1 part of it cannot be read: what changed after version 1" in result.err


def test_a_layer_says_in_its_own_words_what_it_holds(hypermap, tmp_path):
    layers = [
        SemanticLayer("semantic", "map"),
        OpaqueLayer("HeatLayer", "heat", "map", load_file=False),
    ]
    save_map(Hypermap(layers), tmp_path / "a.hmap")
    result = hypermap("info", tmp_path / "a.hmap", "--json")
    assert "HeatLayer" in result.json["layers"][1]["summary"]
    assert "whose plug-in is not installed" in hypermap("info", tmp_path / "a.hmap").out


def test_settings_are_shown_when_asked_for(hypermap, tmp_path):
    metadata = {"frames": {"used": 7}, "config": {"evidence": {"publish_above": 2.0}, "every": 3}}
    save_map(Hypermap([SemanticLayer("semantic", "map")], metadata=metadata), tmp_path / "a.hmap")
    short = hypermap("info", tmp_path / "a.hmap")
    assert "used 7" in short.out
    assert "publish_above" not in short.out
    assert short.err == "and 2 lines of settings; show them with -v\n"
    for words in (["info", "-v"], ["-v", "info"]):
        long = hypermap(*words, tmp_path / "a.hmap")
        assert "publish_above 2.0" in long.out
        assert (long.code, long.err) == (0, "")


def test_what_is_noted_of_a_recording_is_printed_once(hypermap, tmp_path):
    bag = write_bag(tmp_path, "ros1", SHOTS, root="world")
    result = hypermap("info", bag)
    assert (result.out + result.err).count("tf has no frame 'map'") == 1


@pytest.mark.parametrize(
    ("name", "objects", "classes"), [("lab", 28, 12), ("floor", 32, 10), ("example", 2, 2)]
)
def test_the_real_maps_hold_what_their_readme_says(hypermap, shared_data, name, objects, classes):
    text = hypermap("info", shared_data / "maps" / f"{name}.hmap").out
    assert f"{objects} objects of {classes} classes" in text


def test_an_object_that_could_not_be_read_is_named(hypermap, shared_data):
    path = shared_data / "maps" / "office.hmap"
    [rejected] = hypermap("info", path, "--json").json["layers"][1]["rejected"]
    assert (rejected["position"], rejected["name"]) == (22, "tvmonitor")
    assert "rejected: object 22 (tvmonitor): " in hypermap("info", path).out


def test_a_map_in_a_folder_is_described_like_its_archive(hypermap, room_map, tmp_path):
    assert hypermap("convert", room_map, tmp_path / "room").code == 0
    assert hypermap("info", tmp_path / "room").out == hypermap("info", room_map).out


def test_a_recording_of_which_a_map_can_be_made_lacks_nothing(hypermap, drive):
    assert hypermap("info", drive, "--json").json["missing"] == []
    assert "Nothing is missing" in hypermap("info", drive).out


def test_a_recording_without_detections_lacks_a_detector(hypermap, tmp_path):
    drive = write_drive(tmp_path / "drive", frames=2, has_detections=False)
    (said,) = hypermap("info", drive, "--json").json["missing"]
    for words in ("--detector MODEL.onnx", "hypermap detectors get yolox-nano", "--no-objects"):
        assert words in said
    text = hypermap("info", drive).out
    assert f"missing: {said}" in text
    assert "Nothing is missing" not in text
    refused = hypermap("map", drive, "-o", tmp_path / "out.hmap")
    assert_one_error(refused, said)


def test_what_info_calls_complete_is_mapped_and_what_it_does_not_is_refused(hypermap, tmp_path):
    for name, has_detections in (("whole", True), ("bare", False)):
        drive = write_drive(tmp_path / name, frames=2, has_detections=has_detections)
        is_complete = hypermap("info", drive, "--json").json["missing"] == []
        made = hypermap("map", drive, "--intrinsics", INTRINSICS, "-o", tmp_path / "out.hmap")
        assert (made.code == 0) == is_complete == has_detections


def test_color_is_not_missing_where_there_are_detections(hypermap, tmp_path):
    drive = write_drive(tmp_path / "drive", frames=2)
    (drive / "rgb.txt").unlink()
    assert "Nothing is missing" in hypermap("info", drive).out
    made = hypermap("map", drive, "-o", tmp_path / "out.hmap")
    assert made.code == 0


def test_info_says_which_images_cannot_be_used(hypermap, tmp_path):
    drive = write_drive(tmp_path / "drive", frames=6)
    Image.new("L", (160, 120)).save(drive / "gray.png")
    for bad, is_complete in ((2, True), (4, False)):
        lines = (drive / "depth.txt").read_text().splitlines()
        lines[:bad] = [line.split()[0] + " gray.png" for line in lines[:bad]]
        (drive / "depth.txt").write_text("\n".join(lines))
        said = hypermap("info", drive).out
        assert f"{bad} of 6 frames tried cannot be used; the first one: {drive}/gray.png" in said
        assert ("Nothing is missing" in said) == is_complete
        made = hypermap("map", drive, "-o", tmp_path / "out.hmap", "--force")
        assert (made.code == 0) == is_complete


def test_info_checks_nothing_where_no_image_can_be_used(hypermap, tmp_path):
    drive = write_drive(tmp_path / "drive", frames=2)
    Image.new("L", (160, 120)).save(drive / "depth.png")
    content = hypermap("info", drive, "--json").json
    assert content["checks"] == []
    assert len(content["missing"]) == 1


def test_info_says_that_a_detector_cannot_read_color(hypermap, tmp_path):
    drive = write_drive(tmp_path / "drive", frames=2)
    Image.new("I;16", (160, 120)).save(drive / "color.png")
    said = hypermap("info", drive).out
    assert f"no --detector can find objects in color images like the first one: {drive}" in said
    assert "Nothing is missing" in said  # it has detections


def test_a_recording_without_color_is_reported_what_can_be_made_of_it(hypermap, tmp_path):
    drive = write_drive(tmp_path / "drive", frames=2, has_detections=False)
    (drive / "rgb.txt").unlink()
    assert "without color images no objects" in hypermap("info", drive).out
    refused = hypermap("map", drive, "-o", tmp_path / "out.hmap")
    assert_one_error(refused, "neither detections nor color images", "--no-objects")
    arguments = ["--no-objects", "--intrinsics", INTRINSICS, "-o", tmp_path / "out.hmap"]
    assert hypermap("map", drive, *arguments).code == 0
