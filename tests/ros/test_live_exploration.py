"""What a live node says of where to look next: on a real roscore, and in ROS 2's messages."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest

from hypermap.exploration import Explorer, Sensor
from hypermap.paths import PathSettings
from hypermap.perception.frame import RgbdFrame
from hypermap.ros.mapper.exploring import LiveExploration
from hypermap.ros.mapper.first_mapper import FirstMapper
from hypermap.ros.ros1.messages import message_class

from . import live_camera as camera
from .conftest import wait_for
from .semantic_mapper_tools import RAW, Given, Room, drive, room

__all__ = ["drive", "room"]

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("ros")]

EXPLORING = {
    "frontiers": True,
    "frontiers_every": 0.1,
    "base_frame": camera.FRAME,
    "robot_radius": 0.2,
    "through_unknown": True,
    "sensor_min_range": 1.0,
}


def test_frontiers_and_next_views_are_published(
    room: Callable[..., Room],
    rospy: Any,
    drive: list[RgbdFrame],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    node = room(camera.INFO, camera.DARKNET, camera.DEPTH, **RAW, **EXPLORING)
    got: dict[str, list[Any]] = {}
    name = rospy.get_name()
    topics = {
        f"{name}/frontiers": "visualization_msgs/MarkerArray",
        f"{name}/frontier_poses": "geometry_msgs/PoseArray",
        f"{name}/next_view_poses": "geometry_msgs/PoseArray",
    }
    listeners = [
        rospy.Subscriber(topic, message_class(kind), got.setdefault(topic, []).append)
        for topic, kind in topics.items()
    ]
    node.show_camera_info(drive[0])
    node.map(drive[:6])
    x, y = drive[5].map_T_camera[:2, 3].tolist()
    robot = PathSettings(0.2, unknown_is_free=True)
    explorer = Explorer(node.node.hypermap(), [x, y], robot, Sensor(min_range=1.0))
    frontiers, views = explorer.frontiers(), explorer.next_views()
    assert frontiers
    assert views

    def poses(topic: str) -> list[tuple[float, ...]]:
        message = got[f"{name}/{topic}"][-1] if got[f"{name}/{topic}"] else None
        if message is None:
            return []
        assert message.header.frame_id == "map"
        return [
            (p.position.x, p.position.y, 2 * math.atan2(p.orientation.z, p.orientation.w))
            for p in message.poses
        ]

    def expected(goals: Any) -> list[Any]:
        return [pytest.approx((g.pose.x, g.pose.y, g.pose.yaw), abs=1e-6) for g in goals]

    wait_for(lambda: poses("frontier_poses") == expected(frontiers), "the frontiers of this map")
    wait_for(lambda: poses("next_view_poses") == expected(views), "the views of this map")
    wait_for(lambda: len(of(got[f"{name}/frontiers"], "frontiers")) == len(frontiers), "markers")
    markers = got[f"{name}/frontiers"]
    assert markers[-1].markers[0].action == 3  # deletes what was
    assert [len(m.points) for m in of(markers, "frontiers")] == [
        len(each.points_xy) for each in frontiers
    ]
    assert of(markers, "gains")[0].text.startswith(f"1: {frontiers[0].gain:.1f} m2")
    assert of(markers, "next_views")[0].pose.position.x == pytest.approx(views[0].pose.x)

    (exploration,) = (
        each
        for each in node.node._life._others  # type: ignore[union-attr]
        if isinstance(each, LiveExploration)
    )
    looks = count_calls(exploration._repeating, "_try", monkeypatch)
    published: list[Any] = []
    publish = exploration._markers.publish
    monkeypatch.setattr(
        exploration._markers, "publish", lambda made: (published.append(made), publish(made))
    )
    wait_for(lambda: len(looks) > 2, "the end of the look that was under way")
    count = len(published)
    node.show_tf(drive[5])  # neither map nor robot has moved
    seen = len(looks)
    wait_for(lambda: len(looks) > seen + 2, "more looks")
    assert len(published) == count
    for listener in listeners:
        listener.unregister()


def count_calls(owner: Any, name: str, monkeypatch: pytest.MonkeyPatch) -> list[None]:
    """Return a list that grows with each call of a method from now on, when it has ended."""
    ended: list[None] = []
    call = getattr(owner, name)

    def counted(*args: Any) -> None:
        call(*args)
        ended.append(None)

    monkeypatch.setattr(owner, name, counted)
    return ended


def test_the_mapper_of_2019_publishes_areas_under_their_old_names(rospy: Any, port: Any) -> None:
    import rosgraph

    node = FirstMapper(Given(port, {"depth_topic": camera.DEPTH}))  # type: ignore[arg-type]
    node.configure()
    node.activate()
    try:
        topics = {topic for topic, _ in rosgraph.Master("/tests").getSystemState()[0]}
        name = rospy.get_name()
        names = ("camera_pg", "complete_area_pg", "detected_pg", "observed_area", "detected_shape")
        assert {f"{name}/{each}" for each in names} <= topics
    finally:
        node.deactivate()


def of(messages: list[Any], namespace: str) -> list[Any]:
    return [m for m in messages[-1].markers if m.ns == namespace] if messages else []


def test_where_tf_knows_no_robot_it_is_reported(
    room: Callable[..., Room], rospy: Any, drive: list[RgbdFrame]
) -> None:
    given = {**EXPLORING, "base_frame": "base_footprint"}
    node = room(camera.INFO, camera.DARKNET, camera.DEPTH, **RAW, **given)
    topic = f"{rospy.get_name()}/frontier_poses"
    listener = rospy.Subscriber(topic, message_class("geometry_msgs/PoseArray"), lambda _: None)
    node.show_camera_info(drive[0])
    node.map(drive[:1])
    wait_for(lambda: node.logged("no frontiers: "), "a warning")
    assert "base_footprint" in node.logged("no frontiers: ")[0]
    listener.unregister()
