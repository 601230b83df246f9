"""Pictures of objects on the command line: kept by `map`, saved by `query --pictures`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from PIL import Image

from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.formats import open_map, save_map
from hypermap.simulation import SimulatedRecording, demo_world, write_tum
from hypermap.testing import jpeg_picture, occupancy_from_text, square

from .conftest import Result, assert_one_error

Run = Callable[..., Result]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A map with two pictures of a cup, one of a "toy / car", and none of a chair."""
    things = [square("cup", 1, 1), square("toy / car", 3, 3), square("chair", 5, 5)]
    layer = SemanticLayer("semantic", "map", things)
    red, green, blue = ("red", 0.0, 0.9), ("green", 2.0, 0.5), ("blue", 0.0, 0.4)
    layer.kept_pictures = {
        0: (jpeg_picture(*red), jpeg_picture(*green)),
        1: (jpeg_picture(*blue),),
    }
    save_map(Hypermap([layer, occupancy_from_text("...\n...")]), tmp_path / "room.hmap")
    return tmp_path / "room.hmap"


def test_pictures_of_an_answer_are_saved_in_a_folder(
    hypermap: Run, path: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "new" / "pictures"
    result = hypermap("query", path, "--name", "cup", "--pictures", folder)
    assert result.code == 0
    assert f"saved 2 pictures in {folder}" in result.out
    names = ["semantic_cup_0_1.jpg", "semantic_cup_0_2.jpg"]
    assert sorted(each.name for each in folder.iterdir()) == names
    with Image.open(folder / names[0]) as image:
        red, green, blue = image.convert("RGB").getpixel((5, 5))
    assert red > 200 > 50 > max(green, blue)
    (row,) = hypermap("query", path, "--name", "toy / car", "--pictures", folder, "--json").json[
        "answers"
    ]
    assert row["pictures"] == [str(folder / "semantic_toy-car_1_1.jpg")]
    assert Path(row["pictures"][0]).exists()


def test_objects_without_pictures_are_named_as_such(
    hypermap: Run, path: Path, tmp_path: Path
) -> None:
    folder = tmp_path / "pictures"
    result = hypermap("query", path, "--name", "chair", "--pictures", folder)
    assert result.code == 0
    assert "there are no pictures of these objects" in result.err
    assert not folder.exists()
    (row,) = hypermap("query", path, "--id", "2", "--pictures", folder, "--json").json["answers"]
    assert row["pictures"] == []


def test_info_counts_the_pictures_of_the_objects(hypermap: Run, path: Path, tmp_path: Path) -> None:
    assert "3 objects of 3 classes, with 3 pictures" in " ".join(hypermap("info", path).out.split())
    assert hypermap("info", path, "--json").json["layers"][0]["pictures"] == 3
    less = open_map(path)
    less.semantic().remove([0])
    save_map(less, tmp_path / "less.hmap")
    assert hypermap("info", tmp_path / "less.hmap", "--json").json["layers"][0]["pictures"] == 1


def test_pictures_need_objects_and_a_folder(hypermap: Run, path: Path, tmp_path: Path) -> None:
    cells = "query", path, "--at", "0.5,0.5", "--layer", "occupancy", "--pictures"
    assert_one_error(hypermap(*cells, tmp_path / "new"), "--pictures", "--name")
    file = tmp_path / "a file"
    file.write_text("mine")
    assert_one_error(hypermap("query", path, "--name", "cup", "--pictures", file), str(file))
    assert file.read_text() == "mine"


def test_map_keeps_pictures_unless_told_not_to(hypermap: Run, tmp_path: Path) -> None:
    write_tum(SimulatedRecording(demo_world(), rate=0.3), tmp_path / "drive")

    def classes(*options: str) -> set[str]:
        out = tmp_path / "out.hmap"
        made = hypermap("map", tmp_path / "drive", "-o", out, "--force", *options)
        assert made.code == 0, made.err
        layer = open_map(out).semantic()
        return {item.name for item in layer if layer.pictures(item.id)}

    kept = classes()
    assert len(kept) > 3
    assert "person" not in kept
    assert classes("--pictures-of-people") == kept | {"person"}
    assert classes("--no-pictures") == set()
