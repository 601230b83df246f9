from __future__ import annotations

import sys
from pathlib import Path

import pytest

from hypermap.core.errors import HypermapError
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.formats import open_map, save_map
from hypermap.formats.grid import map_server
from hypermap.formats.plugins import blamed_on_plugin, installed_layers, plugin_for
from hypermap.formats.semantic import yaml_files as semantic_yaml

from ..installed import install_package

PLUGIN = """
from hypermap.core.occupancy import OccupancyLayer
class Rooms:
    def empty(self, name, frame_id, settings): return OccupancyLayer(name, frame_id)
    def load(self, store, file, name, frame_id, settings): ...
    def save(self, layer, store, file): ...
PLUGIN = Rooms()
"""


FAILING = """
class Failing:
    def empty(self, name, frame_id, settings): raise RuntimeError("no license")
    def load(self, store, file, name, frame_id, settings): raise RuntimeError("no license")
    def save(self, layer, store, file): raise SystemExit(3)
PLUGIN = Failing()
"""


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of packages with plug-ins, as pip would leave them."""
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "some_rooms.py").write_text(PLUGIN)
    (tmp_path / "broken_rooms.py").write_text("import no_such_library")
    (tmp_path / "failing_rooms.py").write_text(FAILING)
    (tmp_path / "ending_rooms.py").write_text("import sys; sys.exit('no license')")
    (tmp_path / "full_rooms.py").write_text("raise MemoryError")
    (tmp_path / "half_rooms.py").write_text("def empty(): ...\ndef load(): ...\n")
    points = {
        "RoomLayer": "some_rooms:PLUGIN",
        "BrokenLayer": "broken_rooms:PLUGIN",
        "HalfLayer": "half_rooms",
        "EndingLayer": "ending_rooms:PLUGIN",
        "FullLayer": "full_rooms:PLUGIN",
        "FailingLayer": "failing_rooms:PLUGIN",
        "NowhereLayer": "some_rooms:NOTHING",
        "SemanticLayer": "some_rooms:PLUGIN",
    }
    install_package(tmp_path, "some-rooms", "hypermap.layers", points)
    return tmp_path


def test_our_layers_come_by_their_class_names() -> None:
    assert plugin_for("OccupancyGridLayer") is map_server.PLUGIN
    assert plugin_for("SemanticLayer") is semantic_yaml.PLUGIN
    assert installed_layers()[:2] == ("OccupancyGridLayer", "SemanticLayer")


def test_an_unknown_class_has_no_plugin() -> None:
    assert plugin_for("RoomLayer") is None


def test_a_package_brings_layers_and_cannot_replace_ours(install: Path) -> None:
    plugin = plugin_for("RoomLayer")
    assert plugin is sys.modules["some_rooms"].PLUGIN
    assert plugin_for("SemanticLayer") is semantic_yaml.PLUGIN
    assert {"RoomLayer", "HalfLayer"} < set(installed_layers())


@pytest.mark.parametrize(
    ("class_name", "message"),
    [
        (
            "BrokenLayer",
            "the plug-in for layers of class 'BrokenLayer' (broken_rooms:PLUGIN) cannot be "
            "imported: ModuleNotFoundError: No module named 'no_such_library'",
        ),
        (
            "NowhereLayer",
            "the plug-in for layers of class 'NowhereLayer' (some_rooms:NOTHING) cannot be "
            "imported: AttributeError: ",
        ),
        (
            "EndingLayer",
            "the plug-in for layers of class 'EndingLayer' (ending_rooms:PLUGIN) cannot be "
            "imported: SystemExit: no license; update its package",
        ),
        (
            "HalfLayer",
            "the plug-in for layers of class 'HalfLayer' (half_rooms) has no function 'save'",
        ),
    ],
)
def test_a_plugin_that_does_not_work_is_named(install: Path, class_name: str, message: str) -> None:
    with pytest.raises(HypermapError) as error:
        plugin_for(class_name)
    assert str(error.value).startswith(message)


def test_of_two_packages_with_layers_of_one_class_none_is_taken(install: Path) -> None:
    other = {"RoomLayer": "other_rooms:PLUGIN", "HalfLayer": "half_rooms"}
    install_package(install, "other-rooms", "hypermap.layers", other)
    with pytest.raises(HypermapError, match=r"of other-rooms.* have the same name 'RoomLayer'"):
        plugin_for("RoomLayer")
    with pytest.raises(HypermapError, match="has no function 'save'"):  # both offer the same one
        plugin_for("HalfLayer")


@pytest.mark.usefixtures("install")
def test_what_a_plugin_raises_is_reported_as_the_plugins(tmp_path: Path) -> None:
    class Failing(OccupancyLayer):
        class_name = "FailingLayer"

    with pytest.raises(HypermapError) as error:
        save_map(Hypermap([Failing("rooms", "map")]), tmp_path / "out.hmap")
    assert str(error.value) == (
        "the plug-in for layers of class 'FailingLayer' cannot write layer 'rooms': SystemExit: 3"
    )
    config = tmp_path / "map" / "hmap_config.yaml"
    config.parent.mkdir()
    config.write_text(
        "layers: [{class: FailingLayer, name: rooms, frame_id: map, load_file: false}]\n"
    )
    with pytest.raises(HypermapError, match="cannot read layer 'rooms': RuntimeError: no license"):
        open_map(config.parent)


@pytest.mark.usefixtures("install")
def test_a_full_memory_and_signals_are_not_the_plugins_fault() -> None:
    with pytest.raises(MemoryError):
        plugin_for("FullLayer")
    with pytest.raises(MemoryError), blamed_on_plugin("FailingLayer", "cannot read it"):
        raise MemoryError
    for end in (KeyboardInterrupt, SystemExit(143)):  # Ctrl-C, SIGTERM
        with pytest.raises(BaseException) as ended, blamed_on_plugin("FailingLayer", "cannot"):
            raise end
        assert not isinstance(ended.value, HypermapError)
