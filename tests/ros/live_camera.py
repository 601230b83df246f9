"""A camera, its robot and its detector as ROS 1 messages, out of the frames of a recording."""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator
from typing import Any

import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation

from hypermap.perception.frame import RgbdFrame
from hypermap.ros.ros1.messages import message_class

FRAME = "camera_optical_frame"
DEPTH = "/camera/depth/image_rect"
COMPRESSED_DEPTH = f"{DEPTH}/compressedDepth"
INFO = "/camera/depth/camera_info"
CLOUD = "/camera/points"
COLOR = "/camera/color/image_raw"
COMPRESSED_COLOR = f"{COLOR}/compressed"
DARKNET = "/darknet_ros/bounding_boxes"
VISION = "/detections"
TF = "/tf"

TYPES = {
    DEPTH: "sensor_msgs/Image",
    COMPRESSED_DEPTH: "sensor_msgs/CompressedImage",
    INFO: "sensor_msgs/CameraInfo",
    CLOUD: "sensor_msgs/PointCloud2",
    COLOR: "sensor_msgs/Image",
    COMPRESSED_COLOR: "sensor_msgs/CompressedImage",
    DARKNET: "darknet_ros_msgs/BoundingBoxes",
    VISION: "vision_msgs/Detection2DArray",
    TF: "tf2_msgs/TFMessage",
}


def new(topic: str, stamp: float, frame_id: str = FRAME) -> Any:
    message = message_class(TYPES[topic])()
    message.header.stamp.secs, message.header.stamp.nsecs = divmod(round(stamp * 1e9), 10**9)
    message.header.frame_id = frame_id
    return message


def image(topic: str, pixels: np.ndarray, encoding: str, stamp: float) -> Any:
    message = new(topic, stamp)
    message.height, message.width = pixels.shape[:2]
    message.encoding, message.step = encoding, pixels[0].nbytes
    message.data = np.ascontiguousarray(pixels).tobytes()
    return message


def depth(frame: RgbdFrame) -> Any:
    return image(DEPTH, frame.depth, "32FC1", frame.stamp)


def compressed_depth(frame: RgbdFrame) -> Any:
    message = new(COMPRESSED_DEPTH, frame.stamp)
    message.format = "16UC1; compressedDepth"
    millimeters = np.round(np.nan_to_num(frame.depth) * 1000).astype(np.uint16)
    message.data = struct.pack("<iff", 0, 0, 0) + picture(millimeters, "png")
    return message


def cloud(frame: RgbdFrame) -> Any:
    message = new(CLOUD, frame.stamp)
    field = message_class("sensor_msgs/PointField")
    message.fields = [field(name, 4 * i, 7, 1) for i, name in enumerate("xyz")]
    points = frame.points()
    message.height, message.width = points.shape[:2]
    message.point_step, message.row_step = 12, 12 * points.shape[1]
    message.data = points.tobytes()
    return message


def camera_info(frame: RgbdFrame) -> Any:
    message = new(INFO, frame.stamp)
    message.height, message.width = frame.depth.shape
    message.K = frame.camera.K.ravel().tolist()
    return message


def color(frame: RgbdFrame) -> Any:
    return image(COLOR, frame.color, "rgb8", frame.color_stamp)


def compressed_color(frame: RgbdFrame) -> Any:
    message = new(COMPRESSED_COLOR, frame.color_stamp)
    message.format, message.data = "rgb8; png compressed", picture(frame.color, "png")
    return message


def darknet(frame: RgbdFrame) -> Any:
    """The detections with whole pixels, which is all that darknet_ros can say."""
    message = new(DARKNET, frame.stamp + 0.3)  # when the network was done
    message.image_header = new(DARKNET, frame.color_stamp).header
    for box, name, score in rows(frame):
        found = message_class("darknet_ros_msgs/BoundingBox")()
        found.xmin, found.ymin, found.xmax, found.ymax = (round(side) for side in box)
        found.Class, found.probability = name, score
        message.bounding_boxes.append(found)
    return message


def vision(frame: RgbdFrame, numbers: dict[str, int]) -> Any:
    """The detections; `vision_msgs` of ROS 1 names classes by number only."""
    message = new(VISION, frame.color_stamp)
    for (xmin, ymin, xmax, ymax), name, score in rows(frame):
        found = message_class("vision_msgs/Detection2D")()
        found.bbox.center.x, found.bbox.center.y = (xmin + xmax) / 2, (ymin + ymax) / 2
        found.bbox.size_x, found.bbox.size_y = xmax - xmin, ymax - ymin
        best = message_class("vision_msgs/ObjectHypothesisWithPose")()
        best.id, best.score = numbers[name], score
        found.results = [best]
        message.detections.append(found)
    return message


def rows(frame: RgbdFrame) -> Iterator[tuple[list[float], str, float]]:
    found = frame.detections
    assert found is not None
    yield from zip(found.xyxy.tolist(), found.names, found.scores.tolist(), strict=True)


def tf(frame: RgbdFrame, parent: str = "map") -> Any:
    transform = message_class("geometry_msgs/TransformStamped")()
    transform.header = new(DEPTH, frame.stamp, parent).header
    transform.child_frame_id = FRAME
    p, q = transform.transform.translation, transform.transform.rotation
    p.x, p.y, p.z = frame.map_T_camera[:3, 3].tolist()
    q.x, q.y, q.z, q.w = Rotation.from_matrix(frame.map_T_camera[:3, :3]).as_quat().tolist()
    return message_class(TYPES[TF])([transform])


def picture(pixels: np.ndarray, kind: str) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, kind, **({"compress_level": 1} if kind == "png" else {}))
    return buffer.getvalue()
