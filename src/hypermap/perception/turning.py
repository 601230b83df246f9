"""Frames rotated about the optical axis, for a camera mounted upside down or on its side.

Detectors expect objects to be upright. The camera of the rotated frame is rotated, too, so that all
points stay where they are in the map.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from hypermap.core.trajectory import compose
from hypermap.perception.detections import Detections
from hypermap.perception.frame import Camera, RgbdFrame

# From the camera's frame to that of a camera whose image is rotated clockwise by 90 degrees.
_OLD_T_NEW = np.array(
    [[0.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)

_SIGNS = np.array([-1.0, 1.0, 1.0], np.float32)  # x is minus what y was


def turned(frame: RgbdFrame, degrees: int) -> RgbdFrame:
    """Return a frame with its images rotated clockwise by a multiple of 90 degrees.

    Detections recorded with the frame are rotated, too.
    """
    for _ in range(degrees // 90 % 4):
        frame = _turned_once(frame)
    return frame


def _turned_once(frame: RgbdFrame) -> RgbdFrame:
    camera, cloud, found = frame.camera, frame.cloud, frame.detections
    K = camera.K
    new = Camera.from_intrinsics(
        K[1, 1], K[0, 0], camera.height - 1 - K[1, 2], K[0, 2], camera.height, camera.width
    )
    return RgbdFrame(
        stamp=frame.stamp,
        depth=_clockwise(frame.depth),
        camera=new,
        map_T_camera=compose(frame.map_T_camera, _OLD_T_NEW),
        color=None if frame.color_stamp is None else partial(_color, frame),
        color_stamp=frame.color_stamp,
        detections=None if found is None else _detections(found, camera.height),
        cloud=None if cloud is None else _clockwise(cloud)[..., [1, 0, 2]] * _SIGNS,
    )


def _clockwise(image: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.ascontiguousarray(np.rot90(image, -1))


def _color(frame: RgbdFrame) -> NDArray[np.uint8] | None:
    color = frame.color
    return None if color is None else np.ascontiguousarray(np.rot90(color, -1))


def _detections(found: Detections, height: int) -> Detections:
    left, top, right, bottom = found.xyxy.T
    xyxy = np.column_stack([height - bottom, left, height - top, right]).astype(found.xyxy.dtype)
    masks = None if found.masks is None else np.rot90(found.masks, -1, axes=(1, 2))
    return replace(found, xyxy=xyxy, masks=masks)
