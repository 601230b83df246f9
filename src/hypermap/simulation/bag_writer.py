"""Writes a recording as a ROS 1 bag, as a robot with a depth camera would record it."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.spatial.transform import Rotation

from hypermap.core.errors import FileMissing, FormatError, HypermapError
from hypermap.core.occupancy import OccupancyLayer
from hypermap.formats.atomic import why_not_written
from hypermap.perception.detections import Detections
from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.perception.recording import Recording

CAMERA_FRAME = "camera_rgb_optical_frame"
DEPTH_TOPIC = "/camera/depth_registered/image_raw"
COLOR_TOPIC = "/camera/rgb/image_color"
CAMERA_INFO_TOPIC = "/camera/depth_registered/camera_info"
DETECTIONS_TOPIC = "/darknet_ros/bounding_boxes"
MAP_TOPIC = "/map"
_START = 1.0  # s; a simulated drive starts at 0, which is no time in ROS

# Source: darknet_ros_msgs 1.1 and tf2_msgs of ROS Noetic.
_TYPES = {
    "tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms",
    "darknet_ros_msgs/msg/BoundingBox": (
        "float64 probability\nint64 xmin\nint64 ymin\nint64 xmax\nint64 ymax\nint16 id\n"
        "string Class"
    ),
    "darknet_ros_msgs/msg/BoundingBoxes": (
        "std_msgs/Header header\nstd_msgs/Header image_header\n"
        "darknet_ros_msgs/BoundingBox[] bounding_boxes"
    ),
}


def write_bag(
    recording: Recording, path: str | Path, on_frame: Callable[[], None] = lambda: None
) -> None:
    """Write a recording as a bag that `hypermap map` and `rosbag play` can read.

    Topics: depth (32FC1) and color (rgb8) images, camera info, the camera's pose on `/tf`, the
    recording's own occupancy map, if it has one, on `/map`, and detections, if the frames have
    them, as `darknet_ros_msgs/BoundingBoxes`, whose boxes are whole pixels. A frame without a pose
    has none on `/tf`. Stamps are
    one second later, since ROS takes 0 for "no time". The file appears when it is complete, or not
    at all.

    Args:
        recording: what to write.
        path: a new file.
        on_frame: called after each frame.

    Raises:
        FormatError: If there is something at the path already.
        FileMissing: If its folder does not exist.
        HypermapError: If it cannot be written, as on a full disk.
    """
    path = Path(path)
    if path.exists():
        raise FormatError("it already exists; name a new file", path=path)
    if not path.parent.is_dir():
        raise FileMissing(f"{path.parent}: there is no such folder")
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with Writer(partial) as writer:
            bag = _Bag(writer)
            occupancy = recording.occupancy()
            for i, frame in enumerate(recording.frames()):
                if i == 0 and occupancy is not None:
                    bag.add_map(occupancy, frame.stamp)
                bag.add_frame(frame, recording.frame_id)
                on_frame()
        partial.replace(path)
    except HypermapError:
        raise  # FileMissing, which is an OSError too
    except OSError as error:
        raise HypermapError(f"{path}: cannot be written: {why_not_written(error)}") from error
    finally:
        partial.unlink(missing_ok=True)


class _Bag:
    """Adds messages to a bag that is open for writing."""

    def __init__(self, writer: Writer) -> None:
        self._writer = writer
        self._connections: dict[str, Any] = {}
        self._store = get_typestore(Stores.ROS1_NOETIC)
        for name, text in _TYPES.items():
            self._store.register(get_types_from_msg(text, name))
        self._types = self._store.types

    def add_frame(self, frame: RgbdFrame, frame_id: str) -> None:
        stamp = frame.stamp
        if np.isfinite(frame.map_T_camera).all():
            self._add("/tf", stamp, self._transforms(frame, frame_id))
        self._add(CAMERA_INFO_TOPIC, stamp, self._camera_info(frame.camera, stamp))
        depth = np.ascontiguousarray(frame.depth, dtype="<f4")
        self._add(DEPTH_TOPIC, stamp, self._image(depth, "32FC1", stamp))
        if frame.color is not None and frame.color_stamp is not None:
            color = self._image(frame.color, "rgb8", frame.color_stamp)
            self._add(COLOR_TOPIC, frame.color_stamp, color)
        if frame.detections is not None:
            boxes = self._boxes(frame.detections, frame.color_stamp or stamp)
            self._add(DETECTIONS_TOPIC, stamp, boxes)

    def add_map(self, layer: OccupancyLayer, stamp: float) -> None:
        if layer.grid is None or layer.cells is None:
            return
        grid, origin = layer.grid, layer.grid.origin
        info = self._new(
            "nav_msgs/msg/MapMetaData",
            map_load_time=self._time(stamp),
            resolution=grid.resolution,
            width=grid.width,
            height=grid.height,
            origin=self._new(
                "geometry_msgs/msg/Pose",
                position=self._new("geometry_msgs/msg/Point", x=origin.x, y=origin.y, z=0.0),
                orientation=self._quaternion(Rotation.from_euler("z", origin.yaw)),
            ),
        )
        cells = layer.cells.astype(np.int8).ravel()
        message = self._new(
            "nav_msgs/msg/OccupancyGrid",
            header=self._header(stamp, layer.frame_id),
            info=info,
            data=cells,
        )
        self._add(MAP_TOPIC, stamp, message, latching=1)

    def _add(self, topic: str, stamp: float, message: Any, latching: int | None = None) -> None:
        name = message.__msgtype__
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(
                topic, name, typestore=self._store, latching=latching
            )
        content = self._store.serialize_ros1(message, name)
        self._writer.write(self._connections[topic], _nanoseconds(stamp), content)

    def _transforms(self, frame: RgbdFrame, frame_id: str) -> Any:
        x, y, z = frame.map_T_camera[:3, 3].tolist()
        transform = self._new(
            "geometry_msgs/msg/Transform",
            translation=self._new("geometry_msgs/msg/Vector3", x=x, y=y, z=z),
            rotation=self._quaternion(Rotation.from_matrix(frame.map_T_camera[:3, :3])),
        )
        stamped = self._new(
            "geometry_msgs/msg/TransformStamped",
            header=self._header(frame.stamp, frame_id),
            child_frame_id=CAMERA_FRAME,
            transform=transform,
        )
        return self._new("tf2_msgs/msg/TFMessage", transforms=[stamped])

    def _camera_info(self, camera: Camera, stamp: float) -> Any:
        roi = self._new(
            "sensor_msgs/msg/RegionOfInterest",
            x_offset=0,
            y_offset=0,
            height=0,
            width=0,
            do_rectify=False,
        )
        return self._new(
            "sensor_msgs/msg/CameraInfo",
            header=self._header(stamp),
            height=camera.height,
            width=camera.width,
            distortion_model="plumb_bob",
            D=np.zeros(5),
            K=camera.K.ravel(),
            R=np.eye(3).ravel(),
            P=np.column_stack([camera.K, np.zeros(3)]).ravel(),
            binning_x=0,
            binning_y=0,
            roi=roi,
        )

    def _image(self, pixels: NDArray[Any], encoding: str, stamp: float) -> Any:
        data = np.ascontiguousarray(pixels).view(np.uint8).reshape(len(pixels), -1)
        return self._new(
            "sensor_msgs/msg/Image",
            header=self._header(stamp),
            height=pixels.shape[0],
            width=pixels.shape[1],
            encoding=encoding,
            is_bigendian=0,
            step=data.shape[1],
            data=data.ravel(),
        )

    def _boxes(self, detections: Detections, stamp: float) -> Any:
        boxes = [
            self._new(
                "darknet_ros_msgs/msg/BoundingBox",
                probability=float(score),
                xmin=round(xmin),
                ymin=round(ymin),
                xmax=round(xmax),
                ymax=round(ymax),
                id=0,
                Class=str(name),
            )
            for (xmin, ymin, xmax, ymax), name, score in zip(
                detections.xyxy.tolist(), detections.names, detections.scores, strict=True
            )
        ]
        header = self._header(stamp)
        return self._new(
            "darknet_ros_msgs/msg/BoundingBoxes",
            header=header,
            image_header=header,
            bounding_boxes=boxes,
        )

    def _header(self, stamp: float, frame_id: str = CAMERA_FRAME) -> Any:
        return self._new("std_msgs/msg/Header", seq=0, stamp=self._time(stamp), frame_id=frame_id)

    def _time(self, stamp: float) -> Any:
        sec, nanosec = divmod(_nanoseconds(stamp), 10**9)
        return self._new("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)

    def _quaternion(self, rotation: Rotation) -> Any:
        x, y, z, w = rotation.as_quat().tolist()
        return self._new("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)

    def _new(self, name: str, **fields: Any) -> Any:
        return self._types[name](**fields)


def _nanoseconds(stamp: float) -> int:
    return round((stamp + _START) * 1e9)
