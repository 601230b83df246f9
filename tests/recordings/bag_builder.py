"""Writes real bags of every kind, with rosbags' writers."""

from __future__ import annotations

import io
import struct
from functools import cache
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from rosbags import rosbag1, rosbag2
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from .shots import HEIGHT, INTRINSICS, START, WIDTH, Shot

KINDS = ("ros1", "db3", "mcap")

IMAGE = "sensor_msgs/msg/Image"
COMPRESSED = "sensor_msgs/msg/CompressedImage"
CLOUD = "sensor_msgs/msg/PointCloud2"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
TF = "tf2_msgs/msg/TFMessage"
GRID = "nav_msgs/msg/OccupancyGrid"
DARKNET = "darknet_ros_msgs/msg/BoundingBoxes"
VISION = "vision_msgs/msg/Detection2DArray"

# The topics of `write_bag`
DEPTH = "/camera/depth_registered/image_raw"
INFO = "/camera/depth_registered/camera_info"
COLOR = "/camera/rgb/image_color"

_BOXES = {
    DARKNET: (
        "std_msgs/Header header\nstd_msgs/Header image_header\n"
        "darknet_ros_msgs/BoundingBox[] bounding_boxes"
    )
}
_BOX = "float64 probability\nint64 xmin\nint64 ymin\nint64 xmax\nint64 ymax\nint16 id\nstring "
ROS1_TYPES = {
    TF: "geometry_msgs/TransformStamped[] transforms",
    "darknet_ros_msgs/msg/BoundingBox": _BOX + "Class",
    **_BOXES,
    # vision_msgs 0.0.1
    "vision_msgs/msg/ObjectHypothesisWithPose": (
        "int64 id\nfloat64 score\ngeometry_msgs/PoseWithCovariance pose"
    ),
    "vision_msgs/msg/BoundingBox2D": "geometry_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y",
    "vision_msgs/msg/Detection2D": (
        "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
        "vision_msgs/BoundingBox2D bbox\nsensor_msgs/Image source_img"
    ),
    VISION: "std_msgs/Header header\nvision_msgs/Detection2D[] detections",
}
ROS2_TYPES = {
    "darknet_ros_msgs/msg/BoundingBox": _BOX + "class_id",
    **_BOXES,
    # vision_msgs 4
    "vision_msgs/msg/Point2D": "float64 x\nfloat64 y",
    "vision_msgs/msg/Pose2D": "vision_msgs/Point2D position\nfloat64 theta",
    "vision_msgs/msg/ObjectHypothesis": "string class_id\nfloat64 score",
    "vision_msgs/msg/ObjectHypothesisWithPose": (
        "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose"
    ),
    "vision_msgs/msg/BoundingBox2D": "vision_msgs/Pose2D center\nfloat64 size_x\nfloat64 size_y",
    "vision_msgs/msg/Detection2D": (
        "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\n"
        "vision_msgs/BoundingBox2D bbox\nstring id"
    ),
    VISION: "std_msgs/Header header\nvision_msgs/Detection2D[] detections",
}


@cache
def type_store(kind: str) -> Typestore:
    store = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.ROS2_HUMBLE)
    for name, text in (ROS1_TYPES if kind == "ros1" else ROS2_TYPES).items():
        store.register(get_types_from_msg(text, name))
    return store


def build(store: Typestore, name: str, values: dict[str, Any]) -> Any:
    """Return a message from nested dictionaries; what they leave out is zero or empty."""
    given = {key.lower(): value for key, value in values.items()}
    fields = {}
    for field, description in store.fielddefs[name][1]:
        fields[field] = _value(store, description, given.pop(field.lower(), None))
    assert not given, f"{name} has no {list(given)}"
    return store.types[name](**fields)


def _value(store: Typestore, description: Any, value: Any) -> Any:
    kind, detail = description
    if kind == Nodetype.BASE:
        if value is not None:
            return value
        return {"string": "", "bool": False}.get(detail[0], 0)
    if kind == Nodetype.NAME:
        return build(store, detail, value or {})
    (item_kind, item), size = detail
    if item_kind == Nodetype.NAME:
        return [build(store, item, element) for element in value or []]
    if item[0] == "string":
        return list(value or [])
    default = np.zeros(size if kind == Nodetype.ARRAY else 0)
    return np.asarray(default if value is None else value).astype(item[0])


class BagBuilder:
    """A bag, open within a `with`, to which messages are added as dictionaries."""

    def __init__(self, folder: Path, kind: str, name: str = "test") -> None:
        self.kind = kind
        self.path = folder / (f"{name}.bag" if kind == "ros1" else name)
        self.store = type_store(kind)
        self._connections: dict[str, Any] = {}
        if kind == "ros1":
            self._writer: Any = rosbag1.Writer(self.path)
        else:
            plugins = {"db3": rosbag2.StoragePlugin.SQLITE3, "mcap": rosbag2.StoragePlugin.MCAP}
            self._writer = rosbag2.Writer(self.path, version=8, storage_plugin=plugins[kind])

    def __enter__(self) -> BagBuilder:
        self._writer.open()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._writer.close()

    def add(
        self, topic: str, name: str, log_time: int, values: dict[str, Any], cut: int | None = None
    ) -> None:
        """Add a message, or only so many bytes of it."""
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(
                topic, name, typestore=self.store
            )
        message = build(self.store, name, values)
        serialize = self.store.serialize_ros1 if self.kind == "ros1" else self.store.serialize_cdr
        content = serialize(message, name)[:cut]
        self._writer.write(self._connections[topic], log_time, content)

    def add_tf(
        self,
        topic: str,
        stamp: int,
        parent: str,
        child: str,
        position: Any,
        quat_xyzw: Any = (0, 0, 0, 1),
        log_time: int | None = None,
    ) -> None:
        transform = {
            "header": header(stamp, parent),
            "child_frame_id": child,
            "transform": {
                "translation": dict(zip("xyz", map(float, position), strict=True)),
                "rotation": dict(zip("xyzw", map(float, quat_xyzw), strict=True)),
            },
        }
        time = stamp if log_time is None else log_time
        self.add(topic, TF, time, {"transforms": [transform]})


def header(stamp: int, frame: str = "camera") -> dict[str, Any]:
    return {"stamp": {"sec": stamp // 10**9, "nanosec": stamp % 10**9}, "frame_id": frame}


def image(
    pixels: NDArray[Any], encoding: str, stamp: int, frame: str = "camera", padding: int = 0
) -> dict[str, Any]:
    rows = np.ascontiguousarray(pixels).view(np.uint8).reshape(len(pixels), -1)
    rows = np.pad(rows, ((0, 0), (0, padding)), constant_values=99)
    return {
        "header": header(stamp, frame),
        "height": pixels.shape[0],
        "width": pixels.shape[1],
        "encoding": encoding,
        "is_bigendian": int(pixels.dtype.byteorder == ">"),
        "step": rows.shape[1],
        "data": rows.ravel(),
    }


def picture(pixels: NDArray[Any], kind: str = "png") -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, kind)
    return buffer.getvalue()


def compressed(content: bytes, kind: str, stamp: int, frame: str = "camera") -> dict[str, Any]:
    return {
        "header": header(stamp, frame),
        "format": kind,
        "data": np.frombuffer(content, np.uint8),
    }


def compressed_depth(pixels: NDArray[np.uint16], stamp: int) -> dict[str, Any]:
    content = struct.pack("<iff", 0, 0, 0) + picture(pixels)
    return compressed(content, "16UC1; compressedDepth png", stamp)


def camera_info(
    stamp: int, width: int = WIDTH, height: int = HEIGHT, distortion: Any = ()
) -> dict[str, Any]:
    fx, fy, cx, cy = INTRINSICS
    return {
        "header": header(stamp),
        "width": width,
        "height": height,
        "distortion_model": "plumb_bob",
        "D": distortion,
        "K": [fx, 0, cx, 0, fy, cy, 0, 0, 1],
    }


def grid(cells: list[int], frame: str = "map", width: int = 3) -> dict[str, Any]:
    half = np.sqrt(0.5)
    return {
        "header": header(START, frame),
        "info": {
            "resolution": 0.5,
            "width": width,
            "height": 2,
            "origin": {
                "position": {"x": 1.0, "y": 2.0},
                "orientation": {"z": half, "w": half},
            },
        },
        "data": cells,
    }


def add_poses(bag: BagBuilder, shots: list[Shot], *, root: str = "map", slash: str = "") -> None:
    """Add tf: the base moves in odom, odom stands in the map, the camera on the base."""
    for shot in shots:
        # The camera is 0.5 m above the base, whose axes it shares; odom is 1 m next to the map.
        base = shot.position - [0, 1, 0] - shot.map_T_camera[:3, 2] * -0.5
        bag.add_tf("/tf", shot.stamp, f"{slash}odom", f"{slash}base", base, shot.quat_xyzw)
    stamp = shots[0].stamp
    bag.add_tf("/tf_static", stamp, f"{slash}{root}", f"{slash}odom", (0, 1, 0))
    bag.add_tf("/tf_static", stamp, f"{slash}base", f"{slash}camera", (0, 0, -0.5))


def write_bag(folder: Path, kind: str, shots: list[Shot], **tf: str) -> Path:
    """Write the plainest complete bag: 16UC1 depth, rgb8, camera info, tf."""
    with BagBuilder(folder, kind) as bag:
        add_poses(bag, shots, **tf)
        for shot in shots:
            add_images(bag, shot)
    return bag.path


def add_images(bag: BagBuilder, shot: Shot) -> None:
    bag.add(DEPTH, IMAGE, shot.stamp, image(shot.depth_mm, "16UC1", shot.stamp))
    bag.add(INFO, CAMERA_INFO, shot.stamp, camera_info(shot.stamp))
    bag.add(COLOR, IMAGE, shot.color_stamp, image(shot.color, "rgb8", shot.color_stamp))
