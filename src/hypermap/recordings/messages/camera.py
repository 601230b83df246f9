"""Intrinsics and lens distortion from `sensor_msgs/CameraInfo`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import FormatError
from hypermap.perception.frame import Camera
from hypermap.perception.lens import Lens
from hypermap.perception.rectification import Rectification


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
    if is_rectified and has_distortion(info):
        K = np.array(_field(info, "P"), dtype=float).reshape(3, 4)[:, :3]
    else:
        K = np.array(_field(info, "K"), dtype=float).reshape(3, 3)
    if (info.width, info.height) not in ((width, height), (0, 0)):
        K, size = _read_out(K, info)
        if size != (width, height):
            raise FormatError(
                f"the camera info is for images of {info.width} x {info.height} pixels, but the "
                f"depth images have {width} x {height}; choose another with --camera-info-topic, "
                "or give --intrinsics to `hypermap map`"
            )
    try:
        return Camera(K, width, height)
    except ValueError as error:
        raise FormatError(
            f"the camera info contains no calibration ({error}); calibrate the camera, or "
            "give --intrinsics to `hypermap map`"
        ) from None


def _read_out(K: NDArray[np.float64], info: Any) -> tuple[NDArray[np.float64], tuple[int, int]]:
    """Return intrinsics and size of images that show a part of the sensor, or its pixels binned.

    The size and intrinsics of a camera info are those of the whole sensor, as those of images that
    image_proc has cropped or decimated.

    Source: sensor_msgs/CameraInfo; PinholeCameraModel of image_geometry.
    """
    roi, columns, rows = info.roi, info.binning_x or 1, info.binning_y or 1
    width, height = (
        (roi.width, roi.height) if roi.width and roi.height else (info.width, info.height)
    )
    part = K - [[0, 0, roi.x_offset], [0, 0, roi.y_offset], [0, 0, 0]]
    return np.diag([1 / columns, 1 / rows, 1]) @ part, (width // columns, height // rows)


def has_distortion(info: Any) -> bool:
    """Return whether the camera's lens has distortion."""
    return bool(np.any(np.asarray(_field(info, "D"), dtype=float)))


def rectification_of_info(
    info: Any, width: int, height: int, is_rectified: bool
) -> tuple[Rectification | None, str]:
    """Return how to rectify the images that a camera info describes, and a sentence on it.

    The result is that of ROS's image_proc: the camera has the intrinsics of `P`, if it has any. But
    it looks where the real one does: `R`, which turns those of a stereo camera, is not applied.

    Args:
        info: the message.
        width: columns of the images.
        height: rows of the images.
        is_rectified: whether the images are rectified.

    Returns:
        None and an empty sentence where there is nothing to do; None and the reason where the
        distortion cannot be corrected.

    Raises:
        FormatError: As `camera_of_info`.
    """
    if is_rectified or not has_distortion(info):
        return None, ""
    raw = camera_of_info(info, width, height, is_rectified=False)
    try:
        lens = Lens(str(info.distortion_model), tuple(map(float, _field(info, "D"))))
    except ValueError as error:
        return None, f"the lens distortion in the camera info is not corrected: {error}"
    P = np.array(_field(info, "P"), dtype=float)
    has_own = P.shape == (12,) and P[0] > 0 and P[5] > 0
    camera = camera_of_info(info, width, height, is_rectified=True) if has_own else raw
    said = f"the images are rectified: the camera info has lens distortion ({lens.model})"
    return Rectification(lens, raw, camera), said


def _field(info: Any, name: str) -> Any:
    """Return a field that is in capitals in ROS 1 but not in ROS 2."""
    return getattr(info, name) if hasattr(info, name) else getattr(info, name.lower())
