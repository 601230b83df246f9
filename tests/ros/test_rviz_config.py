"""Configurations of rviz, and which displays a window shows."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import shapely
import yaml
from typer.testing import CliRunner

from hypermap.cli.main import app
from hypermap.core.errors import HypermapError
from hypermap.core.frames import FrameTree, Pose2D, Transform
from hypermap.core.grid import GridGeometry
from hypermap.core.hypermap import Hypermap
from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.opaque import OpaqueLayer
from hypermap.core.semantic import SemanticLayer, SemanticObject
from hypermap.core.value_layer import ValueLayer
from hypermap.formats import open_map, save_map
from hypermap.ros.mapper.semantic_mapper import SemanticMapper
from hypermap.ros.rviz.config import RvizView, configuration, map_configuration, view_of
from hypermap.ros.rviz.window import LayerDisplays
from hypermap.testing import occupancy_from_text, square


def building() -> Hypermap:
    layers = [
        occupancy_from_text("....\n....", name="occupancy"),
        SemanticLayer("2nd floor", "lab", [square("cup", 0, 0), square("bed", 3, 0, 2)]),
    ]
    return Hypermap(layers, FrameTree([Transform("map", "lab", Pose2D(1, 2, math.pi / 2))]))


def manager(text: str) -> Any:
    return yaml.safe_load(text)["Visualization Manager"]


def displays(text: str) -> dict[str, Any]:
    return {shown["Name"]: shown for shown in manager(text)["Displays"]}


def test_each_layer_has_a_display_with_its_topic() -> None:
    text = map_configuration(building(), "/robot/server")
    shown = displays(text)
    masks = ["Keepout zones", "Speed limits"]
    look = "Where to look next"
    assert list(shown) == ["Grid", "occupancy", "2nd floor", *masks, look, "Frames"]
    assert shown["occupancy"]["Class"] == "rviz/Map"
    assert shown["occupancy"]["Topic"] == "/robot/server/occupancy_map"
    assert shown["2nd floor"]["Class"] == "rviz/MarkerArray"
    assert shown["2nd floor"]["Marker Topic"] == "/robot/server/layer_2nd_floor_markers"
    assert shown["2nd floor"]["Namespaces"] == {"bed": True, "cup": True}
    assert manager(text)["Global Options"]["Fixed Frame"] == "map"


def test_rviz2_receives_what_was_published_before_it_came() -> None:
    text = map_configuration(building(), ros2=True)
    shown = displays(text)
    assert shown["occupancy"]["Class"] == "rviz_default_plugins/Map"
    for topic in (shown["occupancy"]["Topic"], shown["2nd floor"]["Topic"]):
        assert topic["Durability Policy"] == "Transient Local"
        assert topic["Reliability Policy"] == "Reliable"
    assert shown["occupancy"]["Update Topic"]["Durability Policy"] == "Volatile"
    assert shown["2nd floor"]["Topic"]["Value"] == "/hypermap_server/layer_2nd_floor_markers"
    assert "rviz/" not in text


@pytest.mark.parametrize("ros2", [False, True])
def test_the_servers_masks_have_displays_that_can_be_switched_on(ros2: bool) -> None:
    shown = displays(map_configuration(building(), "/robot/server", ros2=ros2))
    for name, topic in (("Keepout zones", "keepout_mask"), ("Speed limits", "speed_mask")):
        display = shown[name]
        assert display["Class"] == ("rviz_default_plugins/Map" if ros2 else "rviz/Map")
        heard = display["Topic"]["Value"] if ros2 else display["Topic"]
        assert heard == f"/robot/server/{topic}"
        assert not display["Enabled"]
        assert display["Alpha"] < 1, "what is below stays visible"
        if ros2:
            assert display["Topic"]["Durability Policy"] == "Transient Local"


def test_measured_values_are_a_map_through_which_the_floor_is_seen() -> None:
    hypermap = building()
    hypermap.add(ValueLayer("warmth", "map"))
    display = displays(map_configuration(hypermap))["warmth"]
    assert display["Class"] == "rviz/Map"
    assert 0 < display["Alpha"] < 1
    assert display["Topic"].endswith("/warmth_values")


def test_a_layer_that_no_topic_shows_has_no_display() -> None:
    hypermap = building()
    hypermap.add(OpaqueLayer("FlowLayer", "people", "map"))
    assert "people" not in displays(map_configuration(hypermap))


def test_the_view_shows_all_that_is_known() -> None:
    cells = np.full((100, 200), -1, dtype=np.int8)
    cells[10:30, 20:60] = 0  # 2 m .. 6 m, 1 m .. 3 m
    grid = OccupancyLayer("grid", "map", GridGeometry(200, 100, 0.1, Pose2D(100, 0)), cells)
    view = view_of(Hypermap([grid]))
    assert (view.x, view.y) == pytest.approx((104, 2))
    assert 400 < view.scale * 4 < 1280  # pixels of a window of that width
    # An object in another frame: at (1, 2) in the map lies (0, 0) of the lab.
    lab = SemanticLayer("things", "lab", [SemanticObject("bed", shapely.box(1, 0, 3, 2))])
    frames = FrameTree([Transform("map", "lab", Pose2D(1, 2, math.pi / 2))])
    empty = OccupancyLayer("grid", "map")
    view = view_of(Hypermap([empty, lab], frames))
    assert (view.x, view.y) == pytest.approx((0, 4))
    assert view_of(Hypermap()) == view_of(Hypermap([empty])) == RvizView()


@pytest.mark.parametrize(("size", "cell"), [(10, 1), (500, 10)])
def test_lines_reach_beyond_what_is_seen(size: float, cell: int) -> None:
    view = RvizView.of((1000, -50, 1000 + size, -50 + size))
    ground = displays(configuration([], "map", view))["Grid"]
    assert ground["Cell Size"] == cell
    middle = np.array([ground["Offset"]["X"], ground["Offset"]["Y"]])
    assert (middle % cell == 0).all()
    reach = cell * ground["Plane Cell Count"] / 2
    corners = np.array([(1000, -50), (1000 + size, -50 + size)])
    assert (np.abs(corners - middle) < reach).all()
    assert ground["Plane Cell Count"] < 300


def test_a_point_is_seen_from_a_distance() -> None:
    assert RvizView.of((3, 4, 3, 4)).scale < 1000


# The command


def run(*words: Any) -> Any:
    return CliRunner().invoke(app, ["rviz", *map(str, words)])


def test_the_command_writes_a_configuration(tmp_path: Path) -> None:
    file, map_file = tmp_path / "room.rviz", tmp_path / "room.hmap"
    save_map(building(), map_file)
    assert run(map_file, "-o", file, "--server", "robot/server").exit_code == 0
    assert file.read_text() == map_configuration(building(), "/robot/server")
    assert isinstance(run(map_file, "-o", file).exception, HypermapError)  # it exists
    assert run(map_file, "-o", file, "--ros2", "--force").exit_code == 0
    assert file.read_text() == map_configuration(building(), ros2=True)


def test_a_configuration_is_for_a_map(tmp_path: Path) -> None:
    result = run("-o", tmp_path / "room.rviz")
    assert "name the map" in str(result.exception)


def test_rviz2_is_started_with_a_configuration_for_the_map(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    map_file, kept = tmp_path / "room.hmap", tmp_path / "kept.rviz"
    save_map(building(), map_file)
    program = tmp_path / "bin" / "rviz2"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\n[ "$1" = -d ] && exec cp "$2" {kept}\n')
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{program.parent}:/usr/bin:/bin")
    assert run(map_file, "--ros2").exit_code == 0
    assert kept.read_text() == map_configuration(building(), ros2=True)
    program.write_text("#!/bin/sh\nexit 3\n")
    assert "exit code 3" in str(run(map_file, "--ros2").exception)
    program.unlink()
    assert "rviz2 is missing" in str(run(map_file, "--ros2").exception)
    assert "name the map" in str(run("--ros2").exception)


# The window


class RecordingWindow:
    """A window that records its orders, and a node that hands on what it hears."""

    def __init__(self) -> None:
        self.orders: list[tuple[str, dict[str, Any]]] = []
        self.heard: dict[str, Any] = {}
        self.closed: list[str] = []

    def tell(self, do: str, **order: Any) -> None:
        self.orders.append((do, order))

    def subscribe(self, topic: str, type_name: str, callback: Any, *, latched: bool) -> Any:
        assert latched
        self.heard[topic] = callback
        return SimpleNamespace(close=lambda: self.closed.append(topic))

    def metadata(self, *layers: tuple[str, str, str]) -> list[tuple[str, Any]]:
        """Hear of layers, given as class, name and frame, and return the orders since."""
        before = len(self.orders)
        named = [SimpleNamespace(class_name=c, name=n, frame_id=f) for c, n, f in layers]
        self.heard["/server/hypermap_metadata"](SimpleNamespace(layers=named))
        return [(do, order.get("name", order.get("frame"))) for do, order in self.orders[before:]]


GRID = ("OccupancyGridLayer", "grid", "map")
THINGS = ("SemanticLayer", "things", "map")


def test_displays_come_and_go_with_the_layers() -> None:
    window: Any = RecordingWindow()
    LayerDisplays(window, window, "/server", RvizView())
    assert window.orders[0] == ("load", {"config": configuration([], "map", RvizView())})
    assert window.metadata(GRID, THINGS) == [("put", "grid"), ("put", "things")]
    assert window.orders[-1][1]["open"] == ["Namespaces"]
    assert window.metadata(GRID, THINGS) == []  # so what the user has set there stays
    assert window.metadata(THINGS, ("FlowLayer", "people", "map")) == [("remove", "grid")]
    assert window.metadata(("OccupancyGridLayer", "things", "map")) == [("put", "things")]
    assert window.orders[-1][1]["class"] == "rviz/Map"
    assert window.metadata() == [("remove", "things")]


def test_the_fixed_frame_is_that_of_the_first_layer() -> None:
    window: Any = RecordingWindow()
    LayerDisplays(window, window, "/server", RvizView())
    assert window.metadata(("SemanticLayer", "things", "lab"), GRID)[0] == ("frame", "lab")


def grid_at(x: float, y: float, width: int = 80) -> Any:
    """Return a `nav_msgs/MapMetaData` of a grid of 8 m x 4 m, or wider."""
    origin = SimpleNamespace(position=SimpleNamespace(x=x, y=y))
    return SimpleNamespace(width=width, height=40, resolution=0.1, origin=origin)


NO_GRID = grid_at(0, 0, width=0)
A_GRID = ("OccupancyGridLayer", "a grid", "map")


def looks(window: Any) -> list[tuple[float, float]]:
    """Return the middle of each view that the window was ordered to show."""
    shown = [
        yaml.safe_load(order["config"])["Current"] for do, order in window.orders if do == "view"
    ]
    return [(round(view["X"], 3), round(view["Y"], 3)) for view in shown]


def test_the_window_looks_once_at_the_first_grid() -> None:
    window: Any = RecordingWindow()
    LayerDisplays(window, window, "/server")
    window.metadata(THINGS, A_GRID)
    hear = window.heard["/server/a_grid_map_metadata"]
    for message in (NO_GRID, grid_at(10, 2), grid_at(10, 2), grid_at(10, 2, 90)):
        hear(message)  # the last one has grown, as that of a map that is being made
    assert looks(window) == [(14.0, 4.0)]
    (put,) = (order for do, order in window.orders if do == "put" and order["name"] == "Grid")
    assert yaml.safe_load(put["config"])["Offset"]["X"] == 14
    assert window.metadata(THINGS) == [("remove", "a grid")]


@pytest.mark.parametrize("first", ["the map", "its grid"])
def test_the_window_looks_at_another_map_when_one_comes(first: str) -> None:
    window: Any = RecordingWindow()
    LayerDisplays(window, window, "/server")
    window.metadata(A_GRID)
    hear = window.heard["/server/a_grid_map_metadata"]
    hear(grid_at(10, 2))
    if first == "the map":  # topics come in any order
        window.metadata(A_GRID, THINGS)
        hear(grid_at(-100, 2))
    else:
        hear(grid_at(-100, 2))
        assert len(looks(window)) == 1
        window.metadata(A_GRID, THINGS)
    hear(grid_at(-100, 2, 90))
    assert looks(window) == [(14.0, 4.0), (-96.0, 4.0)]
    assert len([do for do, _ in window.orders if do == "load"]) == 1, "what the user has set stays"


def test_the_same_map_once_more_leaves_the_view() -> None:
    window: Any = RecordingWindow()
    LayerDisplays(window, window, "/server")
    for _ in range(2):
        window.metadata(A_GRID)
        window.heard["/server/a_grid_map_metadata"](grid_at(10, 2))
    assert looks(window) == [(14.0, 4.0)]


def test_the_grid_of_another_map_may_have_another_name() -> None:
    window: Any = RecordingWindow()
    LayerDisplays(window, window, "/server")
    window.metadata(A_GRID)
    window.heard["/server/a_grid_map_metadata"](grid_at(10, 2))
    window.metadata(GRID)
    assert window.closed == ["/server/a_grid_map_metadata"]
    window.heard["/server/grid_map_metadata"](grid_at(20, 2))
    assert looks(window) == [(14.0, 4.0), (24.0, 4.0)]


def test_a_view_that_was_given_stays_until_another_map_comes() -> None:
    window: Any = RecordingWindow()
    LayerDisplays(window, window, "/server", RvizView(1, 2, 3))
    window.metadata(GRID)
    hear = window.heard["/server/grid_map_metadata"]
    hear(grid_at(10, 2))
    assert looks(window) == []
    window.metadata(GRID)
    hear(grid_at(20, 2))
    assert looks(window) == [(24.0, 4.0)]


def test_a_mask_is_shown_from_its_first_message_on() -> None:
    window: Any = RecordingWindow()
    LayerDisplays(window, window, "/server", RvizView())
    window.metadata(THINGS)
    for _ in range(2):
        window.heard["/server/keepout_mask"](SimpleNamespace())
    put = [order for do, order in window.orders if do == "put"]
    assert [order["name"] for order in put] == ["things", "Keepout zones"]
    shown = yaml.safe_load(put[1]["config"])
    assert (shown["Class"], shown["Topic"]) == ("rviz/Map", "/server/keepout_mask")
    assert shown["Enabled"]
    assert window.metadata() == [("remove", "things")], "it is no layer"


def test_doors_and_the_graph_have_a_display_where_the_map_has_rooms() -> None:
    rooms = SemanticLayer("rooms", "map", [square("office", 0, 0)])
    shown = displays(map_configuration(Hypermap([rooms]), "/server"))["Doors and graph"]
    assert (shown["Class"], shown["Marker Topic"]) == ("rviz/MarkerArray", "/server/room_graph")
    window: Any = RecordingWindow()
    LayerDisplays(window, window, "/server", RvizView())
    window.heard["/server/room_graph"](SimpleNamespace())
    assert [order["name"] for do, order in window.orders if do == "put"] == ["Doors and graph"]


@pytest.mark.parametrize("ros2", [False, True])
def test_frontiers_are_those_of_the_mapper_in_the_servers_namespace(ros2: bool) -> None:
    shown = displays(map_configuration(building(), "/robot/server", ros2=ros2))
    display = shown["Where to look next"]
    heard = display["Topic"]["Value"] if ros2 else display["Marker Topic"]
    assert heard == f"/robot/{SemanticMapper.NAME}/frontiers"
    assert display["Enabled"]
    window: Any = RecordingWindow()
    LayerDisplays(window, window, "/server", RvizView())
    window.heard[f"/{SemanticMapper.NAME}/frontiers"](SimpleNamespace())
    assert [order["name"] for do, order in window.orders if do == "put"] == ["Where to look next"]


# The package of launch files

PACKAGE = Path(__file__).parents[2] / "ros" / "hypermap"


@pytest.mark.parametrize(("name", "ros2"), [("hypermap", False), ("hypermap_ros2", True)])
def test_the_package_shows_the_layers_that_its_maps_have(name: str, ros2: bool) -> None:
    """To write the files again: python -m tests.ros.test_rviz_config."""
    assert (PACKAGE / "rviz" / f"{name}.rviz").read_text() == of_the_package(ros2)


def of_the_package(ros2: bool) -> str:
    return map_configuration(open_map(PACKAGE / "maps" / "subscribe.yaml"), ros2=ros2)


if __name__ == "__main__":
    (PACKAGE / "rviz" / "hypermap.rviz").write_text(of_the_package(ros2=False))
    (PACKAGE / "rviz" / "hypermap_ros2.rviz").write_text(of_the_package(ros2=True))
