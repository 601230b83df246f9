"""Decodes a bag's image and cloud messages into the arrays of a frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import FormatError
from hypermap.perception.frame import Camera
from hypermap.recordings.bag.file import Topic
from hypermap.recordings.bag.topics import CLOUD, COMPRESSED
from hypermap.recordings.messages.clouds import points_of_cloud
from hypermap.recordings.messages.compressed_depth import depth_of_compressed
from hypermap.recordings.messages.images import (
    color_of_compressed,
    color_of_image,
    depth_of_image,
)


@dataclass(frozen=True, eq=False)
class Geometry:
    """The content of a depth image or a cloud; for the fields, see `RgbdFrame`."""

    depth: NDArray[np.float32]
    cloud: NDArray[np.float32] | None = None
    color: NDArray[np.uint8] | None = None

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows."""
        return self.depth.shape[1], self.depth.shape[0]


def decode_geometry(topic: Topic, message: Any, units_per_meter: float) -> Geometry:
    """Return the depth in a message of any kind.

    Raises:
        FormatError: If the message has no depth, or is damaged.
    """
    if topic.type == CLOUD:
        points, color = points_of_cloud(message)
        return Geometry(points[..., 2].copy(), points, color)
    if topic.type == COMPRESSED:
        return Geometry(depth_of_compressed(message, units_per_meter))
    return Geometry(depth_of_image(message, units_per_meter))


def decode_color(topic: Topic, message: Any) -> NDArray[np.uint8]:
    """Return the color image in a message, RGB, uint8, shape (H, W, 3).

    Raises:
        FormatError: If the message has no color that can be read, or is damaged.
    """
    return color_of_compressed(message) if topic.type == COMPRESSED else color_of_image(message)


def check_depth(geometry: Geometry, camera: Camera) -> None:
    """Raise a FormatError unless a frame's depth has the size of the camera's images."""
    if geometry.size != (camera.width, camera.height):
        raise FormatError(
            f"the depth image has {geometry.size[0]} x {geometry.size[1]} pixels, but the "
            f"first one has {camera.width} x {camera.height}"
        )


def check_color(
    color: NDArray[np.uint8], size: tuple[int, int], topic: Topic, depth_topic: Topic
) -> None:
    """Raise a FormatError unless a color image has the columns and rows of the frames."""
    height, width, _ = color.shape
    if (width, height) != size:
        raise FormatError(
            f"color images on {topic.name} have {width} x {height} pixels, "
            f"but depth images on {depth_topic.name} have {size[0]} x {size[1]}; record depth "
            "that is registered to color, give --register, or choose other topics with "
            "--depth-topic and --color-topic"
        )
