"""A path that SLAM has optimized moves the map of a live node."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from hypermap.core.errors import HypermapError
from hypermap.core.trajectory import pose_from_rpy, quats_of
from hypermap.perception.frame import RgbdFrame
from hypermap.ros.mapper.path_corrections import path_of
from hypermap.ros.ros1.messages import message_class

from . import live_camera as camera
from .conftest import wait_for
from .semantic_mapper_tools import RAW, Room, drive, room

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


def places(node: Room) -> NDArray[np.float64]:
    """The centers of the objects in the order of their ids."""
    objects = node.node.hypermap().semantic("semantic").objects()
    return np.array([(one.footprint.centroid.x, one.footprint.centroid.y) for one in objects])


def ros_path(stamps: NDArray[np.float64], poses: NDArray[np.float64]) -> Any:
    import rospy

    message = message_class("nav_msgs/Path")()
    message.header.frame_id = "map"
    for stamp, pose, quat in zip(stamps, poses, quats_of(poses[:, :3, :3]), strict=True):
        stamped = message_class("geometry_msgs/PoseStamped")()
        stamped.header.stamp = rospy.Time.from_sec(stamp)
        place, turn = stamped.pose.position, stamped.pose.orientation
        place.x, place.y, place.z = pose[:3, 3].tolist()
        turn.x, turn.y, turn.z, turn.w = quat.tolist()
        message.poses.append(stamped)
    return message
