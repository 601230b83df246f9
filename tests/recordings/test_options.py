from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from hypermap.core.errors import FormatError
from hypermap.recordings import RecordingOptions

TURNED = [0, -1, 0, 1, 1, 0, 0, 2, 0, 0, 1, 3, 0, 0, 0, 1]


def test_without_options_the_world_is_the_map_and_the_camera_unknown() -> None:
    options = RecordingOptions()
    np.testing.assert_array_equal(options.world_pose(), np.eye(4))
    assert options.camera(640, 480) is None


def test_six_numbers_and_the_matrix_say_the_same_pose() -> None:
    six = RecordingOptions(map_T_world=(1, 2, 3, 0, 0, math.pi / 2)).world_pose()
    matrix = RecordingOptions(map_T_world=TURNED).world_pose()
    assert six == pytest.approx(matrix)
    rows = [TURNED[i : i + 4] for i in range(0, 16, 4)]
    without_last = rows[:3], TURNED[:12]  # as KITTI and others write poses
    for given in (
        rows,
        np.array(rows),
        np.array(TURNED),
        np.array(rows, dtype=np.float32),
        *without_last,
    ):
        options = RecordingOptions(map_T_world=given)
        np.testing.assert_array_equal(options.world_pose(), matrix)
        assert options == RecordingOptions(map_T_world=TURNED)


def test_intrinsics_become_a_camera() -> None:
    camera = RecordingOptions(intrinsics=(500, 501, 320, 240)).camera(640, 480)
    assert camera is not None
    assert camera.K.tolist() == [[500, 0, 320], [0, 501, 240], [0, 0, 1]]
    assert (camera.width, camera.height) == (640, 480)


def test_intrinsics_of_another_image_size_are_refused() -> None:
    options = RecordingOptions(
        intrinsics=(600, 600, 599.5, 339.5), register=True, color_intrinsics=(500, 500, 320, 500)
    )
    assert options.camera(1200, 680) is not None
    for camera, flag in ((options.camera, "--intrinsics"), (options.color_camera, "--color-i")):
        with pytest.raises(
            FormatError, match=f"^{flag}.* is not on the images of 320 x 240 pixels"
        ):
            camera(320, 240)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (
            {"intrinsics": (1, 2, 3)},
            "intrinsics must be 4 numbers (fx, fy, cx, cy), got 3",
        ),
        (
            {"intrinsics": (1, math.nan, 3, 4)},
            "intrinsics must be finite numbers, got (1, nan, 3, 4)",
        ),
        (
            {"intrinsics": (10**400, 1, 3, 4)},
            f"intrinsics must be finite numbers, got ({10**400}, 1, 3, 4)",
        ),
        (
            {"map_T_world": [10**400] * 6},
            "map_T_world must be numbers: int too large to convert to float",
        ),
        ({"depth_scale": 10**400}, f"depth_scale must be positive, got {10**400}"),
        (
            {"intrinsics": (1, 0, 3, 4)},
            "intrinsics: the focal lengths must be positive, got (1, 0)",
        ),
        (
            {"intrinsics": (481.2, -480, 319.5, 239.5)},
            "intrinsics: the focal lengths must be positive, got (481.2, -480); a negative fy "
            "belongs to --pose-convention mirrored",
        ),
        (
            {"map_T_world": [0] * 7},
            "map_T_world must be 6 numbers (x, y, z, roll, pitch, yaw), 12 numbers (the rows of a "
            "3 x 4 matrix) or 16 numbers (the rows of a 4 x 4 matrix), got 7",
        ),
        (
            {"map_T_world": [2.0 * x for x in TURNED]},
            "the last row of the matrix is 0 0 0 2, not 0 0 0 1",
        ),
        (
            {"map_T_world": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1.5, -2, 0, 1]},  # by columns
            "the last row of the matrix is 1.5 -2 0 1, not 0 0 0 1; is it transposed?",
        ),
        (
            {"map_T_world": [1, 0, 0, 5, 0, 1, 0, 5, 0, 0, 1.1, 5]},
            "the matrix stretches by 1.1, 1, 1, so it is not a rotation",
        ),
        (
            {"map_T_world": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1]},  # a mirror
            "the matrix mirrors, so it is not a rotation",
        ),
        (
            {"map_T_world": np.eye(3)},
            "map_T_world must be a 3 x 4 or 4 x 4 matrix, got one of shape (3, 3)",
        ),
        (
            {"map_T_world": ["up", 2, 3, 4, 5, 6]},
            "map_T_world must be numbers: could not convert string to float: 'up'",
        ),
        (
            {"pose_convention": "robot"},
            "pose_convention must be one of optical, body, frd, opengl, world-to-camera, w-first, "
            "mirrored, got 'robot'",
        ),
        ({"depth_scale": 0}, "depth_scale must be positive, got 0"),
        ({"max_time_difference": -0.1}, "max_time_difference must be 0 .. 1 s, got -0.1"),
        ({"max_time_difference": 1.5}, "max_time_difference must be 0 .. 1 s, got 1.5"),
        ({"max_time_difference": math.nan}, "max_time_difference must be 0 .. 1 s, got nan"),
        ({"max_pose_gap": 0}, "max_pose_gap must be positive, got 0"),
        ({"every": 0}, "every must be at least 1, got 0"),
        ({"map_frame": ""}, "map_frame must be the name of a frame, got an empty string"),
    ],
)
def test_values_out_of_range_are_refused(values: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError) as caught:
        RecordingOptions(**values)
    assert str(caught.value) == message
