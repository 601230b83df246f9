"""Intrinsics from `sensor_msgs/CameraInfo`."""

from __future__ import annotations

from typing import Any

import numpy as np

from hypermap.core.errors import FormatError
from hypermap.perception.frame import Camera


def camera_of_info(info: Any, width: int, height: int, is_rectified: bool) -> Camera:
    """Return the camera of the images that a camera info describes.

    Args:
        info: the message, with `K` and `P` as in ROS 1 or `k` and `p` as in ROS 2.
        width: columns of the images.
        height: rows of the images.
        is_rectified: whether the images are rectified, so that `P` applies instead of `K`.

    Raises:
        FormatError: If the camera is not calibrated, or its images are of another size.
    """
    if (info.width, info.height) not in ((width, height), (0, 0)):
        raise FormatError(
            f"the camera info is for images of {info.width} x {info.height} pixels, but the depth "
            f"images have {width} x {height}; choose another with --camera-info-topic, or give "
            "--intrinsics to `hypermap map`"
        )
    if is_rectified and has_distortion(info):
        K = np.array(_field(info, "P"), dtype=float).reshape(3, 4)[:, :3]
    else:
        K = np.array(_field(info, "K"), dtype=float).reshape(3, 3)
    try:
        return Camera(K, width, height)
    except ValueError as error:
        raise FormatError(
            f"the camera info contains no calibration ({error}); calibrate the camera, or "
            "give --intrinsics to `hypermap map`"
        ) from None


def has_distortion(info: Any) -> bool:
    """Return whether the camera's lens has distortion."""
    return bool(np.any(np.asarray(_field(info, "D"), dtype=float)))


def _field(info: Any, name: str) -> Any:
    """Return a field that is in capitals in ROS 1 but not in ROS 2."""
    return getattr(info, name) if hasattr(info, name) else getattr(info, name.lower())
