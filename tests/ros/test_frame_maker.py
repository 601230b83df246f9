"""The frames that a live node makes of its messages."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hypermap.perception.detections import Detections
from hypermap.ros.mapper.frames import FrameMaker
from hypermap.ros.mapper.settings import LiveSettings
from hypermap.ros.mapper.synchronizer import MatchedMessages

K = [131.25, 0.0, 79.5, 0.0, 131.25, 59.5, 0.0, 0.0, 1.0]


def depth_image() -> Any:
    """Each column is 1 cm farther away than the one left of it."""
    pixels = np.tile(1 + np.arange(160, dtype=np.float32) / 100, (120, 1))
    header = SimpleNamespace(frame_id="camera")
    data = pixels.view(np.uint8).ravel()
    return SimpleNamespace(
        header=header, height=120, width=160, encoding="32FC1", is_bigendian=0, step=640, data=data
    )


def info(model: str, *coefficients: float) -> Any:
    P = [*K[:3], 0.0, *K[3:6], 0.0, *K[6:], 0.0]
    D = [*coefficients]
    return SimpleNamespace(width=160, height=120, distortion_model=model, D=D, K=K, P=P)


@pytest.mark.parametrize(
    ("topic", "color", "model", "is_bent", "are_boxes", "said"),
    [
        ("/depth/image_raw", "", "plumb_bob", True, True, "the images are rectified"),
        ("/depth/image_rect", "", "plumb_bob", False, False, ""),
        ("/depth/image_rect", "/rgb/image_raw", "plumb_bob", False, True, "are rectified"),
        ("/depth/image_raw", "/rgb/image_rect", "plumb_bob", True, False, "are rectified"),
        ("/depth/image_raw", "", "wide", False, False, "is not corrected: the known models are"),
    ],
)
def test_raw_images_are_rectified_with_their_detections(
    topic: str, color: str, model: str, is_bent: bool, are_boxes: bool, said: str
) -> None:
    lines: list[str] = []
    settings = LiveSettings(depth_topic=topic, color_topic=color, detections_topic="/boxes")
    maker = FrameMaker(settings, lambda _, line: lines.append(line))
    maker.camera_info = info(model, -0.2, 0.0, 0.0, 0.0, 0.0)
    found = Detections.of([[0, 49.5, 20, 69.5]], ["cup"])
    for stamp in (1, 2):
        match = MatchedMessages(stamp, {"detections": found}, {"": stamp})
        frame = maker.frame(match, depth_image(), np.eye(4))
    assert len(lines) == (1 if said else 0)
    assert said in "".join(lines)
    assert frame.detections is not None
    # What is at x in the middle row of the rectified image, the lens shows at x (1 - 0.2 x²).
    x = (frame.detections.xyxy[0, 2] - 0.5 - 79.5) / 131.25
    shown = x * (1 - 0.2 * x * x) if are_boxes else x
    assert shown == pytest.approx((20 - 0.5 - 79.5) / 131.25, abs=1e-3)
    column = (frame.depth[59, 3] - 1) * 100  # of the raw image
    x = (3 - 79.5) / 131.25
    expected = x * (1 - 0.2 * x * x) * 131.25 + 79.5 if is_bent else 3
    assert column == pytest.approx(expected, abs=0.5)
