from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hypermap.core.errors import FormatError
from hypermap.perception.frame import Camera, RgbdFrame
from hypermap.recordings.messages.clouds import fit_camera, points_of_cloud

X, Y, Z, RGB = (("x", 7), ("y", 7), ("z", 7), ("rgb", 7))


def cloud(fields: list[tuple[str, int, int]], **changes: Any) -> SimpleNamespace:
    """A cloud of 2 x 3 points of 24 bytes in rows of 80 bytes, all zero but for changes."""
    values = {
        "height": 2,
        "width": 3,
        "fields": [SimpleNamespace(name=n, offset=o, datatype=d, count=1) for n, o, d in fields],
        "is_bigendian": False,
        "point_step": 24,
        "row_step": 80,
        "data": np.zeros(160, np.uint8),
    }
    return SimpleNamespace(**(values | changes))


@given(
    order=st.permutations(["x", "y", "z", "rgba", "intensity"]),
    kind=st.sampled_from([7, 8]),
    is_bigendian=st.booleans(),
    gap=st.integers(0, 5),
)
def test_fields_may_stand_in_any_order_at_any_place_of_any_type(
    order: list[str], kind: int, is_bigendian: bool, gap: int
) -> None:
    size = {7: 4, 8: 8}[kind]
    offsets, at = {}, gap
    for name in order:
        offsets[name] = at
        at += (4 if name == "rgba" else size) + gap
    sign = ">" if is_bigendian else "<"
    record = np.dtype(
        {
            "names": order,
            "formats": [sign + ("u4" if n == "rgba" else f"f{size}") for n in order],
            "offsets": [offsets[n] for n in order],
            "itemsize": at,
        }
    )
    points = np.zeros((2, 3), record)
    points["x"], points["y"], points["z"] = 1.5, -2.5, [[1, 2, 3], [4, 5, 6]]
    points["rgba"] = 0xFF_0A_14_1E
    row = np.frombuffer(points.tobytes(), np.uint8).reshape(2, -1)
    padded = np.pad(row, ((0, 0), (0, gap)))
    message = cloud(
        [(n, offsets[n], 6 if n == "rgba" else kind) for n in order],
        is_bigendian=is_bigendian,
        point_step=at,
        row_step=padded.shape[1],
        data=padded.ravel(),
    )
    xyz, color = points_of_cloud(message)
    assert xyz.dtype == np.float32
    assert xyz[1, 2].tolist() == [1.5, -2.5, 6]
    assert color is not None
    assert color[0, 0].tolist() == [10, 20, 30]


def test_points_that_are_no_return_are_nan_in_all_coordinates() -> None:
    data = np.zeros((2, 3, 3), np.float32)
    data[..., 2] = [[1, 0, -1], [np.nan, np.inf, 2]]
    data[1, 2, 0] = np.nan
    message = cloud(
        [("x", 0, 7), ("y", 4, 7), ("z", 8, 7)],
        point_step=12,
        row_step=36,
        data=np.frombuffer(data.tobytes(), np.uint8),
    )
    xyz, color = points_of_cloud(message)
    assert color is None
    assert xyz[0, 0].tolist() == [0, 0, 1]
    assert np.isnan(xyz.reshape(-1, 3)[1:]).all()


XYZ = [("x", 0, 7), ("y", 4, 7), ("z", 8, 7)]
BYTES = "the cloud's {} bytes do not hold 2 rows of {} bytes with 3 points of {} bytes"


@pytest.mark.parametrize(
    ("message", "text"),
    [
        (
            cloud(XYZ, height=1, width=6),
            "the cloud is not organized: it has 1 x 6 points, and its neighbors are unknown; "
            "record the camera's organized cloud or its depth image",
        ),
        (cloud(XYZ[:2]), "the cloud needs the fields x, y, z; found x, y"),
        (cloud([]), "the cloud needs the fields x, y, z; found none"),
        (cloud([*XYZ[:2], ("z", 8, 4)]), "field 'z' of the cloud is not a float"),
        (cloud([*XYZ[:2], ("z", 22, 7)]), BYTES.format(160, 80, 24)),
        (cloud(XYZ, row_step=60), BYTES.format(160, 60, 24)),
        (cloud(XYZ, data=np.zeros(159, np.uint8)), BYTES.format(159, 80, 24)),
    ],
)
def test_a_cloud_that_cannot_be_read_is_an_error(message: SimpleNamespace, text: str) -> None:
    with pytest.raises(FormatError) as caught:
        points_of_cloud(message)
    assert str(caught.value) == text


def seen_by(camera: Camera) -> np.ndarray:
    random = np.random.default_rng(3)
    depth = random.uniform(0.5, 4, (camera.height, camera.width)).astype(np.float32)
    depth[random.random(depth.shape) < 0.3] = np.nan
    return RgbdFrame(0.0, depth, camera, np.eye(4)).points()


@given(st.floats(10, 2000), st.floats(10, 2000), st.floats(-20, 60), st.floats(-20, 60))
def test_the_camera_is_found_again_from_what_it_saw(
    fx: float, fy: float, cx: float, cy: float
) -> None:
    camera = Camera.from_intrinsics(fx, fy, cx, cy, width=40, height=30)
    found = fit_camera(seen_by(camera))
    np.testing.assert_allclose(found.K, camera.K, rtol=1e-3, atol=0.05)
    assert (found.width, found.height) == (40, 30)


NO_CAMERA = (
    "the cloud does not come from a camera that looks along the z axis of its frame "
    "(x right, y down); give the intrinsics with --intrinsics if it does"
)


@pytest.mark.parametrize(
    ("points", "text"),
    [
        (
            np.full((4, 5, 3), np.nan, np.float32),
            "the cloud has too few points to find the camera's intrinsics",
        ),
        (np.random.default_rng(2).uniform(1, 2, (20, 20, 3)).astype(np.float32), NO_CAMERA),
        (
            # x forward, y left, z up, as on a robot's body
            seen_by(Camera.from_intrinsics(30, 30, 15, 10, 32, 24))[..., [2, 0, 1]] * [1, -1, -1]
            + np.float32([0, 0, 9]),
            NO_CAMERA,
        ),
        (
            seen_by(Camera.from_intrinsics(30, 30, 15, 10, 32, 24))[:, ::-1],  # mirrored
            NO_CAMERA,
        ),
    ],
)
def test_clouds_that_no_camera_saw_are_an_error(points: np.ndarray, text: str) -> None:
    with pytest.raises(FormatError) as caught:
        fit_camera(points)
    assert str(caught.value) == text
