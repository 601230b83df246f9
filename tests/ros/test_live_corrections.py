"""A path or a graph that SLAM has optimized moves the map of a live node."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from hypermap.core.errors import HypermapError
from hypermap.core.trajectory import pose_from_rpy, quats_of
from hypermap.evaluation.metrics import evaluate
from hypermap.perception.frame import RgbdFrame
from hypermap.ros import typestore
from hypermap.ros.mapper.optimized_poses import TimedGraph, path_of
from hypermap.ros.ros1.messages import message_class

from . import live_camera as camera
from .conftest import wait_for
from .semantic_mapper_tools import RAW, Room, drive, mapped, room, with_whole_pixels

__all__ = ["drive", "room"]

Place, Turn = SimpleNamespace, SimpleNamespace


def path(stamps: list[int], frame_id: str = "map", quat: tuple[float, ...] = (0, 0, 0, 1)) -> Any:
    """A path along x, one meter each second."""
    x, y, z, w = quat
    return SimpleNamespace(
        header=SimpleNamespace(frame_id=frame_id),
        poses=[
            SimpleNamespace(
                header=SimpleNamespace(stamp=SimpleNamespace(sec=stamp, nanosec=0)),
                pose=SimpleNamespace(
                    position=Place(x=stamp, y=0, z=0), orientation=Turn(x=x, y=y, z=z, w=w)
                ),
            )
            for stamp in stamps
        ],
    )


def test_the_poses_of_a_path_are_sorted_and_the_last_of_a_stamp_counts() -> None:
    trajectory = path_of(path([5, 3, 4, 4], frame_id="/map"), "map")
    assert trajectory.stamps.tolist() == [3, 4, 5]
    assert trajectory.at([3.5])[0, 0, 3] == 3.5


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (path([1, 2], frame_id="odom"), "the path is in the frame 'odom', not in 'map'"),
        (path([]), "at least two poses"),
        (path([7, 7]), "at least two poses"),
        (path([1, 2], quat=(0, 0, 0, 0)), "quaternion"),
        (path([1, 2], quat=(0, 0, 0, np.nan)), "quaternion"),
    ],
)
def test_what_is_no_path_is_one_error(message: Any, reason: str) -> None:
    with pytest.raises(HypermapError, match=reason):
        path_of(message, "map")


def graph(stamp: float, ids: list[int], frame_id: str = "map", off: float = 0.0) -> Any:
    """RTAB-Map's graph in ROS 2's spelling: node n is at x = n, or beside that."""
    message = typestore.message_class("rtabmap_msgs/MapGraph")()
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(round(stamp * 1e9), 10**9)
    message.header.frame_id, message.poses_id = frame_id, ids
    for number in ids:
        pose = typestore.message_class("geometry_msgs/Pose")()
        pose.position.x = number + off
        message.poses.append(pose)
    return message


def learned(*graphs: Any) -> TimedGraph:
    timed = TimedGraph()
    for each in graphs:
        timed.learn(each)
    return timed


@pytest.mark.parametrize(
    ("graphs", "stamps"),
    [
        ([(10, [1]), (11, [1, 2]), (12, [1, 2, 3])], [10, 11, 12]),
        ([(10, [1]), (12, [1, 2, 3])], [10, 12]),  # the graph of node 2 was lost
        ([(10, [1, 2, 3]), (11, [1, 2, 3, 4]), (12, [2, 3, 4, 5])], [11, 12]),  # joined later
        ([(10, [-7, 1]), (11, [-7, 1, 2])], [10, 11]),  # a landmark
        ([(10, [1]), (11, [1, 2]), (12, [1, 2]), (13, [1, 2, 4])], [10, 11, 13]),  # stood still
        ([(10, [1]), (11, [1, 2]), (12, [1, 2, 3]), (20, [1]), (21, [1, 2])], [20, 21]),  # reset
        ([(10, [1]), (11, [1, 2]), (5, [1]), (6, [1, 2])], [5, 6]),  # a bag is played again
    ],
)
def test_the_newest_node_of_a_graph_is_of_its_time(graphs: Any, stamps: list[float]) -> None:
    messages = [graph(*each) for each in graphs]
    trajectory = learned(*messages).path(messages[-1], "map")
    assert trajectory is not None
    assert trajectory.stamps.tolist() == stamps
    assert trajectory.positions[-1].tolist() == [max(graphs[-1][1]), 0, 0]


def test_a_graph_without_times_corrects_nothing() -> None:
    joined = graph(10, [1, 2, 3])
    assert learned(joined).path(joined, "map") is None
    assert learned(graph(10, [])).path(graph(10, []), "map") is None


def test_what_is_no_graph_is_one_error() -> None:
    with pytest.raises(HypermapError, match="the graph is in the frame 'odom', not in 'map'"):
        TimedGraph().path(graph(1, [1], frame_id="odom"), "map")
    message = graph(1, [1, 2])
    del message.poses[0]
    with pytest.raises(HypermapError, match="a graph of 2 nodes has 1 poses"):
        TimedGraph().path(message, "map")


@pytest.mark.slow
@pytest.mark.xdist_group("ros")
def test_a_loop_closure_moves_the_map(
    room: Callable[..., Room], rospy: Any, drive: list[RgbdFrame]
) -> None:
    frames = drive[:8]
    given = {"path_topic": "/slam/path", "base_frame": camera.FRAME}
    node = room(camera.INFO, camera.DARKNET, camera.DEPTH, **RAW, **given)
    node.show_camera_info(frames[0])
    off = pose_from_rpy(0.4, -0.3, 0, 0, 0, 0.05)
    node.map([frame.moved_to(off @ frame.map_T_camera) for frame in frames])
    stamps, poses = node.live_map.logged_poses()
    before = places(node)
    publisher = rospy.Publisher(
        "/slam/path", message_class("nav_msgs/Path"), queue_size=1, latch=True
    )
    publisher.publish(ros_path(stamps, np.linalg.inv(off) @ poses))
    wait_for(lambda: any("corrected the poses of" in text for _, text in node.lines), "a new map")
    expected = [np.linalg.inv(off) @ [*place, 0, 1] for place in before]
    assert places(node) == pytest.approx(np.array([place[:2] for place in expected]), abs=0.05)
    publisher.unregister()


@pytest.mark.slow
@pytest.mark.xdist_group("ros")
def test_a_loop_closure_in_the_graph_of_slam_moves_the_map(
    room: Callable[..., Room], rospy: Any, drive: list[RgbdFrame]
) -> None:
    off = pose_from_rpy(0.4, -0.3, 0, 0, 0, 0.05)
    frames = [frame.moved_to(off @ frame.map_T_camera) for frame in drive[:6]]
    topic, kind = "/rtabmap/mapGraph", message_class("rtabmap_msgs/MapGraph")
    given = {"graph_topic": topic, "base_frame": camera.FRAME}
    node = room(camera.INFO, camera.DARKNET, camera.DEPTH, **RAW, **given)
    publisher = rospy.Publisher(topic, kind, queue_size=100)
    wait_for(publisher.get_num_connections, "a listener for the graph")
    node.show_camera_info(frames[0])
    for count, frame in enumerate(frames, start=1):
        node.camera.show(frame)
        node.wait_for(MAPPED=count)
        poses = [one.map_T_camera for one in frames[:count]]
        if count == len(frames):  # here the loop is closed
            poses = [one.map_T_camera for one in drive[:count]]
        publisher.publish(ros_graph(frame.stamp, poses))
    wait_for(lambda: node.logged("corrected the poses of 6 frames"), "a new map")
    publisher.unregister()
    assert np.abs(node.live_map.logged_poses()[1] - poses).max() < 1e-6
    found = node.node.hypermap().semantic("semantic").objects()
    score = evaluate(found, mapped([with_whole_pixels(frame) for frame in drive[:6]])).overall
    assert score.iou is not None
    assert score.iou > 0.9


def ros_graph(stamp: float, poses: list[NDArray[np.float64]]) -> Any:
    message = message_class("rtabmap_msgs/MapGraph")()
    message.header = camera.new(camera.DEPTH, stamp, "map").header
    message.posesId = list(range(1, len(poses) + 1))
    message.poses = [ros_pose(pose) for pose in poses]
    return message


def places(node: Room) -> NDArray[np.float64]:
    """The centers of the objects in the order of their ids."""
    objects = node.node.hypermap().semantic("semantic").objects()
    return np.array([(one.footprint.centroid.x, one.footprint.centroid.y) for one in objects])


def ros_path(stamps: NDArray[np.float64], poses: NDArray[np.float64]) -> Any:
    import rospy

    message = message_class("nav_msgs/Path")()
    message.header.frame_id = "map"
    for stamp, pose in zip(stamps, poses, strict=True):
        stamped = message_class("geometry_msgs/PoseStamped")()
        stamped.header.stamp = rospy.Time.from_sec(stamp)
        stamped.pose = ros_pose(pose)
        message.poses.append(stamped)
    return message


def ros_pose(pose: NDArray[np.float64]) -> Any:
    message = message_class("geometry_msgs/Pose")()
    place, turn = message.position, message.orientation
    place.x, place.y, place.z = pose[:3, 3].tolist()
    turn.x, turn.y, turn.z, turn.w = quats_of(pose[np.newaxis, :3, :3])[0].tolist()
    return message
