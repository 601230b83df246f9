"""Absolute and relative errors of poses."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from hypermap.evaluation.pose_errors import PoseErrors, pose_errors


def pose(x: float, y: float, yaw_deg: float) -> NDArray[np.float64]:
    made = np.eye(4)
    c, s = math.cos(math.radians(yaw_deg)), math.sin(math.radians(yaw_deg))
    made[:2, :2] = (c, -s), (s, c)
    made[:2, 3] = x, y
    return made


def test_a_constant_error_is_absolute_and_not_relative() -> None:
    true = [pose(0.5 * k, 0, 10 * k) for k in range(5)]
    off = [pose(0.03, 0.04, 0) @ one for one in true]
    errors = pose_errors([0.5 * k for k in range(5)], off, true)
    assert errors.ate == pytest.approx(0.05)
    assert errors.rpe == pytest.approx(0, abs=1e-9)
    assert errors.ate_deg == pytest.approx(0, abs=1e-9)


def test_a_relative_error_is_between_poses_that_are_so_far_apart_in_time() -> None:
    stamps = [0.0, 0.4, 1.1, 1.3, 3.0]
    true = [pose(0, 0, 0)] * 5
    off = [pose(0, 0, 0), pose(0, 0, 2), pose(0, 0, 3), pose(0, 0, 3), pose(0, 0, 7)]
    errors = pose_errors(stamps, off, true)
    # 0 and 1.1 s, 0.4 and 3 s, 1.1 and 3 s, 1.3 and 3 s
    assert errors.rpe_deg == pytest.approx(math.sqrt(np.mean([9, 25, 16, 16])))
    assert errors.ate_deg == pytest.approx(math.sqrt(np.mean([0, 4, 9, 9, 49])))
    assert pose_errors(stamps, off, true, over=5).rpe is None


def test_half_a_turn_is_the_largest_angle() -> None:
    errors = pose_errors([0.0], [pose(0, 0, 180)], [pose(0, 0, 0)])
    assert errors.ate_deg == pytest.approx(180)
    assert errors.rpe is None


def test_no_poses_have_no_errors() -> None:
    assert pose_errors([], [], []) == PoseErrors(0, None, None, None, None)
