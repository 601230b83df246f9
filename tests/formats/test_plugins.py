from __future__ import annotations

import sys
from pathlib import Path

import pytest

from hypermap.core.errors import HypermapError
from hypermap.formats import map_server, semantic_yaml
from hypermap.formats.plugins import installed_layers, plugin_for

PLUGIN = """
from hypermap.core.occupancy import OccupancyLayer
class Rooms:
    def empty(self, name, frame_id, settings): return OccupancyLayer(name, frame_id)
    def load(self, store, file, name, frame_id, settings): ...
    def save(self, layer, store, file): ...
PLUGIN = Rooms()
"""


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of packages with plug-ins, as pip would leave them."""
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "some_rooms.py").write_text(PLUGIN)
    (tmp_path / "broken_rooms.py").write_text("import no_such_library")
    (tmp_path / "half_rooms.py").write_text("def empty(): ...\ndef load(): ...\n")
    info = tmp_path / "some_rooms-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: some-rooms\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[hypermap.layers]\n"
        "RoomLayer = some_rooms:PLUGIN\n"
        "BrokenLayer = broken_rooms:PLUGIN\n"
        "HalfLayer = half_rooms\n"
        "NowhereLayer = some_rooms:NOTHING\n"
        "SemanticLayer = some_rooms:PLUGIN\n"
    )
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
            "HalfLayer",
            "the plug-in for layers of class 'HalfLayer' (half_rooms) has no function 'save'",
        ),
    ],
)
def test_a_plugin_that_does_not_work_is_named(install: Path, class_name: str, message: str) -> None:
    with pytest.raises(HypermapError) as error:
        plugin_for(class_name)
    assert str(error.value).startswith(message)
