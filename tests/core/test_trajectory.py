from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from hypermap.core.errors import FrameError
from hypermap.core.trajectory import (
    Trajectory,
    compose,
    invert,
    pose_from_rpy,
    pose_matrix,
    transform_points,
)
from hypermap.testing.strategies import angles, coordinates

HALF = math.sqrt(0.5)
LEFT = [0.0, 0.0, HALF, HALF]  # a quarter turn about z
STRAIGHT = [0.0, 0.0, 0.0, 1.0]

vectors = st.tuples(coordinates, coordinates, coordinates)
components = st.floats(-1, 1)
quats = st.tuples(components, components, components, components).filter(
    lambda q: math.hypot(*q) > 0.1
)
poses = st.builds(pose_matrix, vectors, quats)


@pytest.mark.parametrize(
    ("quat", "point", "expected"),
    [
        (STRAIGHT, (1, 2, 3), (1, 2, 3)),
        (LEFT, (1, 0, 0), (0, 1, 0)),
        (LEFT, (0, 1, 0), (-1, 0, 0)),
        ((HALF, 0, 0, HALF), (0, 1, 0), (0, 0, 1)),
        ((0, HALF, 0, HALF), (0, 0, 1), (1, 0, 0)),
        ((0, 0, 3, 3), (1, 0, 0), (0, 1, 0)),
        ((0, 0, 1e-200, 1e-200), (1, 0, 0), (0, 1, 0)),
        ((0, 0, 1e200, 1e200), (1, 0, 0), (0, 1, 0)),
    ],
)
def test_quaternions_turn_points(quat: Any, point: Any, expected: Any) -> None:
    turned = pose_matrix([5.0, 6.0, 7.0], quat) @ [*point, 1.0]
    np.testing.assert_allclose(turned[:3], np.add(expected, [5, 6, 7]), atol=1e-12)


@given(vectors, quats)
def test_a_pose_is_rigid(position: Any, quat: Any) -> None:
    pose = pose_matrix(position, quat)
    np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-12)
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1)
    np.testing.assert_array_equal(pose[:, 3], [*position, 1])
    np.testing.assert_array_equal(pose[3], [0, 0, 0, 1])


def test_one_position_serves_many_rotations_and_the_other_way_round() -> None:
    assert pose_matrix([1, 2, 3], np.tile(LEFT, (5, 1))).shape == (5, 4, 4)
    several = pose_matrix(np.arange(15.0).reshape(5, 3), LEFT)
    assert several.shape == (5, 4, 4)
    np.testing.assert_array_equal(several[4, :3, 3], [12, 13, 14])


@pytest.mark.parametrize(
    ("position", "quat", "message"),
    [
        ([0, 0, 0], [0, 0, 0, 0], "a quaternion must be finite and other than zero"),
        ([0, 0, 0], [0, 0, np.nan, 1], "a quaternion must be finite and other than zero"),
        ([0, 0, 0], [0, 0, np.inf, 1], "a quaternion must be finite and other than zero"),
        ([0, np.inf, 0], STRAIGHT, "a position must be finite"),
    ],
)
def test_what_is_no_pose_is_refused(position: Any, quat: Any, message: str) -> None:
    with pytest.raises(ValueError) as caught:
        pose_matrix(position, quat)
    assert str(caught.value) == message


@given(poses, poses, poses)
def test_composition_is_associative_and_inverts(a, b, c) -> None:
    np.testing.assert_allclose(compose(a, compose(b, c)), compose(compose(a, b), c), atol=1e-9)
    np.testing.assert_allclose(compose(a, invert(a)), np.eye(4), atol=1e-9)
    np.testing.assert_allclose(invert(compose(a, b)), compose(invert(b), invert(a)), atol=1e-9)


@given(coordinates, coordinates, coordinates, angles, angles, angles)
def test_roll_pitch_and_yaw_are_turns_about_the_fixed_axes(x, y, z, roll, pitch, yaw) -> None:
    def about(axis: int, angle: float) -> np.ndarray:
        quat = np.zeros(4)
        quat[axis], quat[3] = math.sin(angle / 2), math.cos(angle / 2)
        return pose_matrix([0, 0, 0], quat)

    expected = compose(pose_matrix([x, y, z], STRAIGHT), about(2, yaw), about(1, pitch),
                       about(0, roll))  # fmt: skip
    np.testing.assert_allclose(pose_from_rpy(x, y, z, roll, pitch, yaw), expected, atol=1e-9)


def test_points_are_turned_and_shifted() -> None:
    pose = pose_matrix([1.0, 0.0, 0.0], LEFT)
    image = np.array([[[1, 0, 0], [0, 1, 0]]], dtype=np.float32)
    moved = transform_points(pose, image)
    assert moved.dtype == np.float32
    np.testing.assert_allclose(moved, [[[1, 1, 0], [0, 0, 0]]], atol=1e-6)


def trajectory(**changes: Any) -> Trajectory:
    """Two seconds straight on along x, then a turn on the spot, then a long gap."""
    columns: dict[str, Any] = {
        "stamps": np.array([10.0, 12.0, 13.0, 30.0]),
        "positions": np.array([[0.0, 0, 0], [2.0, 0, 0], [2.0, 0, 0], [9.0, 0, 0]]),
        "quats_xyzw": np.array([STRAIGHT, STRAIGHT, LEFT, LEFT]),
        "max_gap": 5.0,
    }
    return Trajectory(**{**columns, **changes})


@pytest.mark.parametrize(
    ("stamp", "x", "yaw_deg"),
    [(10, 0, 0), (11, 1, 0), (11.5, 1.5, 0), (12, 2, 0), (12.5, 2, 45), (12.9, 2, 81), (13, 2, 90),
     (30, 9, 90)],
)  # fmt: skip
def test_poses_between_two_are_interpolated(stamp: float, x: float, yaw_deg: float) -> None:
    (pose,) = trajectory().at(stamp)
    expected = pose_from_rpy(x, 0, 0, 0, 0, math.radians(yaw_deg))
    np.testing.assert_allclose(pose, expected, atol=1e-12)


def test_the_shorter_way_round_is_taken_whatever_the_sign_of_a_quaternion() -> None:
    flipped = trajectory(quats_xyzw=np.array([STRAIGHT, STRAIGHT, np.negative(LEFT), LEFT]))
    np.testing.assert_allclose(flipped.at(12.5), trajectory().at(12.5), atol=1e-12)


@given(quats, st.floats(0, 1e-5), st.floats(0, 1))
def test_nearly_equal_rotations_are_interpolated_smoothly(quat, step, weight) -> None:
    other = np.array(quat) + np.array([step, -step, 0, step])
    assume(np.linalg.norm(other) > 0.05)
    path = Trajectory(np.array([0.0, 1.0]), np.zeros((2, 3)), np.array([quat, other]))
    start, between, end = path.at([0.0, weight, 1.0])
    assert np.abs(between - start).max() <= np.abs(end - start).max() * (1 + 1e-6) + 1e-9


def test_the_trajectory_knows_where_it_can_answer() -> None:
    stamps = [9.9, 10, 12.7, 13, 13.1, 29, 30, 30.1, np.nan]
    expected = [False, True, True, True, False, False, True, False, False]
    assert trajectory().covers(stamps).tolist() == expected


def test_stamps_that_were_rounded_to_microseconds_are_covered() -> None:
    stamps = [1 / 6, 1 / 3, 5 + 1 / 6, 5 + 1 / 3]  # of which the first is rounded up
    rounded = Trajectory(
        np.round(stamps, 6), np.arange(12.0).reshape(4, 3), np.array([STRAIGHT] * 4), max_gap=1.0
    )
    assert rounded.covers(stamps).all()
    np.testing.assert_allclose(rounded.at(stamps)[:, 0, 3], [0, 3, 6, 9], atol=1e-5)


@pytest.mark.parametrize("stamp", [9.9, 13.1, 30.1, np.nan])
def test_no_pose_is_made_up(stamp: float) -> None:
    with pytest.raises(FrameError) as caught:
        trajectory().at([11.0, stamp])
    assert str(caught.value) == (
        f"no pose at {stamp:.6f} s: poses reach from 10.000000 to 30.000000 s (gaps up to 5 s are "
        "bridged)"
    )


def test_a_single_pose_holds_at_its_stamp() -> None:
    alone = Trajectory(np.array([1.0]), np.array([[1.0, 2, 3]]), np.array([STRAIGHT]))
    assert alone.covers([0.9, 1.0, 1.1]).tolist() == [False, True, False]
    np.testing.assert_array_equal(alone.at([1.0, 1.0])[1, :3, 3], [1, 2, 3])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"stamps": np.empty(0)}, "a trajectory needs at least one pose"),
        ({"stamps": np.zeros((2, 2))}, "expected stamps of shape (N,), got (2, 2)"),
        ({"stamps": np.array([10.0, 12, 12, 13])}, "the stamps of a trajectory must increase"),
        ({"stamps": np.array([10.0, 12, 11, 13])}, "the stamps of a trajectory must increase"),
        ({"stamps": np.array([10.0, 12, np.nan, 13])},
         "stamps and positions of a trajectory must be finite"),
        ({"positions": np.full((4, 3), np.inf)},
         "stamps and positions of a trajectory must be finite"),
        ({"positions": np.zeros((3, 3))},
         "expected positions (4, 3) and quaternions (4, 4), got (3, 3) and (4, 4)"),
        ({"quats_xyzw": np.zeros((4, 4))}, "a quaternion must be finite and other than zero"),
    ],
)  # fmt: skip
def test_what_is_no_trajectory_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError) as caught:
        trajectory(**changes)
    assert str(caught.value) == message
