"""A robot that drives through the demo's room, as nodes of ROS 2 publish what it sees.

As a program, `ros2_robot.py FRAMES PERIOD`, it is such a node.
"""

from __future__ import annotations

import array
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from itertools import islice
from typing import Any

from scipy.spatial.transform import Rotation

from hypermap.perception.frame import RgbdFrame
from hypermap.simulation import SimulatedRecording, demo_world

CAMERA = "camera_optical_frame"
TYPES = {
    "/camera/depth/image_rect": "sensor_msgs/Image",
    "/camera/depth/camera_info": "sensor_msgs/CameraInfo",
    "/detections": "vision_msgs/Detection2DArray",
    "/tf": "tf2_msgs/TFMessage",
}
DEPTH, INFO, DETECTIONS, TF = TYPES


def drive(count: int) -> list[RgbdFrame]:
    """The beginning of a drive through the room."""
    frames = islice(SimulatedRecording(demo_world(), rate=1.0).frames(), count)
    return [replace(f, stamp=f.stamp + 1.6e9, color_stamp=f.stamp + 1.6e9) for f in frames]


class Robot:
    """A camera, its detector and its pose.

    Args:
        message: returns the class of a message.
        publisher: makes a publisher of a topic with messages of a class; best effort, if it says
            so, and reliable otherwise.
    """

    def __init__(
        self, message: Callable[[str], Any], publisher: Callable[[str, Any, bool], Any]
    ) -> None:
        self.message = message
        self.publishers = {
            topic: publisher(topic, message(kind), topic in (DEPTH, INFO))
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
        made = self.message(TYPES[DEPTH])(
            height=height, width=width, encoding="32FC1", step=4 * width, data=data
        )
        return self.header(made, frame)

    def info(self, frame: RgbdFrame) -> Any:
        height, width = frame.depth.shape
        made = self.message(TYPES[INFO])(height=height, width=width)
        made.k = frame.camera.K.ravel().astype(float)
        return self.header(made, frame)

    def detections(self, frame: RgbdFrame) -> Any:
        made = self.header(self.message(TYPES[DETECTIONS])(), frame)
        found = frame.detections
        assert found is not None
        for box, name, score in zip(found.xyxy.tolist(), found.names, found.scores, strict=True):
            item = self.message("vision_msgs/Detection2D")()
            item.bbox.center.position.x = (box[0] + box[2]) / 2
            item.bbox.center.position.y = (box[1] + box[3]) / 2
            item.bbox.size_x, item.bbox.size_y = box[2] - box[0], box[3] - box[1]
            best = self.message("vision_msgs/ObjectHypothesisWithPose")()
            best.hypothesis.class_id, best.hypothesis.score = str(name), float(score)
            item.results = [best]
            made.detections.append(item)
        return made

    def tf(self, frame: RgbdFrame) -> Any:
        made = self.message("geometry_msgs/TransformStamped")(child_frame_id=CAMERA)
        self.header(made, frame, "map")
        p, q = made.transform.translation, made.transform.rotation
        p.x, p.y, p.z = frame.map_T_camera[:3, 3].tolist()
        q.x, q.y, q.z, q.w = Rotation.from_matrix(frame.map_T_camera[:3, :3]).as_quat().tolist()
        return self.message(TYPES[TF])(transforms=[made])


def main() -> None:
    import rclpy
    from rclpy.qos import QoSProfile, ReliabilityPolicy

    from hypermap.ros.ros2.messages import message_class

    def publisher(topic: str, kind: Any, is_best_effort: bool) -> Any:
        policies = ReliabilityPolicy
        chosen = policies.BEST_EFFORT if is_best_effort else policies.RELIABLE
        return node.create_publisher(kind, topic, QoSProfile(depth=100, reliability=chosen))

    rclpy.init()
    node = rclpy.create_node("robot")
    robot = Robot(message_class, publisher)
    while not all(made.get_subscription_count() for made in robot.publishers.values()):
        time.sleep(0.1)
    for frame in drive(int(sys.argv[1])):
        robot.show(frame)
        time.sleep(float(sys.argv[2]))
    rclpy.shutdown()


if __name__ == "__main__":
    main()
