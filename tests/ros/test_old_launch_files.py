"""Launch files of the first program, of 2019, start ours."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from hypermap.core.errors import HypermapError
from hypermap.ros.mapper.first_mapper import FirstMapper, todays

from .conftest import ROS, wait_for
from .map_server_tools import Client, building, saved

ros1 = pytest.mark.xdist_group("ros_launch")

SERVE = """
<launch>
  <node pkg="hypermap" type="map_server" name="hypermap_server">
    <param name="load_map" type="bool" value="true"/>
    <param name="file" value="{file}"/>
    <param name="automap" type="bool" value="true"/>
  </node>
</launch>
"""
EMPTY = '<launch>\n  <node name="map_server" pkg="hypermap" type="map_server"/>\n</launch>\n'
MAPPING = """
<launch>
  <node pkg="hypermap" type="map_server" name="hypermap_server"/>
  <node pkg="semmapping" type="mapping" name="mapping">
    <param name="point_cloud" value="/camera/depth/points"/>
    <param name="camera_info" value="/camera/rgb/camera_info"/>
    <param name="laser_scanner" value="/scan"/>
  </node>
</launch>
"""


def written(text: str, folder: Path) -> Path:
    path = folder / "old.launch"
    path.write_text(text)
    return path


@ros1
def test_the_map_server_starts_with_its_map(launch, rospy, tmp_path) -> None:
    file = saved(building(), tmp_path / "office.hmap")
    server = launch(written(SERVE.format(file=file), tmp_path))
    client = Client(rospy, "hypermap_server")
    assert client.string("occupancy", 0.5, 0.5) == "Free"
    assert server.stop() == 0


@ros1
def test_the_map_server_keeps_the_name_that_the_file_gives_it(launch, rospy, tmp_path) -> None:
    server = launch(written(EMPTY, tmp_path))
    heard = Client(rospy, "map_server").heard("hypermap_metadata", "hypermap_msgs/HypermapMetaData")
    assert heard.node_name == "/map_server"
    assert server.stop() == 0


@ros1
def test_semmapping_listens_where_it_did(launch, rospy, tmp_path) -> None:
    import rosgraph

    nodes = launch(written(MAPPING, tmp_path))
    topics = {"/camera/depth/points", "/camera/rgb/camera_info", "/darknet_ros/bounding_boxes"}

    def heard() -> set[str]:
        _, subscribed, _ = rosgraph.Master("/tests").getSystemState()
        return {topic for topic, names in subscribed if "/mapping" in names}

    wait_for(lambda: heard() >= topics, f"subscriptions to {topics}", 120)
    rospy.wait_for_service("/mapping/clear", 120)
    assert nodes.stop() == 0
    assert rospy.get_param("/mapping", {}) == {}


def given(**values: object) -> dict[str, object]:
    return {parameter.name: parameter.default for parameter in FirstMapper.PARAMETERS} | values


@pytest.mark.parametrize(
    ("then", "now"),
    [
        ({}, {"detections_topic": "/darknet_ros/bounding_boxes", "detector": ""}),
        ({"point_cloud": "/points"}, {"cloud_topic": "/points"}),
        ({"point_cloud": "/points", "cloud_topic": "/cloud"}, {"cloud_topic": "/cloud"}),
        ({"camera_info": "/info"}, {"camera_info_topic": "/info"}),
        ({"detector": "net.onnx"}, {"detector": "net.onnx", "detections_topic": ""}),
        ({"detections_topic": "/boxes"}, {"detector": "", "detections_topic": "/boxes"}),
        ({"detections_file": "x.json"}, {"detector": "", "detections_topic": ""}),
    ],
)
def test_parameters_of_then_mean_those_of_now(then, now) -> None:
    values = todays(given(**then))
    assert {name: values[name] for name in now} == now


def test_a_detector_that_is_no_more_is_an_error() -> None:
    with pytest.raises(HypermapError, match="'yolact' of 2019 is not known: give darknet, a"):
        todays(given(detector="yolact"))


@pytest.mark.parametrize(
    "program", ["hypermap/scripts/hypermap_server", "hypermap/scripts/map_server",
                "hypermap/scripts/semantic_mapper", "semmapping/scripts/mapping"],
)  # fmt: skip
def test_a_program_that_another_python_runs_says_what_to_do(program) -> None:
    # Isolated and without site-packages, as the system's Python is for a virtual environment.
    bare = [sys.executable, "-I", "-S"]
    script = ROS / program
    if script.name == "map_server":  # which starts the program next to it with the same Python
        script = script.with_name("hypermap_server")
    done = subprocess.run([*bare, script], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    for word in (sys.executable, "bin/activate", "systemd", "robot_upstart"):
        assert word in done.stderr


def test_catkin_installs_the_program_of_semmapping(needs_ros1: None, tmp_path: Path) -> None:
    if any(
        shutil.which(tool, path="/usr/bin") is None for tool in ("cmake", "catkin_init_workspace")
    ):
        pytest.skip("catkin or cmake is missing: make ros1 installs them on Debian 12")
    build, install = tmp_path / "build", tmp_path / "install"
    options = {
        "CMAKE_INSTALL_PREFIX": install,
        "CATKIN_DEVEL_PREFIX": tmp_path / "devel",
        "CATKIN_ENABLE_TESTING": "OFF",
        "PYTHON_EXECUTABLE": "/usr/bin/python3",
    }
    words = [f"-D{name}={value}" for name, value in options.items()]
    for command in (
        ["cmake", "-S", ROS / "semmapping", "-B", build, *words],
        ["cmake", "--build", build, "--target", "install"],
    ):
        done = subprocess.run(
            command,
            env={"PATH": "/usr/bin:/bin", "ROS_VERSION": "1"},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
    assert os.access(install / "lib" / "semmapping" / "mapping", os.X_OK)
