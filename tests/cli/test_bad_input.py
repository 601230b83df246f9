"""Whatever is wrong with a file: one line that names it, exit code 2, and nothing else changed."""

from __future__ import annotations

import json
import shlex
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from hypermap import Hypermap, SemanticLayer, save_map
from hypermap.testing import square

from ..recordings.bag_builder import IMAGE, BagBuilder, add_images, add_poses, image
from ..recordings.shots import make_shots
from .conftest import Result, assert_one_error

FULL = "No space left on device; free space there, or save elsewhere"


def everything_in(folder: Path) -> dict[str, bytes | None]:
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None
        for path in folder.rglob("*")
    }


@pytest.fixture
def opened(tmp_path: Path, room_map: Path) -> Path:
    """The map as a folder, whose files are easy to spoil."""
    with zipfile.ZipFile(room_map) as archive:
        archive.extractall(tmp_path / "room")
    return tmp_path / "room"


@pytest.fixture
def spoiled_drive(tmp_path: Path, drive: Path) -> Path:
    return Path(shutil.copytree(drive, tmp_path / "drive"))


# file, what is replaced in it (None: all), by what, and words of the message
MAP_FILES = {
    "empty configuration": ("hmap_config.yaml", None, "", "hmap_config.yaml"),
    "broken YAML": ("hmap_config.yaml", None, "layers: [", "is not valid YAML"),
    "deep YAML": ("hmap_config.yaml", None, "layers: " + "[" * 9999, "nested more than"),
    "a tag": ("hmap_config.yaml", None, "layers: !!python/name:os.abort []", "is not allowed"),
    "a key twice": ("hmap_config.yaml", None, "layers: []\nlayers: []", "'layers' appears twice"),
    "a name twice": ("hmap_config.yaml", "name: semantic", "name: occupancy", "layers[1].name"),
    "no frame": ("hmap_config.yaml", "frame_id: map\n  load", "load", "layers[0].frame_id"),
    "missing layer file": ("hmap_config.yaml", "file: semantic", "file: gone", "room/gone"),
    "a file elsewhere": ("hmap_config.yaml", "file: semantic", "file: ../x", "'../x'"),
    "a pose not finite": ("hmap_config.yaml", "[10.0", "[.nan", "transforms[0].transform_pose[0]"),
    "a pose far away": ("hmap_config.yaml", "[10.0", "[1e300", "transforms[0].transform_pose[0]"),
    "a frame in itself": ("hmap_config.yaml", "child_frame_id: room", "child_frame_id: map", "map"),
    "cells without size": ("occupancy.yaml", "0.5", "0", "occupancy.yaml: resolution"),
    "absurd cells": ("occupancy.yaml", "0.5", "1e300", "occupancy.yaml: resolution"),
    "an origin far away": ("occupancy.yaml", "[0.0", "[-1e300", "occupancy.yaml: origin[0]"),
    "no picture": ("occupancy.yaml", "occupancy.png", "no.png", "no.png"),
    "a broken picture": ("occupancy.png", None, "\x89PNG", "occupancy.png: is not"),
    "a picture without cells": ("occupancy.png", None, "P5 0 0 255 ", "occupancy.png"),
    "objects that are no list": ("semantic", None, "chair", "semantic: expected a list"),
}


@pytest.mark.parametrize("case", MAP_FILES)
def test_a_spoiled_file_of_a_map_is_named(
    hypermap: Callable[..., Result], tmp_path: Path, opened: Path, case: str
) -> None:
    name, old, new, words = MAP_FILES[case]
    file = opened / name
    text = file.read_text() if old is not None else ""
    assert old is None or old in text
    file.write_text(new if old is None else text.replace(old, new, 1), "latin-1")
    before = everything_in(tmp_path)
    for arguments in (["info", opened], ["convert", opened, tmp_path / "out.hmap"]):
        assert_one_error(hypermap(*arguments), str(opened), words)
    assert everything_in(tmp_path) == before


DRIVE_FILES = {
    "no poses": ("groundtruth.txt", "", "groundtruth.txt: there are no poses"),
    "text for poses": ("groundtruth.txt", "a b c d e f g h\n", "groundtruth.txt: line 1"),
    "a pose not finite": ("groundtruth.txt", "1 0 inf 0 0 0 0 1\n", "groundtruth.txt: line 1"),
    "lost poses alone": ("groundtruth.txt", "1 0 nan 0 0 0 0 1\n", "groundtruth.txt: all poses"),
    "a turn of nothing": ("groundtruth.txt", "1 0 0 0 0 0 0 0\n", "the quaternion is zero"),
    "no depth": ("depth.txt", "# nothing\n", "depth.txt: the list is empty"),
    "a depth image that is gone": ("depth.txt", "100 gone.png\n", "gone.png"),
    "stamps far apart": ("rgb.txt", "9 color.png\n", "drive"),
    "depth in 8 bits": ("depth.txt", "100 color.png\n", "color.png: expected a depth image"),
    "a broken image": ("depth.png", "\x89PNG", "depth.png"),
    "broken detections": ("detections.json", '{"frames"', "detections.json"),
    "detections of no stamp": ("detections.json", '{"frames": {"now": []}}', "frame now"),
}


@pytest.mark.parametrize("case", DRIVE_FILES)
def test_a_spoiled_file_of_a_recording_is_named(
    hypermap: Callable[..., Result], tmp_path: Path, spoiled_drive: Path, case: str
) -> None:
    name, content, words = DRIVE_FILES[case]
    (spoiled_drive / name).write_text(content, "latin-1")
    before = everything_in(tmp_path)
    result = hypermap("map", spoiled_drive, "-o", tmp_path / "out.hmap")
    assert result.code == 2
    assert result.err.splitlines()[-1].startswith("hypermap: error: ")
    assert words in result.err
    assert "Traceback" not in result.err
    assert everything_in(tmp_path) == before


def test_paths_that_are_no_files_are_said_so(
    hypermap: Callable[..., Result], tmp_path: Path
) -> None:
    (tmp_path / "loop.hmap").symlink_to("loop.hmap")
    (tmp_path / "away.hmap").symlink_to("nowhere")
    (tmp_path / "folder.hmap").mkdir()
    for name in ("loop.hmap", "away.hmap", "folder.hmap", "missing.hmap", "a/b.hmap"):
        assert_one_error(hypermap("query", tmp_path / name, "--at", "0,0"), str(tmp_path / name))
        assert_one_error(hypermap("info", tmp_path / name), str(tmp_path / name))
    assert_one_error(hypermap("info", "/dev/null"), "/dev/null: is neither a file nor a folder")


def test_an_unsavable_map_leaves_no_folder_behind(
    hypermap: Callable[..., Result], tmp_path: Path
) -> None:
    nested: Any = 1
    for _ in range(70):
        nested = {"a": nested}
    feature = {
        "type": "Feature",
        "geometry": {"type": "Polygon", "coordinates": [[[0, 0], [1, 0], [1, 1], [0, 0]]]},
        "properties": {"name": "cup", "deep": nested},
    }
    collection = {"type": "FeatureCollection", "frame_id": "map", "features": [feature]}
    (tmp_path / "deep.geojson").write_text(json.dumps(collection))
    result = hypermap("convert", tmp_path / "deep.geojson", tmp_path / "folder")
    assert_one_error(result, "nested too deeply to be saved")
    assert [path.name for path in tmp_path.iterdir()] == ["deep.geojson"]


def test_names_cannot_write_to_the_terminal(hypermap: Callable[..., Result]) -> None:
    result = hypermap("info", "\x1b[31m[red]\u202e\x07.hmap")
    assert_one_error(result, "\\x1b[31m[red]\\u202e\\x07.hmap: there is no such file")


def test_names_in_json_cannot_write_to_the_terminal(
    hypermap: Callable[..., Result], tmp_path: Path
) -> None:
    name = "m\u00fcg\x1b[31m\x9b31m\u202e\u2066\u061c\U000e0041"
    hypermap_of_it = Hypermap([SemanticLayer("semantic", "map", [square(name, 0, 0)])])
    save_map(hypermap_of_it, tmp_path / "a.hmap")
    out = hypermap("info", tmp_path / "a.hmap", "--json").out
    assert "m\u00fcg\\u001b[31m\\u009b31m\\u202e\\u2066\\u061c\\udb40\\udc41" in out
    assert json.loads(out)["layers"][0]["names"] == {name: 1}


@pytest.mark.parametrize("name", ["a\x1b[31m\x9b\u202e\u061cb", "a\nwrong: forged", "n" * 100_000])
def test_names_in_a_bag_cannot_write_to_the_terminal(
    hypermap: Callable[..., Result], tmp_path: Path, name: str
) -> None:
    shots = make_shots(1)
    with BagBuilder(tmp_path, "ros1") as bag:
        add_poses(bag, shots, root=name)
        add_images(bag, shots[0])
        depth = image(shots[0].depth_mm, "16UC1", shots[0].stamp)
        bag.add(f"/{name}/image_rect_raw", IMAGE, shots[0].stamp, depth)
    out = hypermap("info", bag.path).out
    assert out.replace("\n", "").isprintable()
    assert "\nwrong: forged" not in out
    assert len(out) < 10_000


def test_a_message_is_not_longer_than_a_screen(hypermap: Callable[..., Result]) -> None:
    result = hypermap("info", "n" * 10_000 + ".hmap")
    assert_one_error(result, "nnn ... nnn", ".hmap")
    assert len(result.err) < 2500


def run(shell_line: str, room_map: Path) -> subprocess.CompletedProcess[str]:
    python, path = shlex.quote(sys.executable), shlex.quote(str(room_map))
    command = shell_line.format(hypermap=f"{python} -m hypermap", map=path)
    return subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    ("line", "code", "err"),
    [
        ("{hypermap} info {map} >&-", 0, ""),
        ("{hypermap} query {map} --at 0,0 --json >&-", 0, ""),
        ("{hypermap} info gone.hmap 2>&-", 2, ""),
        ("{hypermap} shell {map} <&-", 0, ""),
        ("{hypermap} info {map} >/dev/full", 2, f"hypermap: error: {FULL}\n"),
        ("{hypermap} --help >/dev/full", 2, f"hypermap: error: {FULL}\n"),
        ("{hypermap} info gone.hmap 2>/dev/full", 2, ""),
        ("{hypermap} info {map} | true", 0, ""),
    ],
)
def test_closed_and_full_streams_are_no_surprise(
    room_map: Path, line: str, code: int, err: str
) -> None:
    done = run(line, room_map)
    assert (done.returncode, done.stdout, done.stderr) == (code, "", err)


def test_a_stream_of_few_letters_gets_the_others_as_escapes(tmp_path: Path, room_map: Path) -> None:
    path = tmp_path / "küche.hmap"
    shutil.copy(room_map, path)
    line = "PYTHONIOENCODING=ascii {hypermap} info {map} --json"
    assert json.loads(run(line, path).stdout)["path"] == str(path)
