"""What the functions of recordings make of messages that rospy has received."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pytest
from PIL import Image

from hypermap.core.errors import FormatError
from hypermap.core.frames import FrameTree, Pose2D, Transform
from hypermap.core.hypermap import Hypermap
from hypermap.core.semantic import SemanticLayer
from hypermap.recordings.messages.camera import camera_of_info
from hypermap.recordings.messages.clouds import points_of_cloud
from hypermap.recordings.messages.compressed_depth import depth_of_compressed
from hypermap.recordings.messages.header import nanoseconds
from hypermap.recordings.messages.images import color_of_compressed, color_of_image, depth_of_image
from hypermap.recordings.messages.occupancy import occupancy_of_grid
from hypermap.recordings.messages.transforms import TransformLog
from hypermap.ros.messages.to_messages import layer_transforms
from hypermap.testing.builders import occupancy_from_text

from .message_builder import NAN


def sensor(types: Any, name: str, **fields: Any) -> Any:
    message = types.message(f"sensor_msgs/{name}")(**fields)
    message.header.stamp = types.stamp(1_700_000_000_000_000_123)
    got = types.sent(message)
    assert nanoseconds(got.header.stamp) == 1_700_000_000_000_000_123
    return got


def octets(types: Any, array: Any) -> Any:
    """Return bytes as a publisher fills them in."""
    content = array if isinstance(array, bytes) else np.ascontiguousarray(array).tobytes()
    return np.frombuffer(content, np.uint8) if hasattr(types, "_decode") else content


def test_images_are_read(types: Any) -> None:
    depth = np.array([[1000, 0], [250, 500]], np.uint16)
    got = sensor(
        types, "Image", height=2, width=2, encoding="16UC1", step=4, data=octets(types, depth)
    )
    assert np.array_equal(
        depth_of_image(got, 1000.0), np.float32([[1, NAN], [0.25, 0.5]]), equal_nan=True
    )
    rgb = np.arange(12, dtype=np.uint8).reshape(2, 2, 3)
    got = sensor(
        types, "Image", height=2, width=2, encoding="rgb8", step=6, data=octets(types, rgb)
    )
    assert np.array_equal(color_of_image(got), rgb)


def test_compressed_images_are_read(types: Any) -> None:
    rgb = np.arange(12, dtype=np.uint8).reshape(2, 2, 3)
    png = io.BytesIO()
    Image.fromarray(rgb).save(png, "PNG")
    got = sensor(types, "CompressedImage", format="png", data=octets(types, png.getvalue()))
    assert np.array_equal(color_of_compressed(got), rgb)
    png = io.BytesIO()
    Image.fromarray(np.array([[1000, 2000]], np.uint16)).save(png, "PNG")
    got = sensor(
        types,
        "CompressedImage",
        format="16UC1; compressedDepth png",
        data=octets(types, bytes(12) + png.getvalue()),
    )
    assert depth_of_compressed(got, 1000.0).tolist() == [[1.0, 2.0]]


def test_clouds_are_read(types: Any) -> None:
    xyz = np.arange(1, 13, dtype=np.float32).reshape(2, 2, 3)
    part = types.message("sensor_msgs/PointField")
    fields = [part(name=n, offset=4 * i, datatype=7, count=1) for i, n in enumerate("xyz")]
    got = sensor(
        types,
        "PointCloud2",
        height=2,
        width=2,
        fields=fields,
        point_step=12,
        row_step=24,
        data=octets(types, xyz),
    )
    points, color = points_of_cloud(got)
    assert np.array_equal(points, xyz)
    assert color is None


def test_a_camera_info_is_read_however_its_fields_are_spelled(types: Any) -> None:
    message = types.message("sensor_msgs/CameraInfo")(width=320, height=240)
    K = np.array([300.0, 0, 160, 0, 310, 120, 0, 0, 1])
    setattr(message, "K" if hasattr(message, "K") else "k", K)
    camera = camera_of_info(types.sent(message), 320, 240, is_rectified=False)
    assert np.array_equal(camera.K.ravel(), K)


def test_transforms_are_read(types: Any) -> None:
    tree = FrameTree([Transform("map", "lab", Pose2D(1, 2, 0.5))])
    hypermap = Hypermap([occupancy_from_text("."), SemanticLayer("s", "lab")], tree)
    message = types.message("tf2_msgs/TFMessage")(transforms=layer_transforms(hypermap, types, 5))
    log = TransformLog()
    log.add(types.sent(message), is_static=True)
    frames, notes = log.frames(1.0)
    assert notes == []
    (map_T_lab,) = frames.motion("map", "lab").at([0.0])
    assert map_T_lab[:2, 3].tolist() == [1, 2]


def test_a_grid_of_integers_out_of_range_is_refused(types: Any) -> None:
    message = types.message("nav_msgs/OccupancyGrid")(data=np.array([0, 101], np.int8))
    message.info.width, message.info.height, message.info.resolution = 2, 1, 0.05
    message.info.origin.orientation.w = 1.0
    with pytest.raises(FormatError, match=r"must be -1 to 100, found 0 to 101"):
        occupancy_of_grid(types.sent(message))
