from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from hypermap.perception.frame import Camera, RgbdFrame

CAMERA = Camera.from_intrinsics(fx=100, fy=200, cx=1.5, cy=0.5, width=4, height=2)


def test_a_pixel_lies_on_its_ray_at_its_depth() -> None:
    depth = np.array([[1, 2, 3, 4], [5, 6, np.nan, 8]], np.float32)
    points = RgbdFrame(0.0, depth, CAMERA, np.eye(4)).points()
    assert points.dtype == np.float32
    np.testing.assert_allclose(points[0, 0], [-1.5 / 100, -0.5 / 200, 1])
    np.testing.assert_allclose(points[1, 3], [1.5 / 100 * 8, 0.5 / 200 * 8, 8])
    assert np.isnan(points[1, 2]).all()


def test_a_recorded_cloud_is_kept() -> None:
    cloud = np.zeros((2, 4, 3), np.float32)
    frame = RgbdFrame(0.0, np.ones((2, 4), np.float32), CAMERA, np.eye(4), cloud=cloud)
    assert np.shares_memory(frame.points(), cloud)


@pytest.mark.parametrize("is_recorded", [False, True])
def test_some_of_the_points_are_those_of_all(is_recorded: bool) -> None:
    rng = np.random.default_rng(2)
    camera = Camera.from_intrinsics(90, 80, 7.3, 4.1, width=16, height=10)
    depth = rng.uniform(1, 2, (10, 16)).astype(np.float32)
    cloud = rng.uniform(1, 2, (10, 16, 3)).astype(np.float32) if is_recorded else None
    frame = RgbdFrame(0.0, depth, camera, np.eye(4), cloud=cloud)
    whole = frame.points()
    for step in (1, 2, 3):
        np.testing.assert_array_equal(frame.points(step), whole[::step, ::step])
    pixels = np.array([3, 15, 16, 159])
    np.testing.assert_array_equal(frame.points_of(pixels), whole.reshape(-1, 3)[pixels])
    np.testing.assert_array_equal(frame.z, whole[..., 2])


def test_color_may_be_made_when_it_is_read_and_is_made_once() -> None:
    calls = []

    def color() -> NDArray[np.uint8]:
        calls.append(1)
        return np.full((2, 4, 3), 7, np.uint8)

    frame = RgbdFrame(0.0, np.ones((2, 4), np.float32), CAMERA, np.eye(4), color)
    assert not calls
    assert frame.color is frame.color
    np.testing.assert_array_equal(frame.color, np.full((2, 4, 3), 7))
    assert len(calls) == 1
    assert RgbdFrame(0.0, np.ones((2, 4), np.float32), CAMERA, np.eye(4)).color is None


@pytest.mark.parametrize("step", [1, 2, 3])
@pytest.mark.parametrize("type_", [float, int])
def test_the_camera_of_every_nth_pixel_sees_the_same_points(step: int, type_: type) -> None:
    K = np.array([[90, 0, 7], [0, 80, 4], [0, 0, 1]], type_)
    camera = Camera(K, width=16, height=10)
    depth = np.random.default_rng(1).uniform(1, 2, (10, 16)).astype(np.float32)
    whole = RgbdFrame(0.0, depth, camera, np.eye(4)).points()[::step, ::step]
    thinned = RgbdFrame(0.0, depth[::step, ::step], camera.every(step), np.eye(4)).points()
    np.testing.assert_allclose(thinned, whole, rtol=1e-5)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"fx": 0.0}, "focal lengths must be positive, got 0.0, 200.0"),
        ({"width": 0}, "an image needs pixels, got 0 x 2"),
    ],
)
def test_an_impossible_camera_is_refused(change: dict[str, Any], message: str) -> None:
    arguments = {"fx": 100, "fy": 200, "cx": 1.5, "cy": 0.5, "width": 4, "height": 2, **change}
    with pytest.raises(ValueError) as error:
        Camera.from_intrinsics(**arguments)
    assert str(error.value) == message


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"depth": np.ones((4, 2), np.float32)}, "depth must have shape (2, 4), got (4, 2)"),
        ({"map_T_camera": np.eye(3)}, "map_T_camera must be 4 x 4, got (3, 3)"),
        (
            {"color": np.zeros((2, 4), np.uint8)},
            "color must have shape (2, 4, 3), got (2, 4)",
        ),
        (
            {"cloud": np.zeros((8, 3), np.float32)},
            "cloud must have shape (2, 4, 3), got (8, 3)",
        ),
        (
            {"depth": np.full((2, 4), 1000, np.uint16)},
            "depth must be meters as float32, got uint16",
        ),
        ({"depth": np.ones((2, 4), ">f4")}, "depth must be meters as float32, got >f4"),
        (
            {"cloud": np.ones((2, 4, 3), np.float16)},
            "cloud must be meters as float32, got float16",
        ),
    ],
)
def test_a_frame_whose_parts_do_not_fit_is_refused(change: dict[str, Any], message: str) -> None:
    parts: dict[str, Any] = {
        "stamp": 0.0,
        "depth": np.ones((2, 4), np.float32),
        "camera": CAMERA,
        "map_T_camera": np.eye(4),
        **change,
    }
    with pytest.raises(ValueError) as error:
        RgbdFrame(**parts)
    assert str(error.value) == message
