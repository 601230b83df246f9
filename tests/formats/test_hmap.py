from __future__ import annotations

import itertools
import logging
import shutil
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import HealthCheck, given, settings

from hypermap.core.errors import FileMissing, FormatError, HypermapError, MissingExtra
from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.formats import limits, open_map, save_map
from hypermap.formats.backup import save_with_backup
from hypermap.formats.config import CONFIG_NAME
from hypermap.formats.semantic import yaml_files as semantic_yaml
from hypermap.formats.yaml_text import read_yaml

from .killed import killed_at
from .maps import files_of, occupancy, semantic, small_map
from .strategies import hypermaps, map_facts


@pytest.mark.parametrize("name", ["lab", "floor", "office", "example"])
@pytest.mark.parametrize("target", ["again.hmap", "again.yaml", "."])
def test_a_map_of_the_first_program_is_exactly_the_same_after_saving(
    shared_data: Path, tmp_path: Path, name: str, target: str
) -> None:
    first = open_map(shared_data / "maps" / f"{name}.hmap")
    save_map(first, tmp_path / target)
    second = open_map(tmp_path / target)
    assert map_facts(second) == map_facts(first)
    assert [layer.settings for layer in second] == [layer.settings for layer in first]
    files = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    save_map(second, tmp_path / target)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == files


def test_the_lab_holds_what_was_worked_out_independently(shared_data: Path) -> None:
    lab = open_map(shared_data / "maps" / "lab.hmap")
    grid = occupancy(lab).grid
    assert grid == GridGeometry(320, 576, 0.05, Pose2D(-8.0, -20.8, 0.0))
    assert np.count_nonzero(occupancy(lab).cells == 100) == 954
    objects = semantic(lab)
    assert len(objects) == 28
    names = list(objects.names)
    assert [names.count(word) for word in ("chair", "cup", "tvmonitor", "table")] == [8, 5, 3, 3]
    assert objects.find("sink").round(3).tolist() == [[3.259, 2.378]]
    hits = objects.labels_in(shapely.box(1, 2, 2, 3))
    assert hits.points_xy[hits.values == "chair"].round(3).tolist() == [[1.429, 2.887]]
    assert objects.label_at([[3, -2]]).tolist() == ["table"]
    hits = objects.labels_in(shapely.box(2, -2, 3, -1))
    assert sorted(hits.values) == ["chair", "table", "tvmonitor"]
    assert all(shape.exterior.is_ccw for shape in objects.geometries)


def test_the_floor_holds_what_was_worked_out_independently(shared_data: Path) -> None:
    floor = open_map(shared_data / "maps" / "floor.hmap")
    assert occupancy(floor).grid == GridGeometry(1472, 992, 0.05, Pose2D(-32.0, -19.2, 0.0))
    names = list(semantic(floor).names)
    assert len(names) == 32
    assert [names.count(word) for word in ("pottedplant", "chair", "bench")] == [7, 7, 6]


def test_the_broken_monitor_of_the_office_is_reported_and_the_rest_loads(
    shared_data: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = shared_data / "maps" / "office.hmap"
    with caplog.at_level(logging.WARNING):
        office = semantic(open_map(path))
    assert caplog.messages == [
        f"{path}/semantic: object 22 'tvmonitor' is left out: "
        "point 2 of its shape has 4 numbers, not 2; is a comma missing?"
    ]
    assert office.ids.tolist() == [number for number in range(35) if number != 22]
    assert [(item.position, item.name) for item in office.rejected] == [(22, "tvmonitor")]


def test_unknown_keys_and_endings_of_the_example_are_kept(shared_data: Path) -> None:
    example = open_map(shared_data / "maps" / "example.hmap")
    assert example.metadata == {"other_keys": {"layer_cnt": 2}}
    layer = semantic(example)
    assert layer.settings["file"] == "test_semantic.yaml"
    assert layer.settings["vic_display_type"] == "hypermap::PolygonArray"
    assert layer.settings["subscribe_mode"] is True
    assert [(item.name, item.tags, item.confidence) for item in layer.objects()] == [
        ("chair", ("furniture", "chair", "table"), (0.8, 0.6, 0.3)),
        ("bin", ("furniture", "bin"), (0.7, 0.65)),
    ]


# Saving


@pytest.mark.parametrize("target", ["t.hmap", "t.yaml", "t.zip", "."])
def test_a_map_is_the_same_after_saving(tmp_path: Path, target: str) -> None:
    save_map(small_map(), tmp_path / target)
    again = open_map(tmp_path / target)
    assert map_facts(again) == map_facts(small_map())
    assert again["objects"].settings == {
        "file": "objects",
        "subscribe_mode": True,
        "enable_update": True,
        "publish_global_topics": False,
        "vendor": 3,
    }


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(hypermap=hypermaps())
def test_any_map_is_exactly_the_same_after_saving(tmp_path: Path, hypermap: Hypermap) -> None:
    for target in (tmp_path / "t.hmap", tmp_path / "folder"):
        if target.name == "folder":
            shutil.rmtree(target, ignore_errors=True)
            target.mkdir()
        save_map(hypermap, target)
        assert map_facts(open_map(target)) == map_facts(hypermap)
    first = (tmp_path / "t.hmap").read_bytes()
    save_map(open_map(tmp_path / "t.hmap"), tmp_path / "t.hmap")
    assert (tmp_path / "t.hmap").read_bytes() == first


def test_the_first_program_finds_its_files_in_our_archive(tmp_path: Path) -> None:
    save_map(small_map(), tmp_path / "t.hmap")
    with zipfile.ZipFile(tmp_path / "t.hmap") as archive:
        assert archive.namelist() == [
            "hmap_config.yaml",
            "occupancy.yaml",
            "occupancy.png",
            "objects",
        ]
        assert archive.read("hmap_config.yaml").decode() == (
            "layers:\n"
            "- class: OccupancyGridLayer\n"
            "  name: occupancy\n"
            "  frame_id: map\n"
            "  load_file: true\n"
            "  file: occupancy\n"
            "  subscribe_mode: false\n"
            "  enable_update: true\n"
            "  publish_global_topics: false\n"
            "- class: SemanticLayer\n"
            "  name: objects\n"
            "  frame_id: lab\n"
            "  load_file: true\n"
            "  file: objects\n"
            "  subscribe_mode: true\n"
            "  enable_update: true\n"
            "  publish_global_topics: false\n"
            "  vendor: 3\n"
            "transforms:\n"
            "- frame_id: map\n"
            "  child_frame_id: lab\n"
            "  transform_pose: [1.0, 2.0, 0.5]\n"
            "hypermap_metadata:\n"
            "  profile: default\n"
        )


def test_the_same_map_saved_twice_gives_the_same_bytes(tmp_path: Path) -> None:
    save_map(small_map(), tmp_path / "one.hmap")
    save_map(small_map(), tmp_path / "two.hmap")
    assert (tmp_path / "one.hmap").read_bytes() == (tmp_path / "two.hmap").read_bytes()


def test_layers_whose_files_would_have_the_same_name_get_others(tmp_path: Path) -> None:
    squares = [SemanticObject("a", shapely.box(0, 0, size, 1)) for size in (1, 2, 3)]
    layers = [
        SemanticLayer("a/b", "map", squares[:1], {"file": "same"}),
        SemanticLayer("a b", "map", squares[1:2], {"file": "same"}),
        SemanticLayer("a_b", "map", squares[2:], {"file": "../out"}),
        SemanticLayer("same", "map", squares[:1], {"file": "same"}),
        SemanticLayer("...", "map", squares[1:2], {"file": "hmap_config.yaml"}),
    ]
    save_map(Hypermap(layers), tmp_path / "t.hmap")
    again = open_map(tmp_path / "t.hmap")
    assert map_facts(again) == map_facts(Hypermap(layers))
    files = [layer.settings["file"] for layer in again]
    assert files == ["same", "a_b", "a_b_2", "same", "layer"]


def test_an_empty_layer_is_saved_without_a_file(tmp_path: Path) -> None:
    layers = [OccupancyLayer("occupancy", "map"), SemanticLayer("objects", "map")]
    save_map(Hypermap(layers), tmp_path / "t.hmap")
    with zipfile.ZipFile(tmp_path / "t.hmap") as archive:
        assert archive.namelist() == ["hmap_config.yaml"]
    again = open_map(tmp_path / "t.hmap")
    assert occupancy(again).grid is None
    assert len(semantic(again, "objects")) == 0


class Unsaveable(OccupancyLayer):
    class_name = "RoomLayer"


def test_a_layer_without_plugin_is_not_saved_and_the_old_file_stays(tmp_path: Path) -> None:
    path = tmp_path / "t.hmap"
    save_map(small_map(), path)
    before = path.read_bytes()
    with pytest.raises(HypermapError) as error:
        save_map(Hypermap([Unsaveable("rooms", "map")]), path)
    assert str(error.value).startswith(
        "layer 'rooms' cannot be saved: no plug-in for its class 'RoomLayer' is installed "
        "(known: OccupancyGridLayer, SemanticLayer"
    )
    with pytest.raises(TypeError, match="YAML cannot store the type object"):
        save_map(Hypermap(metadata={"a": object()}), path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_folder_to_save_in_must_exist(tmp_path: Path) -> None:
    for target in ("none/t.hmap", "none/t.yaml"):
        with pytest.raises(FileMissing) as error:
            save_map(small_map(), tmp_path / target)
        assert str(error.value) == f"{tmp_path / 'none'}: there is no such folder to save in"


# Other kinds of files


def test_the_cells_of_all_layers_count_together(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    grid, cells = GridGeometry(4, 3, 0.05), np.zeros((3, 4), np.int8)
    layers = [OccupancyLayer(name, "map", grid, cells) for name in ("one", "two")]
    save_map(Hypermap(layers), tmp_path / "map.hmap")
    monkeypatch.setattr(limits, "MAX_CELLS", 23)
    with pytest.raises(FormatError, match=r"has layers of 24 cells .* HYPERMAP_MAX_CELLS=24"):
        open_map(tmp_path / "map.hmap")
    monkeypatch.setenv("HYPERMAP_MAX_CELLS", "24")
    assert len(open_map(tmp_path / "map.hmap").layers) == 2


def test_a_bare_map_server_map_becomes_a_map_of_one_layer(tmp_path: Path) -> None:
    save_map(small_map(), tmp_path)
    hypermap = open_map(tmp_path / "occupancy.yaml")
    assert [layer.name for layer in hypermap.layers] == ["occupancy"]
    assert (occupancy(hypermap).cells == occupancy(small_map()).cells).all()
    assert hypermap.base_frame == "map"


@pytest.mark.parametrize("target", ["t.hmap", "map.yaml"])
def test_objects_are_kept_as_parquet_where_that_is_asked_for(tmp_path: Path, target: str) -> None:
    pytest.importorskip("pyarrow")
    path = tmp_path / target
    save_map(small_map(), path, semantic="parquet")
    assert map_facts(open_map(path)) == map_facts(small_map())
    config = read_yaml(files_of(path)[path.name if target != "t.hmap" else CONFIG_NAME], "t")
    [layer] = [layer for layer in config["layers"] if layer["class"] == "SemanticLayer"]
    # A reader that does not know the file starts with an empty layer.
    assert layer["load_file"] is False
    assert layer["binary_file"] == f"{layer['file']}.parquet"
    assert files_of(path)[layer["binary_file"]].startswith(b"PAR1")
    save_map(open_map(path), path, semantic="yaml")
    assert map_facts(open_map(path)) == map_facts(small_map())
    assert b"binary_file" not in files_of(path)[path.name if target != "t.hmap" else CONFIG_NAME]


def test_many_objects_are_kept_as_parquet_by_themselves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("pyarrow")
    monkeypatch.setattr(semantic_yaml, "MANY_OBJECTS", 1)
    save_map(small_map(), tmp_path / "many.hmap")
    assert any(name.endswith(".parquet") for name in files_of(tmp_path / "many.hmap"))
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    save_map(small_map(), tmp_path / "without.hmap")
    assert not any(name.endswith(".parquet") for name in files_of(tmp_path / "without.hmap"))
    with pytest.raises(MissingExtra, match="GeoParquet needs an optional library"):
        open_map(tmp_path / "many.hmap")
    with pytest.raises(MissingExtra):
        save_map(small_map(), tmp_path / "t.hmap", semantic="parquet")
    assert not (tmp_path / "t.hmap").exists()


def test_few_objects_that_are_too_much_for_yaml_are_kept_as_parquet_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("pyarrow")
    circle = shapely.Point(0, 0).buffer(1, quad_segs=100)
    layer = SemanticLayer("objects", "map", [SemanticObject("table", circle)] * 3)
    monkeypatch.setattr(limits, "MAX_YAML_BYTES", 10_000)
    save_map(Hypermap([layer]), tmp_path / "t.hmap")
    assert any(name.endswith(".parquet") for name in files_of(tmp_path / "t.hmap"))
    assert map_facts(open_map(tmp_path / "t.hmap")) == map_facts(Hypermap([layer]))
    message = "too large to read back; save the semantic layers as GeoParquet"
    with pytest.raises(HypermapError, match=message):
        save_map(Hypermap([layer]), tmp_path / "yaml.hmap", semantic="yaml")
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(HypermapError, match=message):
        save_map(Hypermap([layer]), tmp_path / "without.hmap")
    assert [path.name for path in tmp_path.iterdir()] == ["t.hmap"]


@pytest.mark.parametrize("name", ["x" * 300, "x/" * 3000, "x\0y", "x" * 300 + ".yaml"])
def test_a_name_that_no_file_can_have_is_one_clear_error(tmp_path: Path, name: str) -> None:
    with pytest.raises(HypermapError, match=r"xx|x/x|x.*y"):
        open_map(tmp_path / name)
    with pytest.raises(HypermapError, match=r"xx|x/x|x.*y"):
        save_map(small_map(), tmp_path / name)
    assert list(tmp_path.iterdir()) == []


SAVE_MAP = """
import sys
from hypermap.formats import open_map, save_map
save_map(open_map(sys.argv[2]), sys.argv[3])
"""


def test_a_folder_holds_all_of_one_save_however_often_saves_are_killed(tmp_path: Path) -> None:
    old = small_map()
    table = SemanticLayer("objects", "lab", [SemanticObject("table", shapely.box(3, 3, 4, 4))])
    grid = OccupancyLayer("occupancy", "map", occupancy(old).grid, np.zeros((2, 3), np.int8))
    new = Hypermap([grid, table], old.frames, {"profile": "thesis"})
    folder, other = tmp_path / "folder", tmp_path / "new.hmap"
    save_map(new, other)
    for rename in itertools.count():
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        save_map(old, folder)
        if not killed_at(rename, SAVE_MAP, str(other), str(folder)):
            break
        there = new if rename else old
        kept = save_with_backup(there, folder / CONFIG_NAME)  # as the next program does there
        assert kept is not None
        expected = map_facts(there)
        assert map_facts(open_map(kept)) == expected
        assert map_facts(open_map(folder)) == expected
    assert rename == 5  # the journal, a grid of two files, the objects, the configuration


def test_a_backup_is_not_written_through_a_link_that_came_with_the_map(tmp_path: Path) -> None:
    (tmp_path / "maps").mkdir()
    path = tmp_path / "maps" / "lab.hmap"
    save_map(small_map(), path)
    (tmp_path / "maps" / "lab.hmap.bak").symlink_to(tmp_path / "profile")
    with pytest.raises(
        HypermapError, match=r"nothing is saved: .*\.bak: .* leads out of the folder"
    ):
        save_with_backup(small_map(), path)
    assert not (tmp_path / "profile").exists()


def test_a_save_that_was_cut_off_and_cannot_be_completed_is_not_read_by_halves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save_map(small_map(), tmp_path)
    save_map(small_map(), tmp_path / "new.hmap")
    assert killed_at(2, SAVE_MAP, str(tmp_path / "new.hmap"), str(tmp_path))

    def refuse(_path: Path, _target: Path) -> Path:
        raise PermissionError(13, "Permission denied")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", refuse)
        with pytest.raises(HypermapError) as error:
            open_map(tmp_path)
    assert str(error.value) == (
        f"{tmp_path}: a save was interrupted here, and cannot be completed (Permission denied): "
        "open the map once with permission to write in this folder"
    )
    assert map_facts(open_map(tmp_path)) == map_facts(small_map())
