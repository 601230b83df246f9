"""The semantic mapper on ROS 2: a simulated drive as ROS 2 messages, to a map."""

from __future__ import annotations

import array
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hypermap.core.errors import HypermapError
from hypermap.core.semantic import SemanticLayer
from hypermap.formats import open_map
from hypermap.perception.frame import RgbdFrame
from hypermap.ros.mapper.semantic_mapper import SemanticMapper
from hypermap.ros.mapper.statistics import Fate
from hypermap.simulation import SimulatedRecording, demo_world

from .conftest import wait_for
from .fake_rclpy import other_node
from .fake_rclpy_node import Graph
from .fake_rclpy_values import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from .ros2_fixtures import graph, make_port

__all__ = ["graph", "make_port"]

pytestmark = pytest.mark.slow

NODE = "/semantic_mapper"
CAMERA = "camera_optical_frame"
TYPES = {
    "/camera/depth/image_rect": "sensor_msgs/Image",
    "/camera/depth/camera_info": "sensor_msgs/CameraInfo",
    "/detections": "vision_msgs/Detection2DArray",
    "/tf": "tf2_msgs/TFMessage",
}
DEPTH, INFO, DETECTIONS, TF = TYPES


@pytest.fixture(scope="module")
def drive() -> list[RgbdFrame]:
    """The beginning of a drive through the demo's room."""
    frames = islice(SimulatedRecording(demo_world(), rate=1.0).frames(), 12)
    return [replace(f, stamp=f.stamp + 1.6e9, color_stamp=f.stamp + 1.6e9) for f in frames]


class Robot:
    """A camera, its detector and its pose, as nodes of ROS 2 publish them."""

    def __init__(self, graph: Graph, node: Any) -> None:
        self.types = graph.types
        sensor = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
        qos = {TF: QoSProfile(depth=100), DETECTIONS: QoSProfile(depth=10)}
        self.publishers = {
            topic: node.create_publisher(self.types.message(kind), topic, qos.get(topic, sensor))
            for topic, kind in TYPES.items()
        }

    def show(self, frame: RgbdFrame) -> None:
        for topic, make in (
            (TF, self.tf),
            (INFO, self.info),
            (DETECTIONS, self.detections),
            (DEPTH, self.depth),
        ):
            self.publishers[topic].publish(make(frame))

    def header(self, message: Any, frame: RgbdFrame, frame_id: str = CAMERA) -> Any:
        stamp = divmod(round(frame.stamp * 1e9), 10**9)
        message.header.stamp.sec, message.header.stamp.nanosec = stamp
        message.header.frame_id = frame_id
        return message

    def depth(self, frame: RgbdFrame) -> Any:
        height, width = frame.depth.shape
        data = array.array("B", frame.depth.astype("<f4").tobytes())
        made = self.types.message(TYPES[DEPTH])(
            height=height, width=width, encoding="32FC1", step=4 * width, data=data
        )
        return self.header(made, frame)

    def info(self, frame: RgbdFrame) -> Any:
        height, width = frame.depth.shape
        made = self.types.message(TYPES[INFO])(height=height, width=width)
        made.k = frame.camera.K.ravel().astype(float)
        return self.header(made, frame)

    def detections(self, frame: RgbdFrame) -> Any:
        made = self.header(self.types.message(TYPES[DETECTIONS])(), frame)
        found = frame.detections
        assert found is not None
        for box, name, score in zip(found.xyxy.tolist(), found.names, found.scores, strict=True):
            item = self.types.message("vision_msgs/Detection2D")()
            item.bbox.center.position.x = (box[0] + box[2]) / 2
            item.bbox.center.position.y = (box[1] + box[3]) / 2
            item.bbox.size_x, item.bbox.size_y = box[2] - box[0], box[3] - box[1]
            best = self.types.message("vision_msgs/ObjectHypothesisWithPose")()
            best.hypothesis.class_id, best.hypothesis.score = str(name), float(score)
            item.results = [best]
            made.detections.append(item)
        return made

    def tf(self, frame: RgbdFrame) -> Any:
        made = self.types.message("geometry_msgs/TransformStamped")(child_frame_id=CAMERA)
        self.header(made, frame, "map")
        p, q = made.transform.translation, made.transform.rotation
        p.x, p.y, p.z = frame.map_T_camera[:3, 3].tolist()
        q.x, q.y, q.z, q.w = Rotation.from_matrix(frame.map_T_camera[:3, :3]).as_quat().tolist()
        return self.types.message(TYPES[TF])(transforms=[made])


def started(make_port: Callable[..., Any], *parameters: str) -> tuple[Any, SemanticMapper]:
    given = (
        f"depth_topic:={DEPTH}",
        f"detections_topic:={DETECTIONS}",
        "detections_type:=vision_msgs/Detection2DArray",
        "tf_timeout:=5.0",
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
    graph: Graph, make_port: Callable[..., Any], drive: list[RgbdFrame], tmp_path: Path
) -> None:
    file = tmp_path / "drive.hmap"
    port, node = started(make_port, f"save_to:={file}", f"map_directory:={tmp_path}")
    with other_node(graph) as other:
        robot = Robot(graph, other)
        for number, frame in enumerate(drive, start=1):
            robot.show(frame)
            wait_for(lambda n=number: sum(totals(node).values()) >= n, f"frame {number}")  # type: ignore[misc]
    assert totals(node) == {Fate.MAPPED: len(drive)}
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
    seen = {str(n) for f in drive if f.detections is not None for n in f.detections.names}
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


def test_it_is_cleared_on_request(
    graph: Graph, make_port: Callable[..., Any], drive: list[RgbdFrame]
) -> None:
    _, node = started(make_port)
    with other_node(graph) as other:
        robot = Robot(graph, other)
        for number, frame in enumerate(drive[:6], start=1):
            robot.show(frame)
            wait_for(lambda n=number: sum(totals(node).values()) >= n, f"frame {number}")  # type: ignore[misc]
    assert len(node) > 0
    answer = graph.call(f"{NODE}/clear")
    assert answer.success
    assert "forgotten" in answer.message
    assert len(node) == 0


def test_a_frame_without_tf_is_counted(
    graph: Graph, make_port: Callable[..., Any], drive: list[RgbdFrame]
) -> None:
    _, node = started(make_port, "tf_timeout:=0.05")
    with other_node(graph) as other:
        robot = Robot(graph, other)
        for topic, make in ((INFO, robot.info), (DETECTIONS, robot.detections)):
            robot.publishers[topic].publish(make(drive[0]))
        robot.publishers[DEPTH].publish(robot.depth(drive[0]))
        wait_for(lambda: totals(node).get(Fate.NO_TF) == 1, "the count")


def test_settings_that_do_not_go_together_end_the_start(
    graph: Graph, make_port: Callable[..., Any]
) -> None:
    with pytest.raises(HypermapError, match="cloud_topic"):
        started(make_port, "cloud_topic:=/points")
    assert graph.nodes == []


def test_pixels_are_not_lost_on_the_way(graph: Graph, drive: list[RgbdFrame]) -> None:
    robot = Robot.__new__(Robot)
    robot.types = graph.types
    message = robot.depth(drive[0])
    received = graph.types.from_cdr(graph.types.to_cdr(message), message.TYPE_NAME)
    depth = np.frombuffer(received.data, "<f4").reshape(drive[0].depth.shape)
    np.testing.assert_array_equal(depth, drive[0].depth)
