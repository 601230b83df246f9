"""The semantic mapper on ROS 2: a simulated drive as ROS 2 messages, to a map."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hypermap.core.errors import HypermapError
from hypermap.core.semantic import SemanticLayer
from hypermap.formats import open_map
from hypermap.perception.frame import RgbdFrame
from hypermap.ros.mapper.semantic_mapper import SemanticMapper
from hypermap.ros.mapper.statistics import Fate

from .conftest import wait_for
from .fake_rclpy import other_node
from .fake_rclpy_node import Graph
from .fake_rclpy_values import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from .ros2_fixtures import graph, make_port
from .ros2_robot import DEPTH, DETECTIONS, INFO, Robot, drive

__all__ = ["graph", "make_port"]

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("ros2_mapper")]

NODE = "/semantic_mapper"


@pytest.fixture(scope="module")
def frames() -> list[RgbdFrame]:
    """The beginning of a drive through the demo's room."""
    return drive(12)


def robot_of(graph: Graph, node: Any) -> Robot:
    def publisher(topic: str, kind: Any, is_best_effort: bool) -> Any:
        policies = ReliabilityPolicy
        chosen = policies.BEST_EFFORT if is_best_effort else policies.RELIABLE
        return node.create_publisher(kind, topic, QoSProfile(depth=100, reliability=chosen))

    return Robot(graph.types.message, publisher)


def started(make_port: Callable[..., Any], *parameters: str) -> tuple[Any, SemanticMapper]:
    given = (
        f"depth_topic:={DEPTH}",
        f"detections_topic:={DETECTIONS}",
        "detections_type:=vision_msgs/Detection2DArray",
        "tf_timeout:=10.0",
        *parameters,
    )
    words = [word for value in given for word in ("-p", value)]
    port = make_port("semantic_mapper", "--ros-args", *words)
    node = SemanticMapper(port)
    port.manage(node)
    return port, node


def totals(node: SemanticMapper) -> dict[Fate, int]:
    report = node.report()
    assert report is not None
    return dict(report.totals)


def test_a_drive_becomes_a_map(
    graph: Graph, make_port: Callable[..., Any], frames: list[RgbdFrame], tmp_path: Path
) -> None:
    file = tmp_path / "drive.hmap"
    port, node = started(make_port, f"save_to:={file}", f"map_directory:={tmp_path}")
    with other_node(graph) as other:
        robot = robot_of(graph, other)
        for number, frame in enumerate(frames, start=1):
            robot.show(frame)
            wait_for(lambda n=number: sum(totals(node).values()) >= n, f"frame {number}")  # type: ignore[misc]
    assert totals(node) == {Fate.MAPPED: len(frames)}
    wait_for(lambda: graph.latest("/semantic_map").objects, "objects")
    assert graph.topics()["/diagnostics"] == "diagnostic_msgs/msg/DiagnosticArray"
    for timer in graph.node(NODE)._timers:
        timer.callback()  # diagnostics go out, with bytes for levels
    assert graph.call(f"{NODE}/save_map", filename="asked.hmap").success
    port.shut_down()
    port.spin()
    assert not [text for level, text in graph.logged if level == "error"]
    layer = open_map(file)["semantic"]
    assert isinstance(layer, SemanticLayer)
    names = Counter(item.name for item in layer.objects())
    seen = {str(n) for f in frames if f.detections is not None for n in f.detections.names}
    assert names
    assert names.keys() <= seen


def test_its_map_is_latched_and_its_inputs_take_what_comes(
    graph: Graph, make_port: Callable[..., Any]
) -> None:
    started(make_port)
    (publisher,) = graph.publishers("/semantic_map")
    assert publisher.qos.durability == DurabilityPolicy.TRANSIENT_LOCAL
    for topic in (DEPTH, INFO, DETECTIONS):
        (subscription,) = graph.subscriptions(topic)
        assert subscription.qos.reliability == ReliabilityPolicy.BEST_EFFORT
        assert subscription.qos.durability == DurabilityPolicy.VOLATILE


def test_where_to_look_next_is_published_for_the_caller_to_decide(
    graph: Graph, make_port: Callable[..., Any], frames: list[RgbdFrame]
) -> None:
    _, node = started(
        make_port,
        "frontiers:=true",
        "frontiers_every:=0.1",
        "base_frame:=camera_optical_frame",
        "through_unknown:=true",
    )
    topic = f"{NODE}/frontier_poses"
    (publisher,) = graph.publishers(topic)
    assert publisher.qos.durability == DurabilityPolicy.TRANSIENT_LOCAL
    with other_node(graph) as other:
        pose_array = graph.types.message("geometry_msgs/PoseArray")
        other.create_subscription(pose_array, topic, lambda _: None, QoSProfile(depth=1))
        robot = robot_of(graph, other)
        robot.show(frames[0])
        wait_for(lambda: totals(node).get(Fate.MAPPED) == 1, "a frame")
        wait_for(lambda: topic in graph.kept, "poses")
    poses = graph.latest(topic)
    assert poses.poses
    assert poses.header.frame_id == "map"
    markers = graph.latest(f"{NODE}/frontiers").markers
    assert len([m for m in markers if m.ns == "stands"]) == len(poses.poses)


def test_it_is_cleared_on_request(
    graph: Graph, make_port: Callable[..., Any], frames: list[RgbdFrame]
) -> None:
    _, node = started(make_port)
    with other_node(graph) as other:
        robot = robot_of(graph, other)
        for number, frame in enumerate(frames[:6], start=1):
            robot.show(frame)
            wait_for(lambda n=number: sum(totals(node).values()) >= n, f"frame {number}")  # type: ignore[misc]
    assert len(node) > 0
    answer = graph.call(f"{NODE}/clear")
    assert answer.success
    assert "forgotten" in answer.message
    assert len(node) == 0


def test_a_frame_without_tf_is_counted(
    graph: Graph, make_port: Callable[..., Any], frames: list[RgbdFrame]
) -> None:
    _, node = started(make_port, "tf_timeout:=0.05")
    with other_node(graph) as other:
        robot = robot_of(graph, other)
        for topic, make in ((INFO, robot.info), (DETECTIONS, robot.detections)):
            robot.publishers[topic].publish(make(frames[0]))
        robot.publishers[DEPTH].publish(robot.depth(frames[0]))
        wait_for(lambda: totals(node).get(Fate.NO_TF) == 1, "the count")


def test_settings_that_do_not_go_together_end_the_start(
    graph: Graph, make_port: Callable[..., Any]
) -> None:
    with pytest.raises(HypermapError, match="cloud_topic"):
        started(make_port, "cloud_topic:=/points")
    assert graph.nodes == []


def test_pixels_are_not_lost_on_the_way(graph: Graph, frames: list[RgbdFrame]) -> None:
    robot = Robot.__new__(Robot)  # without a node, to make messages
    robot.message = graph.types.message
    message = robot.depth(frames[0])
    received = graph.types.from_cdr(graph.types.to_cdr(message), message.TYPE_NAME)
    depth = np.frombuffer(received.data, "<f4").reshape(frames[0].depth.shape)
    np.testing.assert_array_equal(depth, frames[0].depth)
