"""What an earlier run left on a roscore does not count for the next one; no map is lost by it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import xmlrpc.client
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hypermap import open_map
from hypermap.core.frames import Pose2D
from hypermap.core.grid import GridGeometry
from hypermap.core.occupancy import OccupancyLayer

from .map_server_tools import Client, building, saved

pytestmark = pytest.mark.xdist_group("ros_launch")


def layers(path: Path) -> list[str]:
    return [layer.name for layer in open_map(path)]


def kill(node: str) -> None:
    """End a node without a chance to clean up."""
    from hypermap.ros.ros1.libraries import rosgraph

    with xmlrpc.client.ServerProxy(rosgraph.Master("/tests").lookupNode(node)) as api:
        os.kill(api.getPid("/tests")[2], signal.SIGKILL)


def recorded_by(launch: Any, rospy: Any, types: Any, path: Path) -> Any:
    """Return `record_map.launch` when a map has arrived in it."""
    from hypermap.ros.messages.to_messages import occupancy_grid

    server = launch("record_map.launch", save_to=path, map_topic="/slam/map")
    client = Client(rospy, "hypermap_server")
    slam = client.publisher("/slam/map", "nav_msgs/OccupancyGrid")
    cells = np.full((3, 4), 100, np.int8)
    grid = OccupancyLayer("occupancy", "map", GridGeometry(4, 3, 0.05, Pose2D()), cells)
    slam.publish(occupancy_grid(grid, types, 10**9))
    client.heard("occupancy_map", "nav_msgs/OccupancyGrid")
    slam.unregister()
    return server


def test_a_recorded_map_outlives_the_next_server(
    launch, start, rospy, ros1_types, tmp_path
) -> None:
    path = tmp_path / "my recorded #1: map.hmap"
    recording = recorded_by(launch, rospy, ros1_types, path)
    assert recording.stop() == 0
    assert f"the map will be stored in {path} at the end" in recording.output
    assert layers(path) == ["occupancy"]
    assert rospy.get_param("/hypermap_server", {}) == {}

    server = start("hypermap", "serve", saved(building(), tmp_path / "lab.hmap"), "--ros1")
    Client(rospy, "hypermap_server").string("occupancy", 0.5, 0.5)
    assert server.stop() == 0
    assert "stored" not in server.output
    assert layers(path) == ["occupancy"]


def test_what_a_killed_run_should_have_saved_is_not_asked_of_the_next(
    launch, start, rospy, ros1_types, tmp_path
) -> None:
    path = tmp_path / "recorded.hmap"
    recording = recorded_by(launch, rospy, ros1_types, path)
    kill("/hypermap_server")
    recording.stop()
    assert rospy.has_param("/hypermap_server/file")
    server = start("hypermap", "serve", saved(building(), tmp_path / "lab.hmap"), "--ros1")
    server.expect("loaded")
    assert server.stop() == 0
    assert "stored" not in server.output
    assert not path.exists()


def test_a_second_recording_lies_beside_the_first(launch, rospy, ros1_types, tmp_path) -> None:
    path = saved(building(), tmp_path / "recorded.hmap")
    again = recorded_by(launch, rospy, ros1_types, path)
    assert again.stop() == 0
    assert "is there already, and this node has not loaded it" in again.output
    assert layers(path) == ["occupancy", "semantic"]
    assert layers(tmp_path / "recorded-1.hmap") == ["occupancy"]


def test_a_map_that_was_loaded_is_stored_where_it_came_from(start, rospy, tmp_path) -> None:
    path, other = (saved(building(), tmp_path / name) for name in ("lab.hmap", "other.hmap"))
    words = ["--ros1", "--map-directory", tmp_path, f"_save_to:={path}", "__name:=keeper"]
    server = start("hypermap", "serve", path, *words)
    client = Client(rospy, "keeper")
    client.call("clear", "std_srvs/Trigger")
    assert client.call("load_map", "LoadMap", filename=other.name).success
    assert server.stop() == 0
    assert f"the map will be stored in {path} at the end" in server.output
    assert f"stored the map in {tmp_path / 'lab-1.hmap'}" in server.output  # lab holds no `other`

    server = start("hypermap", "serve", path, *words)
    client.call("clear", "std_srvs/Trigger")
    assert client.call("load_map", "LoadMap", filename=path.name).success
    assert server.stop() == 0
    assert f"stored the map in {path}" in server.output


def test_a_terminal_that_is_closed_ends_a_node_in_order(start, rospy, tmp_path) -> None:
    path = tmp_path / "kept.hmap"
    lab = saved(building(), tmp_path / "lab.hmap")
    server = start("hypermap", "serve", lab, "--ros1", f"_save_to:={path}", "__name:=terminal")
    Client(rospy, "terminal").string("occupancy", 0.5, 0.5)
    assert server.stop(signal.SIGHUP) == 0
    assert layers(path) == ["occupancy", "semantic"]


def test_sources_of_an_earlier_run_do_not_contradict_those_of_the_next(
    launch, start, rospy, tmp_path
) -> None:
    file = tmp_path / "detections.json"
    file.write_text(json.dumps({"detections": []}))
    first = launch(
        "semantic_mapping.launch", depth_topic="/d", detections_topic="/boxes", save_to=""
    )
    first.expect("waiting for")
    assert first.stop() == 0
    assert rospy.get_param("/semantic_mapper", {}) == {}
    rospy.set_param("/semantic_mapper/detections_topic", "/boxes")  # of a run that was killed
    words = ["--ros1", "--depth-topic", "/d", "--detections", file]
    second = start("hypermap", "live", *words)
    assert second.popen.wait(240) == 2
    assert (
        "found detections_topic (on the parameter server, as /semantic_mapper/detections_topic) "
        "and detections_file (as an argument)" in second.output
    )
    assert rospy.get_param("/semantic_mapper", {}) == {}


def test_a_node_that_fails_to_start_leaves_nothing_wrong_behind(start, rospy) -> None:
    words = ["hypermap", "serve", "--ros1", "__name:=fails_once"]
    assert start(*words, "_tf_timeout:=soon").popen.wait(240) == 2
    start(*words).expect("starting without a map")


def test_a_node_that_is_replaced_leaves_its_parameters_to_the_other(start, rospy) -> None:
    words = ["hypermap", "serve", "--ros1", "__name:=heir"]
    first = start(*words)
    first.expect("starting without a map")
    second = start(*words, "_label_height:=0.3")
    assert first.popen.wait(240) == 0
    second.expect("starting without a map")
    assert rospy.get_param("/heir") == {"label_height": 0.3}
    assert second.stop() == 0
    assert not rospy.get_param("/heir", {})


def test_a_node_that_roslaunch_may_start_again_finds_its_parameters(start, rospy) -> None:
    node = start("hypermap", "serve", "--ros1", "__name:=reborn", "_label_height:=0.3")
    node.expect("starting without a map")
    start("rosnode", "kill", "/reborn").expect("killed")
    assert node.popen.wait(240) == 0
    assert rospy.get_param("/reborn") == {"label_height": 0.3}


def test_a_node_that_roslaunch_starts_again_has_all_its_parameters(start, rospy, tmp_path) -> None:
    path, to = tmp_path / "lab.hmap", tmp_path / "kept.hmap"
    words = ["hypermap", "serve", "--ros1", "__name:=respawned", f"__log:={tmp_path}/log"]
    given = {"file": str(path), "load_map": True, "save_to": str(to), "label_height": 0.3}
    rospy.set_param("/respawned", given)
    assert start(*words, is_new=True).popen.wait(240) == 2  # its map is not there yet
    assert rospy.get_param("/respawned").keys() == {"respawn"}
    saved(building(), path)
    start(*words, is_new=True).expect(f"loaded {path}")
    kill("/respawned")
    last = start(*words, is_new=True)  # new ones have one parent, as those of roslaunch
    last.expect(f"the map will be stored in {to} at the end")
    assert rospy.get_param("/respawned/label_height") == 0.3
    assert last.stop() == 0
    assert layers(to) == ["occupancy", "semantic"]
    assert rospy.get_param("/respawned", {}) == {}


def test_what_waits_for_a_node_of_another_roslaunch_is_dropped(start, rospy, tmp_path) -> None:
    kept = {"launcher": "elsewhere 1", "values": {"file": "/no.hmap", "load_map": True}}
    rospy.set_param("/orphan/respawn", kept)
    words = ["hypermap", "serve", "--ros1", "__name:=orphan", f"__log:={tmp_path}/log"]
    start(*words).expect("starting without a map")
    assert rospy.get_param("/orphan", {}) == {}


HALF_ASKED = """
import gc, xmlrpc.client
from hypermap.ros.port import Parameter
from hypermap.ros.ros1.libraries import rospy
from hypermap.ros.ros1.port import Ros1Port

port = Ros1Port("half_asked", ["half_asked", "_height:=2.0"])
port.parameters([Parameter("height", 0.5, "Height.")], lambda _: None)
print(rospy.get_param("/half_asked"))
for transport in [o for o in gc.get_objects() if isinstance(o, xmlrpc.client.Transport)]:
    if (connection := transport._connection[1]) is not None:
        connection.putrequest("POST", "/RPC2")  # as if Ctrl-C had come before the answer
        connection.putheader("Content-Length", "0")
        connection.endheaders()
port.shut_down()
"""


def test_a_request_that_was_interrupted_leaves_no_parameters(rospy) -> None:
    done = subprocess.run(
        [sys.executable, "-c", HALF_ASKED], capture_output=True, text=True, timeout=240, check=True
    )
    assert "{'height': 2.0}" in done.stdout
    assert rospy.get_param("/half_asked", {}) == {}
