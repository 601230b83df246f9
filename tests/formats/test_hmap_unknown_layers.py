"""Layers of unknown classes, and files that no layer reads."""

from __future__ import annotations

import logging
import zipfile
from pathlib import Path

import pytest
import shapely

from hypermap.core.errors import HypermapError
from hypermap.core.opaque import OpaqueLayer
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.formats import open_map, save_map

from .maps import CONFIG, OBJECTS, archive
from .strategies import map_facts

ROOMS = """\
layers:
- {class: OccupancyGridLayer, name: occupancy, frame_id: map, load_file: false}
- {class: RoomLayer, name: rooms, frame_id: map, load_file: true, file: rooms, color: red}
- {class: RoomLayer, name: more, frame_id: map, load_file: true, file: more}
- {class: SemanticLayer, name: semantic, frame_id: map, load_file: true, file: objects}
"""
ROOM_FILES: dict[str, str | bytes] = {
    "hmap_config.yaml": ROOMS,
    "rooms": b"\x00\xff",
    "rooms.idx": b"index",
    "objects": OBJECTS,
    "more/a": b"a",
    "more/b": b"b",
    "notes.txt": b"whose?",
}


def test_a_layer_of_unknown_class_keeps_all_files_that_no_other_layer_reads(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = archive(tmp_path / "t.hmap", ROOM_FILES)
    with caplog.at_level(logging.WARNING):
        hypermap = open_map(path)
    assert len(caplog.messages) == 2
    assert caplog.messages[0].startswith(
        "layer 'rooms' has the unknown class 'RoomLayer'; is its plug-in installed? Its files are "
        "kept as they are (known: OccupancyGridLayer, SemanticLayer"
    )
    rooms, more = hypermap["rooms"], hypermap["more"]
    assert isinstance(rooms, OpaqueLayer)
    assert isinstance(more, OpaqueLayer)
    assert rooms.files == {"rooms": b"\x00\xff", "rooms.idx": b"index", "notes.txt": b"whose?"}
    assert more.files == {"more/a": b"a", "more/b": b"b"}
    assert (rooms.class_name, rooms.settings["color"]) == ("RoomLayer", "red")
    with pytest.raises(HypermapError) as error:
        hypermap.label_at("rooms", [[0, 0]])
    assert str(error.value) == (
        "layer 'rooms' cannot be queried: no plug-in for its class 'RoomLayer' is installed"
    )

    save_map(hypermap, tmp_path / "again.hmap")
    with zipfile.ZipFile(tmp_path / "again.hmap") as again:
        for name, content in ROOM_FILES.items():
            if name not in ("hmap_config.yaml", "objects"):
                assert again.read(name) == content
    assert map_facts(open_map(tmp_path / "again.hmap")) == map_facts(hypermap)


def test_in_a_folder_an_unknown_layer_takes_only_files_with_its_name(tmp_path: Path) -> None:
    folder = tmp_path / "map"
    with zipfile.ZipFile(archive(tmp_path / "t.hmap", ROOM_FILES)) as source:
        source.extractall(folder)
    rooms = open_map(folder)["rooms"]
    assert isinstance(rooms, OpaqueLayer)
    assert rooms.files == {"rooms": b"\x00\xff", "rooms.idx": b"index"}


def test_other_layers_keep_clear_of_an_unknown_layers_files(tmp_path: Path) -> None:
    hypermap = open_map(archive(tmp_path / "t.hmap", ROOM_FILES))
    chair = SemanticObject("chair", shapely.box(0, 0, 1, 1))
    hypermap.add(SemanticLayer("new", "map", [chair], {"file": "notes.txt"}))
    save_map(hypermap, tmp_path / "t.hmap")
    again = open_map(tmp_path / "t.hmap")
    assert again["new"].settings["file"] == "new"
    assert map_facts(again) == map_facts(hypermap)
    clash = OpaqueLayer("RoomLayer", "clash", "map", {"rooms": b"other"})
    hypermap.add(clash)
    with pytest.raises(HypermapError) as error:
        save_map(hypermap, tmp_path / "t.hmap")
    assert str(error.value) == ("layer 'clash' cannot be saved: another file is named 'rooms'")


def test_files_that_no_layer_reads_are_reported_where_nobody_keeps_them(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    files: dict[str, str | bytes] = {"hmap_config.yaml": CONFIG, "objects": OBJECTS, "note": "x"}
    path = archive(tmp_path / "t.hmap", files)
    with caplog.at_level(logging.WARNING):
        open_map(path)
    assert caplog.messages == [f"{path}: no layer uses note; saving will leave it out"]
