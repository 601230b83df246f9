"""Paths and rooms over ROS 1, asked through a real roscore, and over ROS 2's classes."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from hypermap.colors import class_colors
from hypermap.core.hypermap import Hypermap
from hypermap.paths import PathSettings, Planner
from hypermap.rooms.rooms import rooms_on
from hypermap.ros.messages.marker_array import MarkerStyle, marker_array
from hypermap.ros.messages.room_markers import room_markers
from hypermap.ros.server.map_server import MapServer

from .conftest import Process, wait_for
from .map_server_tools import Client, saved
from .rooms_to_serve import flat
from .ros2_fixtures import graph, make_port

__all__ = ["graph", "make_port"]

RADIUS = 0.2
LINE_LIST = 5


@pytest.fixture(scope="module")
def server(rospy: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Process]:
    folder = tmp_path_factory.mktemp("flat")
    file = saved(flat(), folder / "flat.hmap")
    command = [sys.executable, "-m", "hypermap", "serve", file, "--ros1"]
    command += ["--param", f"robot_radius={RADIUS}", "__name:=planning_server"]
    process = Process([str(word) for word in command], folder / "server.log")
    yield process
    process.stop()


@pytest.fixture(scope="module")
def client(rospy: Any, server: Process) -> Client:
    return Client(rospy, "planning_server")


def pose(message: Callable[..., Any], x: float, y: float, yaw: float = 0.0, frame: str = "") -> Any:
    made = message("geometry_msgs/PoseStamped")
    made.header.frame_id = frame
    made.pose.position.x, made.pose.position.y = x, y
    made.pose.orientation.z, made.pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
    return made


def plan(client: Client, start: Any, goal: Any, tolerance: float = 0.0) -> np.ndarray:
    """Return the poses of a plan as x, y and yaw, shape (N, 3)."""
    answer = client.call(
        "make_plan", "nav_msgs/GetPlan", start=start, goal=goal, tolerance=tolerance
    ).plan
    assert answer.header.frame_id == "map"
    return poses_of(answer)


def poses_of(path: Any) -> np.ndarray:
    return np.array(
        [
            (
                item.pose.position.x,
                item.pose.position.y,
                2 * math.atan2(item.pose.orientation.z, item.pose.orientation.w),
            )
            for item in path.poses
        ]
    )


@pytest.mark.xdist_group("ros")
def test_a_plan_is_the_shortest_path_and_looks_ahead_to_the_goal(client):
    poses = plan(client, pose(client.message, 3.0, 1.5), pose(client.message, 7.0, 1.5, 1.0))
    assert poses[0, :2].tolist() == [3.0, 1.5]
    assert poses[-1].tolist() == pytest.approx([7.0, 1.5, 1.0])
    steps = np.diff(poses[:, :2], axis=0)
    far = np.hypot(*steps.T)
    assert far.max() <= 0.05 + 1e-9
    expected = Planner(flat(), PathSettings(RADIUS)).path([3.0, 1.5], [7.0, 1.5]).length
    assert far.sum() == pytest.approx(expected)
    assert poses[:-1, 2] == pytest.approx(np.arctan2(steps[:, 1], steps[:, 0]))


@pytest.mark.xdist_group("ros")
def test_a_robot_at_its_goal_gets_the_goal(client):
    here = pose(client.message, 3, 1.5)
    found = plan(client, here, pose(client.message, 3, 1.5, yaw=0.5))
    np.testing.assert_allclose(found, [[3, 1.5, 0.5]], atol=1e-9)


@pytest.mark.xdist_group("ros")
def test_a_goal_may_be_in_another_frame_of_the_map(client):
    goal = pose(client.message, 1.5, 3.0, 0.0, "turned")  # (7, 1.5) in the map, turned left
    poses = plan(client, pose(client.message, 3.0, 1.5), goal)
    assert poses[-1].tolist() == pytest.approx([7.0, 1.5, math.pi / 2])


@pytest.mark.xdist_group("ros")
def test_a_goal_in_a_wall_is_refused_unless_the_tolerance_reaches_beyond(client, server):
    start, goal = pose(client.message, 3.0, 1.5), pose(client.message, 4.5, 1.5)
    fields = {"start": start, "goal": goal, "tolerance": 0.0}
    said = client.refused("make_plan", "nav_msgs/GetPlan", **fields)
    assert "the goal (4.50, 1.50) is in a wall (cell row 30, col 90)" in said
    server.expect("the goal (4.50, 1.50) is in a wall")
    end = plan(client, start, goal, 1.0)[-1]
    assert end[:2].tolist() == pytest.approx([4.175, 1.475], abs=0.051)  # on the side of the start


@pytest.mark.xdist_group("ros")
@pytest.mark.parametrize(
    ("start", "goal", "tolerance", "error"),
    [
        ((math.nan, 0), (1, 1), 0, "the pose must be finite"),
        ((1, 1), (30, 1), 0, "the goal (30.00, 1.00) is off the grid"),
        ((1, 1), (30, 1), 2, "the goal (30.00, 1.00) is off the grid"),
        ((1, 1), (2, 2), -1, "the tolerance must be 0 or more meters, got -1.0"),
        ((1, 1), (2, 2), math.inf, "the tolerance must be 0 or more meters, got inf"),
    ],
)
def test_what_is_no_plan_is_an_error_that_the_caller_can_read(
    client, start, goal, tolerance, error
):
    fields = {"start": pose(client.message, *start), "goal": pose(client.message, *goal)}
    said = client.refused("make_plan", "nav_msgs/GetPlan", tolerance=tolerance, **fields)
    assert error in said


@pytest.mark.xdist_group("ros")
def test_the_robot_and_zones_may_change_while_the_server_runs(client):
    start, goal = pose(client.message, 3.0, 1.5), pose(client.message, 7.0, 1.5)
    fields = {"start": start, "goal": goal, "tolerance": 0.0}
    proxy = client.proxy("make_plan", "nav_msgs/GetPlan")

    def said() -> str:
        """Return why there is no plan; nothing where there is one."""
        try:
            proxy(**fields)
        except client.rospy.ServiceException as error:
            return str(error)
        return ""

    for name, value, before, error in (
        ("robot_radius", 0.6, RADIUS, "no path leads from (3.00, 1.50) to (7.00, 1.50) for a"),
        ("keepout", ["cup 3.5"], [], "is in a keepout zone"),
    ):
        client.rospy.set_param(f"/planning_server/{name}", value)
        wait_for(lambda error=error: error in said(), error)
        client.rospy.set_param(f"/planning_server/{name}", before)
        wait_for(lambda: not said(), "the path as before")


@pytest.mark.xdist_group("ros")
def test_objects_are_found_by_the_name_and_the_kind_of_their_room(client):
    for inside, ids in (("kitchen", [0]), ("Emma's place", [0]), ("office", [1]), ("room 1", [1])):
        found = client.call("find_objects", "FindObjects", name="cup", inside=inside)
        assert (found.success, [item.object.id for item in found.objects]) == (True, ids)
    location = client.point(7.5, 4.0)
    layers = client.call("get_layers_at_point", "GetLayersAtPoint", location=location).layers
    assert {layer.layer: layer.label for layer in layers}["rooms"] == "office"


@pytest.mark.xdist_group("ros")
def test_doors_and_the_graph_are_published_for_rviz(client):
    array = client.heard("room_graph", "visualization_msgs/MarkerArray")
    assert {marker.ns for marker in array.markers[1:]} == {"doors", "graph"}
    assert array.markers[1].header.frame_id == "map"


def shown(types: Any, robot_radius: float) -> dict[str, np.ndarray]:
    """Return both ends of the lines of each namespace, shape (N, 2, 3)."""
    rooms = rooms_on(flat())
    assert rooms is not None
    array = types.sent(room_markers(rooms, robot_radius, 0.1, types))
    assert {marker.type for marker in array.markers[1:]} == {LINE_LIST}
    return {
        marker.ns: np.array([(p.x, p.y, p.z) for p in marker.points]).reshape(-1, 2, 3)
        for marker in array.markers[1:]
    }


def test_a_door_is_a_line_and_the_graph_leads_through_it(types):
    markers = shown(types, RADIUS)
    assert markers["doors"].tolist() == [[[4.5, 3.5, 0.1], [4.5, 4.4, 0.1]]]
    rooms, doors = markers["graph"].transpose(1, 0, 2)
    assert doors == pytest.approx(np.array([[4.5, 3.95, 0.1]] * 2))
    assert rooms[0, 0] < 4.5 < rooms[1, 0]


def test_a_door_too_narrow_for_the_robot_is_no_link(types):
    assert shown(types, 0.5).keys() == {"narrow doors"}


def test_rooms_lie_below_what_stands_in_them(types):
    heights = {}
    for name in ("rooms", "things"):
        layer = flat().semantic(name)
        array = marker_array(layer, class_colors(layer.names), types, MarkerStyle())
        drawn = [marker for marker in types.sent(array).markers if len(marker.points)]
        heights[name] = [point.z for marker in drawn for point in marker.points]
    assert max(heights["rooms"]) < min(heights["things"])


def test_ros_2_plans_and_says_nothing_where_no_path_leads(graph, make_port, tmp_path):
    file = saved(flat(), tmp_path / "flat.hmap")
    given = [f"file:={file}", "load_map:=true", "console:=false", f"robot_radius:={RADIUS}"]
    words = [word for value in given for word in ("-p", value)]
    port = make_port("hypermap_server", "--ros-args", *words)
    port.manage(MapServer(port))

    def message(name: str) -> Any:
        return graph.types.message(name)()

    start, goal = pose(message, 3.0, 1.5), pose(message, 7.0, 1.5)
    poses = poses_of(graph.call("/hypermap_server/make_plan", start=start, goal=goal).plan)
    assert poses[[0, -1], :2].tolist() == [[3.0, 1.5], [7.0, 1.5]]
    wall = pose(message, 4.5, 1.5)
    assert graph.call("/hypermap_server/make_plan", start=start, goal=wall).plan.poses == []
    assert "is in a wall" in graph.logged[-1][1]


def test_a_map_without_rooms_has_no_graph(graph, make_port, tmp_path):
    hypermap = Hypermap([flat()["occupancy"]])
    file = saved(hypermap, tmp_path / "bare.hmap")
    words = ["-p", f"file:={file}", "-p", "load_map:=true", "-p", "console:=false"]
    port = make_port("hypermap_server", "--ros-args", *words)
    port.manage(MapServer(port))
    assert "/hypermap_server/room_graph" not in graph.topics()
