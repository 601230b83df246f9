"""The life of the map server: how it starts and ends, through a real roscore."""

from __future__ import annotations

import os
import signal
from typing import Any

import pytest

from hypermap.core.hypermap import Hypermap
from hypermap.testing import occupancy_from_text

from .conftest import wait_for
from .map_server_tools import Client, building, saved

pytestmark = pytest.mark.xdist_group("ros")


def test_a_server_without_a_map_says_so_also_in_a_read_only_home(start, rospy):
    nowhere = dict.fromkeys(("ROS_LOG_DIR", "XDG_CACHE_HOME"), "/dev/null/folder")
    process = start("hypermap", "serve", "--ros1", "__name:=without_map", env=os.environ | nowhere)
    process.expect("starting without a map")
    heard = Client(rospy, "without_map").heard(
        "hypermap_metadata", "hypermap_msgs/HypermapMetaData"
    )
    assert (heard.layer_cnt, heard.layers) == (0, [])


def test_who_hears_of_the_map_finds_all_services(start, rospy, tmp_path):
    from hypermap.ros.ros1.libraries import rosgraph

    path = saved(building(), tmp_path / "building.hmap")
    process = start("hypermap", "serve", path, "--ros1", "__name:=announced")
    process.expect("loaded")
    names = ("get_string_at_point", "clear", "find_objects", "occupancy_static_map")
    for name in names:
        assert rosgraph.Master("/tests").lookupService(f"/announced/{name}")


def test_diagnostics_tell_how_the_server_fares(start, rospy, tmp_path):
    path, out = saved(building(), tmp_path / "building.hmap"), tmp_path / "out.hmap"
    start("hypermap", "serve", path, "--ros1", f"_save_to:={out}", "__name:=healthy")
    client = Client(rospy, "healthy")
    client.string("occupancy", 0.5, 0.5)
    client.refused("get_string_at_point", "GetStringAtPoint", layer="moon")

    def values_of(message: Any) -> dict[str, str]:
        (status,) = message.status
        return {"name": status.name, "level": status.level, "message": status.message} | {
            pair.key: pair.value for pair in status.values
        }

    kind = "diagnostic_msgs/DiagnosticArray"
    heard = client.heard("/diagnostics", kind, lambda m: m.status[0].name == "healthy: map")
    assert values_of(heard) == {
        "name": "healthy: map",
        "level": 0,
        "message": "serving 2 layers",
        "map": str(path),
        "layer occupancy": "OccupancyGridLayer, 3 x 2 cells",
        "layer semantic": "SemanticLayer, 4 objects",
        "questions answered": "1",
        "questions refused": "1",
        "stored at the end in": str(out),
    }
    client.call("clear", "std_srvs/Trigger")
    heard = client.heard("/diagnostics", kind, lambda m: m.status[0].level == 1)
    assert values_of(heard)["message"] == "there is no map"


def test_without_a_directory_no_file_is_touched_and_ctrl_c_ends_it_clean(start, rospy, tmp_path):
    path = saved(building(), tmp_path / "building.hmap")
    process = start("hypermap", "serve", path, "--ros1", "__name:=no_directory")
    client = Client(rospy, "no_directory")
    for service, kind in (("load_map", "LoadMap"), ("store_map", "StoreMap")):
        error = client.refused(service, kind, filename="x.hmap")
        assert "start the node with the parameter map_directory" in error
    assert process.stop(signal.SIGINT) == 0
    assert "Traceback" not in process.output


def test_what_a_command_was_given_is_not_held_against_the_next_one(start, rospy):
    rospy.set_param("/passing/speed_of_another_node", 0.5)
    process = start("hypermap", "serve", "--ros1", "--param", "label_height=0.3", "__name:=passing")
    process.expect("starting without a map")
    assert rospy.get_param("/passing/label_height") == 0.3
    assert process.stop(signal.SIGINT) == 0
    assert rospy.get_param("/passing") == {"speed_of_another_node": 0.5}


def test_a_misspelled_parameter_on_the_parameter_server_is_a_warning(start, rospy):
    rospy.set_param("/misspelled/keepuot", ["desk 0.2"])
    process = start("hypermap", "serve", "--ros1", "__name:=misspelled")
    process.expect("ignoring the unknown parameter 'keepuot'; did you mean 'keepout'?")
    rospy.set_param("/misspelled/sped", ["desk 0.2 50%"])
    process.expect("ignoring the unknown parameter 'sped'; did you mean 'speed'?")
    assert process.output.count("keepuot") == 1


@pytest.mark.parametrize(
    ("parameters", "error"),
    [
        (["_load_map:=true", "_load_map_config:=true", "_file:=x"], "cannot both be true"),
        (["_load_map:=true"], "load_map is true, but the parameter file names no file"),
        (["_load_map:=true", "_file:=/nowhere.hmap"], "/nowhere.hmap"),
        (["_tf_timeout:=soon"], "parameter 'tf_timeout' must be a number, got 'soon'"),
        (["_keepuot:=['desk']"], "there is no parameter 'keepuot'; did you mean 'keepout'?"),
        (["--param", "keepuot=['desk']"], "no parameter 'keepuot'; did you mean 'keepout'?"),
    ],
)
def test_a_wrong_start_is_one_line_and_an_exit_code(start, roscore, parameters, error):
    name = f"wrong_start_{abs(hash(error))}"  # a roscore keeps the parameters of a name
    process = start("hypermap", "serve", "--ros1", *parameters, f"__name:={name}")
    assert process.popen.wait(240) == 2
    assert error in process.output
    assert "Traceback" not in process.output


@pytest.mark.parametrize("kind", ["load_map", "load_map_config"])
def test_parameters_name_the_map(start, rospy, tmp_path, kind):
    name = f"by_{kind}"
    path = tmp_path / ("x.hmap" if kind == "load_map" else "config.yaml")
    saved(building(), path)
    words = [f"_{kind}:=true", f"_file:={path}", f"__name:={name}"]
    start("hypermap", "serve", "--ros1", *words).expect("loaded")
    assert Client(rospy, name).string("occupancy", 0.5, 0.5) == "Free"


def test_a_file_that_nobody_wants_loaded_is_not(start, roscore, tmp_path):
    words = [f"_file:={tmp_path / 'x.hmap'}", "__name:=file_alone"]
    process = start("hypermap", "serve", "--ros1", *words)
    process.expect("neither load_map nor load_map_config is true: starting without a map")


def test_a_restarted_node_is_heard_and_asked_as_before(start, rospy, tmp_path):
    path = saved(building(), tmp_path / "building.hmap")
    process = start("hypermap", "serve", path, "--ros1", "__name:=restarted")
    client = Client(rospy, "restarted")
    heard: list[Any] = []
    kind = client.messages.message_class("nav_msgs/OccupancyGrid")
    subscriber = client.rospy.Subscriber(f"/{client.node}/occupancy_map", kind, heard.append)
    wait_for(lambda: heard, "the map")
    assert process.stop(signal.SIGTERM) == 0
    assert "Traceback" not in process.output
    path = saved(Hypermap([occupancy_from_text("#")]), tmp_path / "other.hmap")
    start("hypermap", "serve", path, "--ros1", f"__name:={client.node}").expect("loaded")
    wait_for(lambda: list(heard[-1].data) == [100], "the map of the restarted node")
    assert client.string("occupancy", 0.5, 0.5) == "Occupied"
    subscriber.unregister()
