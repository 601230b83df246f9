"""A frame that is turned about the optical axis shows the same points of the map."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from hypermap.core.trajectory import pose_from_rpy
from hypermap.perception.detections import Detections
from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.perception.turning import turned

CAMERA = Camera.from_intrinsics(30, 31, 14.0, 8.5, width=32, height=20)


def made() -> RgbdFrame:
    rng = np.random.default_rng(3)
    depth = rng.uniform(1, 4, (20, 32)).astype(np.float32)
    color = rng.integers(0, 256, (20, 32, 3), dtype=np.uint8)
    masks = np.zeros((1, 20, 32), dtype=bool)
    masks[0, 3:9, 5:17] = True
    found = Detections.of([[5, 3, 17, 9]], ["cup"], [0.9], masks)
    pose = pose_from_rpy(1, 2, 3, 0.3, -0.4, 2)
    frame = RgbdFrame(1.0, depth, CAMERA, pose, color, 1.0, found)
    return RgbdFrame(1.0, depth, CAMERA, pose, color, 1.0, found, cloud=frame.points())


@pytest.mark.parametrize("degrees", [90, 180, 270])
def test_every_pixel_keeps_its_place_in_the_map(degrees: int) -> None:
    old, new = made(), turned(made(), degrees)
    back = turned(new, 360 - degrees)
    np.testing.assert_array_equal(back.depth, old.depth)
    np.testing.assert_allclose(back.map_T_camera, old.map_T_camera, atol=1e-12)
    np.testing.assert_allclose(back.camera.K, old.camera.K)

    np.testing.assert_allclose(np.rot90(on_map(new), degrees // 90), on_map(old), atol=1e-5)


def on_map(frame: RgbdFrame) -> NDArray[np.float64]:
    """Where the points of a frame lie, by its depth; its cloud says the same."""
    points = RgbdFrame(0.0, frame.depth, frame.camera, frame.map_T_camera).points()
    assert frame.cloud is not None
    np.testing.assert_allclose(frame.cloud, points, atol=1e-5)
    return np.asarray(points @ frame.map_T_camera[:3, :3].T + frame.map_T_camera[:3, 3])


def test_what_was_up_is_to_the_right_after_a_quarter_turn_clockwise() -> None:
    old, new = made(), turned(made(), 90)
    np.testing.assert_array_equal(new.color[:, -1], old.color[0])
    assert new.detections is not None
    assert new.detections.masks is not None
    left, top, right, bottom = new.detections.xyxy[0].astype(int)
    assert new.detections.masks[0, top:bottom, left:right].all()
    assert new.detections.masks.sum() == (right - left) * (bottom - top)
    assert turned(old, 0) is old
