"""The services of the map server, asked through a real roscore."""

from __future__ import annotations

import json
import math
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from hypermap.formats import open_map, save_map

from .conftest import Process
from .map_server_tools import Client, Robot, building, places, saved

pytestmark = pytest.mark.xdist_group("ros")

REAL_MAPS = Path(__file__).resolve().parents[3] / "shared" / "data" / "maps"
LAYERS = {"occupancy": "OccupancyGridLayer", "semantic": "SemanticLayer"}


@pytest.fixture(scope="module")
def directory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The one folder that the server may use, with a map and with things that are none."""
    folder = tmp_path_factory.mktemp("maps")
    saved(building(), folder / "building.hmap")
    (folder / "broken.hmap").write_bytes((folder / "building.hmap").read_bytes()[:-200])
    (folder / "text.hmap").write_text("no archive")
    outside = tmp_path_factory.mktemp("elsewhere")
    saved(building(), outside / "secret.hmap")
    (folder / "link.hmap").symlink_to(outside / "secret.hmap")
    (folder / "linked").symlink_to(outside)
    (folder / "sub").mkdir()
    return folder


@pytest.fixture(scope="module")
def server(rospy: Any, directory: Path) -> Iterator[Process]:
    command = [sys.executable, "-m", "hypermap", "serve", directory / "building.hmap", "--ros1"]
    command += ["--map-directory", directory, "__name:=asked_server"]
    process = Process([str(word) for word in command], directory / "server.log")
    yield process
    process.stop()


@pytest.fixture(scope="module")
def client(rospy: Any, server: Process) -> Iterator[Client]:
    made = Client(rospy, "asked_server")
    made.robot = Robot(made)
    made.robot.wait_until_known_to(made)
    yield made
    made.robot.close()


# At a point


@pytest.mark.parametrize(
    ("layer", "x", "y", "frame", "label", "value"),
    [
        ("occupancy", 0.5, 0.5, "map", "Free", 0),
        ("occupancy", 0.5, 1.5, "map", "Occupied", 100),
        ("occupancy", 2.5, 1.5, "map", "Unknown", -1),
        ("occupancy", -0.02, 0.5, "map", "Unknown", -1),
        ("occupancy", 0.5, 0.5, "", "Free", 0),
        ("occupancy", 0.5, 0.5, "/map", "Free", 0),
        ("occupancy", 0.5, 9.5, "lab", "Free", 0),
        ("occupancy", 0.5, 0.5, "robot", "Occupied", 100),
        ("semantic", 9.5, 1.0, "map", "table", 7),
        ("semantic", 1.0, 0.5, "lab", "table", 7),
        ("semantic", 0.5, 0.5, "lab", "cup", 8),
        ("semantic", 7.5, 1.0, "robot", "table", 7),
        ("semantic", 12.0, 2.0, "lab", "Empty", -1),  # in the hole of the sofa
        ("semantic", 100.0, 0.0, "map", "Empty", -1),
    ],
)
def test_what_is_at_a_point_in_any_frame(client, layer, x, y, frame, label, value):
    location = client.point(x, y, frame)
    assert client.string(layer, x, y, frame) == label
    answer = client.call("get_int_at_point", "GetIntAtPoint", layer=layer, location=location)
    assert answer.value == value


def test_a_place_in_a_moving_frame_is_where_the_frame_was_at_that_time(client):
    began, rospy = client.robot.began, client.rospy
    assert client.string("occupancy", 0, 0, "cart", began) == "Free"
    assert client.string("occupancy", 0, 0, "cart", began + rospy.Duration(0, 20_000_000)) == "Free"
    assert client.string("occupancy", 0, 0, "cart", began + rospy.Duration(1)) == "Unknown"
    assert client.string("occupancy", -50, 0, "cart") == "Free"  # no time: the latest


@pytest.mark.parametrize(
    ("layer", "x", "y", "frame", "error"),
    [
        ("semantik", 0, 0, "map", "there is no layer 'semantik'; did you mean 'semantic'?"),
        ("", 0, 0, "map", "there is no layer ''"),
        ("semantic", 0, 0, "mars", "frame 'mars' is unknown to the map"),
        ("semantic", 0, 0, "camera", "frame 'camera' is tilted by 90 degrees"),
        ("semantic", math.nan, 0, "map", "must be finite"),
        ("semantic", 0, math.inf, "robot", "must be finite"),
    ],
)
def test_what_cannot_be_answered_is_an_error_that_the_caller_can_read(
    client, server, layer, x, y, frame, error
):
    fields = {"layer": layer, "location": client.point(x, y, frame)}
    assert error in client.refused("get_string_at_point", "GetStringAtPoint", **fields)
    assert error in client.refused("get_int_at_point", "GetIntAtPoint", **fields)
    server.expect(error)
    assert client.string("occupancy", 0.5, 0.5) == "Free"


# In an area


def test_an_area_of_a_grid_gives_every_cell_whose_centre_it_covers(client):
    area = client.box(0.5, 0, 3, 1)
    strings = client.call("get_strings_by_area", "GetStringsByArea", layer="occupancy", area=area)
    assert strings.names == ["Free", "Free", "Occupied"]
    assert places(strings.locations) == [(0.5, 0.5), (1.5, 0.5), (2.5, 0.5)]
    area = client.box(-100, -100, 100, 100)
    ints = client.call("get_ints_by_area", "GetIntsByArea", layer="occupancy", area=area)
    assert list(ints.values) == [0, 0, 100, 100, 100, -1]
    assert places(ints.locations)[-1] == (2.5, 1.5)


@pytest.mark.parametrize("frame", ["lab", "robot"])
def test_hits_in_an_area_of_another_frame_are_in_the_base_frame(client, frame):
    area = client.box(1, 0.2, 3, 0.4, "lab") if frame == "lab" else client.box(7, 1, 8, 3, "robot")
    strings = client.call("get_strings_by_area", "GetStringsByArea", layer="semantic", area=area)
    ints = client.call("get_ints_by_area", "GetIntsByArea", layer="semantic", area=area)
    assert (strings.names, list(ints.values)) == (["table"], [7])
    assert places(strings.locations) == places(ints.locations) == [(9.5, 1.0)]


BAD_AREAS = {
    "no points": [],
    "two points": [(0, 0), (1, 0)],
    "the same point": [(1, 1)] * 5,
    "a nan": [(0, 0), (1, 0), (math.nan, 1)],
    "an infinity": [(0, 0), (1, 0), (1, math.inf)],
    "a bow tie": [(0, 0), (2, 2), (2, 0), (0, 2)],
}


@pytest.mark.parametrize("corners", BAD_AREAS.values(), ids=BAD_AREAS)
def test_a_malformed_area_is_an_error_of_every_service(client, corners):
    area = client.area(corners, "map")
    for layer in LAYERS:
        for service, kind in [
            ("get_strings_by_area", "GetStringsByArea"),
            ("get_ints_by_area", "GetIntsByArea"),
        ]:
            error = client.refused(service, kind, layer=layer, area=area)
            assert "the area is not a polygon" in error
    assert "not a polygon" in client.refused("get_semantic_by_area", "GetSemanticByArea", area=area)
    error = client.refused(
        "get_hits_in_areas",
        "GetHitsInAreas",
        layer="semantic",
        areas=[client.box(0, 0, 1, 1), area],
    )
    assert "areas[1]: the area is not a polygon" in error
    if corners:
        fields = {"layer": "occupancy", "area": area}
        for service, what in (("String", {"name": "Free"}), ("Int", {"value": 0})):
            error = client.refused(
                f"get_locations_by_{service.lower()}", f"GetLocationsBy{service}", **fields, **what
            )
            assert "the area is not a polygon" in error


# Where something is


def test_names_and_numbers_are_found_in_the_whole_layer_and_in_areas(client):
    def strings(layer: str, name: str, area: Any = None) -> list[tuple[float, float]]:
        return places(
            client.call(
                "get_locations_by_string",
                "GetLocationsByString",
                layer=layer,
                name=name,
                area=area or client.area([]),
            ).locations
        )

    def ints(layer: str, value: int, area: Any = None) -> list[tuple[float, float]]:
        return places(
            client.call(
                "get_locations_by_int",
                "GetLocationsByInt",
                layer=layer,
                value=value,
                area=area or client.area([]),
            ).locations
        )

    assert strings("occupancy", "Free") == ints("occupancy", 0) == [(0.5, 0.5), (1.5, 0.5)]
    assert strings("occupancy", "Unknown") == ints("occupancy", -1) == [(2.5, 1.5)]
    assert strings("semantic", "chair") == ints("semantic", 9) == [(5.0, 5.0)]
    assert strings("semantic", "unicorn") == ints("semantic", 2**31 - 1) == []
    assert ints("semantic", -(2**31)) == []
    # In the lab's frame the chair is at (5, 5), too; 1 m to the left of the map's cell (0, 0).
    near, far = client.box(4, 4, 6, 6, "lab"), client.box(0, 0, 1, 1, "lab")
    assert strings("semantic", "chair", near) == ints("semantic", 9, near) == [(5.0, 5.0)]
    assert strings("semantic", "chair", far) == ints("semantic", 9, far) == []
    left = client.box(-2, 0, -1, 2, "robot")
    assert strings("occupancy", "Free", left) == ints("occupancy", 0, left) == [(0.5, 0.5)]


# Objects


def test_objects_come_in_the_base_frame_with_all_that_messages_can_carry(client):
    answer = client.call(
        "get_semantic_by_area", "GetSemanticByArea", area=client.box(4, 4, 6, 6, "lab")
    )
    (chair,) = answer.objects
    assert (chair.id, chair.name, chair.tags) == (9, "chair", ["chair", "stool"])
    assert list(chair.confidence) == [0.75, 0.25]
    assert places([chair.position]) == [(5.0, 5.0)]
    assert set(places(chair.shape.points)) == {(4.5, 4.5), (5.5, 4.5), (5.5, 5.5), (4.5, 5.5)}
    (sofa,) = client.call("get_semantic_by_string", "GetSemanticByString", name="sofa").objects
    assert places([sofa.position]) == [(8.0, 12.0)]
    assert client.call("get_semantic_by_string", "GetSemanticByString", name="x").objects == []


def test_all_layers_at_a_point(client):
    answer = client.call(
        "get_layers_at_point", "GetLayersAtPoint", location=client.point(0.5, 0.5, "lab")
    )
    assert (answer.success, answer.message, answer.frame_id) == (True, "", "map")
    grid, semantic = answer.layers
    assert (grid.layer, grid.class_name, grid.label, grid.value, grid.objects) == (
        "occupancy",
        "OccupancyGridLayer",
        "Unknown",
        -1,
        [],
    )
    assert (semantic.label, semantic.value) == ("cup", 8)
    assert [state.object.name for state in semantic.objects] == ["cup", "table"]


def test_hits_in_several_areas_at_once(client):
    areas = [client.box(0, 0, 1, 1, "lab"), client.box(50, 50, 51, 51), client.box(4, 4, 6, 6)]
    answer = client.call("get_hits_in_areas", "GetHitsInAreas", layer="semantic", areas=areas)
    assert [hits.labels for hits in answer.hits] == [["table", "cup"], [], ["chair"]]
    assert [list(hits.values) for hits in answer.hits] == [[7, 8], [], [9]]
    assert places(answer.hits[0].locations) == [(9.5, 1.0), (9.5, 0.5)]
    assert (answer.success, answer.frame_id) == (True, "map")


@pytest.mark.parametrize(
    ("asked", "names"),
    [
        ({}, ["table", "cup", "chair", "sofa"]),
        ({"limit": 2}, ["table", "cup"]),
        ({"name": "chair"}, ["chair"]),
        ({"tags": ["stool"]}, ["chair"]),
        ({"tags": ["stool", "throne"]}, []),
        ({"inside": "table"}, ["cup"]),
        ({"near": "table", "within": 0.5}, ["cup"]),
        ({"near": "table"}, ["cup", "chair", "sofa"]),
        ({"layer": "semantic", "name": "cup"}, ["cup"]),
    ],
)
def test_objects_for_which_all_that_is_given_is_true(client, asked, names):
    answer = client.call("find_objects", "FindObjects", **asked)
    assert [state.object.name for state in answer.objects] == names
    assert len(answer.distances) == (len(names) if "near" in asked else 0)


def test_the_nearest_objects_to_a_point_in_another_frame(client):
    answer = client.call(
        "find_objects", "FindObjects", origin=client.point(3, 5, "robot"), within=5.0, limit=1
    )
    (chair,) = answer.objects
    assert (chair.object.name, chair.layer, chair.existence) == ("chair", "semantic", 3.5)
    assert math.isnan(chair.first_seen)
    assert json.loads(chair.attributes) == {}
    assert list(answer.distances) == [0.0]
    (sofa,) = client.call("find_objects", "FindObjects", name="sofa").objects
    assert [len(part.holes) for part in sofa.parts] == [1]
    assert sofa.area == pytest.approx(12.0)


@pytest.mark.parametrize(
    ("asked", "error"),
    [
        ({"within": 1.0}, "within needs near or origin"),
        ({"near": "table", "within": -1.0}, "within must not be negative"),
        ({"near": "table", "within": math.nan}, "within must not be negative"),
        ({"layer": "occupancy"}, "layer 'occupancy' is of the kind OccupancyLayer"),
        ({"layer": "attic"}, "there is no layer 'attic'"),
    ],
)
def test_a_question_for_objects_that_makes_no_sense_is_an_error(client, asked, error):
    assert error in client.refused("find_objects", "FindObjects", **asked)


def test_distances_are_measured_from_one_thing(client):
    error = client.refused(
        "find_objects", "FindObjects", near="table", origin=client.point(0, 0, "map")
    )
    assert "give near or origin, not both" in error


# The grid, and several clients


def test_the_static_map_is_the_grid(client):
    answer = client.call("occupancy_static_map", "nav_msgs/GetMap")
    assert (answer.map.info.width, answer.map.info.height) == (3, 2)
    assert list(answer.map.data) == [0, 0, 100, 100, 100, -1]
    assert answer.map.header.frame_id == "map"


def test_clients_ask_at_the_same_time(client):
    wrong: list[Any] = []

    def ask(x: float, label: str) -> None:
        proxy = client.proxy(
            "get_string_at_point", "hypermap_msgs/GetStringAtPoint", persistent=True
        )
        location = client.point(x, 0.5, "map")
        names = {proxy(layer="occupancy", location=location).name for _ in range(100)}
        wrong.extend(names - {label})
        proxy.close()

    threads = [
        threading.Thread(target=ask, args=asked) for asked in ((0.5, "Free"), (2.5, "Occupied"))
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert wrong == []


# Files


@pytest.mark.parametrize(
    ("filename", "error"),
    [
        ("", "is not allowed"),
        ("../secret.hmap", "is not allowed"),
        ("sub/../../secret.hmap", "is not allowed"),
        ("/etc/passwd", "is not allowed"),
        ("link.hmap", "is a link that leads out"),
        ("linked/secret.hmap", "is a link that leads out"),
    ],
)
def test_no_name_leads_out_of_the_directory(client, filename, error):
    assert error in client.refused("load_map", "LoadMap", filename=filename)
    assert error in client.refused("store_map", "StoreMap", filename=filename)


@pytest.mark.parametrize("filename", ["broken.hmap", "text.hmap", "nowhere.hmap", "sub"])
def test_a_map_that_cannot_be_loaded_leaves_the_old_one(client, server, filename):
    assert filename in client.refused("load_map", "LoadMap", filename=filename)
    server.expect("load_map: ")
    assert client.string("semantic", 1.0, 0.5, "lab") == "table"


@pytest.mark.parametrize("filename", ["sub", "new.yaml", "notes", "nowhere/new.hmap"])
def test_only_archives_are_stored_and_only_where_a_folder_is(client, directory, filename):
    assert client.refused("store_map", "StoreMap", filename=filename)
    assert not (directory / "new.yaml").exists()


def test_a_stored_map_is_the_one_that_is_served(client, directory):
    assert client.call("store_map", "StoreMap", filename="sub/stored.hmap").success
    save_map(building(), directory / "expected.hmap")
    assert (directory / "sub" / "stored.hmap").read_bytes() == (
        directory / "expected.hmap"
    ).read_bytes()
    assert client.call("load_map", "LoadMap", filename="sub/stored.hmap").success
    assert client.string("semantic", 0.5, 0.5, "lab") == "cup"


def test_a_cleared_map_is_empty_and_another_is_loaded_after_it(client):
    assert client.call("clear", "std_srvs/Trigger").success
    assert "there is no layer 'occupancy'; known: none" in client.refused(
        "get_string_at_point",
        "GetStringAtPoint",
        layer="occupancy",
        location=client.point(0, 0, "map"),
    )
    answer = client.call("get_layers_at_point", "GetLayersAtPoint", location=client.point(0, 0))
    assert (answer.success, answer.layers) == (True, [])
    assert client.call("load_map", "LoadMap", filename="building.hmap").success
    assert client.string("occupancy", 0.5, 0.5) == "Free"


@pytest.mark.skipif(not REAL_MAPS.is_dir(), reason="the real maps are not here")
def test_a_real_map_answers_as_worked_out_by_hand(client, directory):
    save_map(open_map(REAL_MAPS / "lab.hmap"), directory / "lab.hmap")
    assert client.call("load_map", "LoadMap", filename="lab.hmap").success
    try:
        assert client.string("semantic", 3, -2) == "table"
        found = client.call(
            "get_locations_by_string", "GetLocationsByString", layer="semantic", name="sink"
        )
        assert [(round(p.x, 3), round(p.y, 3)) for p in found.locations] == [(3.259, 2.378)]
        hits = client.call(
            "get_strings_by_area",
            "GetStringsByArea",
            layer="semantic",
            area=client.box(2, -2, 3, -1, "map"),
        )
        assert sorted(hits.names) == ["chair", "table", "tvmonitor"]
        occupied = client.call(
            "get_locations_by_int", "GetLocationsByInt", layer="occupancy", value=100
        )
        assert len(occupied.locations) == 954
    finally:
        client.call("load_map", "LoadMap", filename="building.hmap")
