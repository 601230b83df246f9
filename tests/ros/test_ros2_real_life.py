"""The life of our nodes on the real ROS 2: launched, managed, mapping, and ended."""

from __future__ import annotations

import os
import re
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hypermap.core.occupancy import OccupancyLayer
from hypermap.core.semantic import SemanticLayer
from hypermap.formats import open_map, save_map

from .conftest import ROS, Process, wait_for
from .map_server_tools import building, saved
from .ros2_real import Ros2, environment, launch2, point, ros2, string_at
from .ros2_robot import DEPTH, DETECTIONS, drive

__all__ = ["environment", "launch2", "ros2"]

pytestmark = [pytest.mark.xdist_group("ros2"), pytest.mark.slow]

NODE = "/hypermap_server"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a map."""
    return saved(building(), tmp_path / "building.hmap").parent


# nav2


def test_the_tools_of_nav2_load_maps(
    ros2: Ros2, start: Callable[..., Process], folder: Path
) -> None:
    if not ros2.has("nav2_msgs"):
        pytest.skip("nav2_msgs is not here")
    (folder / "bad.yaml").write_text("image: floor.png\nresolution: wide\n")
    words = ("-p", f"map_directory:={folder}", "-p", "console:=false")
    remap = ("-r", "~/nav2_load_map:=/map_server/load_map")
    start("hypermap", "serve", "--ros2", "--ros-args", "-r", "__node:=maps", *words, *remap,
          env=ros2.environment, is_new=True)  # fmt: skip
    kind = "nav2_msgs/srv/LoadMap"
    answer = ros2.call("/map_server/load_map", kind, map_url=str(folder / "building.hmap"))
    assert (answer["result"], answer["map"]["info"]["width"]) == (0, 3)
    for url, result in (("no.yaml", 1), ("bad.yaml", 3), ("/etc/passwd", 255)):
        answer = ros2.call("/map_server/load_map", kind, map_url=url)
        assert (answer["result"], answer["map"]["data"]) == (result, [])


def test_a_lifecycle_manager_bonds_with_the_node(ros2: Ros2, start: Callable[..., Process]) -> None:
    if not ros2.has("bondpy"):
        pytest.skip("bondpy is not here")
    name = "bonded"
    process = start("hypermap", "serve", "--ros2", "--ros-args", "-r", f"__node:={name}",
                    "-p", "console:=false", env=ros2.environment, is_new=True)  # fmt: skip
    ros2.ask("bond", name=name)
    assert not ros2.ask("is_bond_broken")
    assert process.stop(signal.SIGTERM) == 0
    wait_for(lambda: ros2.ask("is_bond_broken"), "the bond to end with the node")


# Its life


def test_the_lifecycle_is_that_of_ros(ros2: Ros2, launch2: Any, folder: Path) -> None:
    process = launch2(
        "show_map.launch.xml", file=folder / "building.hmap", autostart="false", rviz="false"
    )
    process.expect("waiting for a lifecycle manager", 90)
    steps = {
        "configure": "inactive [2]",
        "activate": "active [3]",
        "deactivate": "inactive [2]",
        "cleanup": "unconfigured [1]",
        "shutdown": "finalized [4]",
    }
    for step, state in steps.items():
        wait_for(lambda: NODE in ros2.tool("lifecycle", "nodes"), "the node")
        assert "Transitioning successful" in ros2.tool("lifecycle", "set", NODE, step)
        assert ros2.tool("lifecycle", "get", NODE).strip() == state
    assert process.stop() == 0
    assert "Traceback" not in process.output, process.output


def test_what_cannot_be_configured_says_why_and_may_be_tried_again(
    ros2: Ros2, launch2: Any, tmp_path: Path
) -> None:
    file = tmp_path / "late.hmap"
    process = launch2("show_map.launch.xml", file=file, autostart="false", rviz="false")
    process.expect("waiting for a lifecycle manager", 90)
    wait_for(lambda: NODE in ros2.tool("lifecycle", "nodes"), "the node")
    shown = ros2.tool("lifecycle", "set", NODE, "configure", is_ok=False)
    assert "Transitioning failed" in shown
    process.expect("late.hmap")
    save_map(building(), file)
    assert "Transitioning successful" in ros2.tool("lifecycle", "set", NODE, "configure")
    assert "Traceback" not in process.output, process.output


def test_ctrl_c_ends_a_launched_node_in_order(launch2: Any, folder: Path) -> None:
    process = launch2("show_map.launch.xml", file=folder / "building.hmap", rviz="false")
    process.expect("loaded ", 90)
    process.stop(signal.SIGINT)
    ended_in_order(process)


def test_a_signal_ends_a_launched_node_in_order(launch2: Any, folder: Path) -> None:
    process = launch2("show_map.launch.xml", file=folder / "building.hmap", rviz="false")
    process.expect("loaded ", 90)
    found = re.search(r"process started with pid \[(\d+)\]", process.output)
    assert found is not None
    os.kill(int(found[1]), signal.SIGTERM)  # `ros2 launch` passes none on to its nodes
    process.popen.wait(20)
    ended_in_order(process)


def ended_in_order(process: Process) -> None:
    assert "process has finished cleanly" in process.output, process.output
    assert "SIGKILL" not in process.output
    assert "Traceback" not in process.output, process.output


def test_a_map_that_is_missing_is_one_line(ros2: Ros2, launch2: Any, tmp_path: Path) -> None:
    process = launch2("show_map.launch.xml", file=tmp_path / "no.hmap", rviz="false")
    process.expect("process has died", 90)
    assert "no.hmap" in process.output
    assert "Traceback" not in process.output


def test_a_misspelled_parameter_is_a_warning(ros2: Ros2, start: Callable[..., Process]) -> None:
    process = start("hypermap", "serve", "--ros2", "--ros-args", "-p", "keepuot:=['desk 0.2']",
                    "-p", "console:=false", "-r", "__node:=misspelled",
                    env=ros2.environment, is_new=True)  # fmt: skip
    process.expect("ignoring the unknown parameter 'keepuot'; did you mean 'keepout'?", 90)


@pytest.mark.parametrize(
    "file", sorted(file.name for file in (ROS / "hypermap" / "launch").glob("*.launch.xml"))
)
def test_launch_files_show_their_arguments(ros2: Ros2, file: str) -> None:
    shown = ros2.tool("launch", "hypermap", file, "--show-args")
    assert "'rviz'" in shown


# Mapping


def test_a_drive_becomes_a_map(
    ros2: Ros2, launch2: Any, start: Callable[..., Process], tmp_path: Path
) -> None:
    file = tmp_path / "drive.hmap"
    process = launch2(
        "semantic_mapping.launch.xml",
        depth_topic=DEPTH,
        detections_topic=DETECTIONS,
        save_to=file,
    )
    robot = Path(__file__).with_name("ros2_robot.py")
    start(sys.executable, robot, "12", "0.5", env=ros2.environment, is_new=True)
    ros2.ask("listen", topic="/semantic_map", type="hypermap_msgs/msg/SemanticMap", latched=True)
    wait_for(lambda: ros2.ask("heard", topic="/semantic_map")[-1]["objects"], "objects", 120)
    wait_for(lambda: string_of_objects(ros2), "objects of the map server")
    process.stop()
    assert process.output.count("process has finished cleanly") == 2, process.output
    assert "Traceback" not in process.output
    saved_map = open_map(file)
    layer = saved_map["semantic"]
    assert isinstance(layer, SemanticLayer)
    seen = {str(n) for f in drive(12) if f.detections is not None for n in f.detections.names}
    assert {item.name for item in layer.objects()} <= seen
    assert len(layer) > 0
    grid = next(item for item in saved_map if isinstance(item, OccupancyLayer))
    assert grid.cells is not None  # without map_topic, it is made from depth


def string_of_objects(ros2: Ros2) -> list[str]:
    kind = "hypermap_msgs/srv/FindObjects"
    return [item["object"]["name"] for item in ros2.call(f"{NODE}/find_objects", kind)["objects"]]


def test_the_map_of_another_node_is_recorded(ros2: Ros2, launch2: Any, tmp_path: Path) -> None:
    file = tmp_path / "recorded.hmap"
    process = launch2("record_map.launch.xml", save_to=file, map_topic="/slam/map")
    ros2.ask(
        "publish",
        topic="/slam/map",
        type="nav_msgs/msg/OccupancyGrid",
        latched=True,
        header={"frame_id": "map"},
        info={"width": 2, "height": 2, "resolution": 0.05},
        data=[0, 100, -1, 7],
    )
    wait_for(lambda: string_at(ros2, "occupancy", point(0.07, 0.02)) == "Occupied", "the map")
    process.stop()
    assert "process has finished cleanly" in process.output, process.output
    (layer,) = open_map(file)
    assert isinstance(layer, OccupancyLayer)
    np.testing.assert_array_equal(layer.cells, [[0, 100], [-1, 7]])
