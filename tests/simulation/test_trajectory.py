"""A drive along waypoints, with times and poses worked out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hypermap.simulation.trajectory import DrivePlan, camera_poses, planar_poses


def test_it_drives_at_its_speed_and_turns_on_the_spot() -> None:
    # 1 m at 0.5 m/s, 90 degrees at 45 degrees/s, 0.5 m, then a look back by 180 - 90 degrees.
    drive = DrivePlan(((0, 0), (1, 0), (1, 0.5, 180)), speed=0.5, turn_rate_deg=45)
    stamps, poses = planar_poses(drive, rate=1)
    assert stamps.tolist() == [0, 1, 2, 3, 4, 5, 6, 7]
    assert poses[:, :2] == pytest.approx(
        np.array([[0, 0], [0.5, 0], [1, 0], [1, 0], [1, 0], [1, 0.5], [1, 0.5], [1, 0.5]])
    )
    assert np.degrees(poses[:, 2]) == pytest.approx([0, 0, 0, 45, 90, 90, 135, 180])


def test_it_turns_the_shorter_way_round_and_the_yaw_never_jumps() -> None:
    drive = DrivePlan(((0, 0, 170), (0, 0, -170), (0, 0, 170)), turn_rate_deg=10)
    _, poses = planar_poses(drive, rate=1)
    assert np.degrees(poses[:, 2]) == pytest.approx([170, 180, 190, 180, 170])


def test_it_starts_looking_at_the_second_waypoint() -> None:
    _, poses = planar_poses(DrivePlan(((0, 0), (0, 0), (0, 2))), rate=1)
    assert poses[0, 2] == pytest.approx(math.pi / 2)


def test_a_single_waypoint_is_one_pose() -> None:
    stamps, poses = planar_poses(DrivePlan(((1, 2),)), rate=3)
    assert (stamps.tolist(), poses.tolist()) == ([0], [[1, 2, 0]])


@pytest.mark.parametrize("rate", [0, -1, math.nan, math.inf])
def test_a_rate_that_is_not_positive_is_refused(rate: float) -> None:
    with pytest.raises(ValueError, match="the rate must be a positive number, got"):
        planar_poses(DrivePlan(((0, 0),)), rate)


def test_the_optical_frame_of_a_level_camera_looking_along_x() -> None:
    (pose,) = camera_poses([[2, 3, 0]], DrivePlan(((0, 0),), camera_height=1.5, pitch_deg=0))
    # Columns: right is -y of the map, down is -z, forward is x.
    assert pose == pytest.approx(
        np.array([[0, 0, 1, 2], [-1, 0, 0, 3], [0, -1, 0, 1.5], [0, 0, 0, 1]])
    )


def test_a_camera_pitched_down_sees_the_floor_at_the_right_distance() -> None:
    drive = DrivePlan(((0, 0),), camera_height=1.0, pitch_deg=45)
    (pose,) = camera_poses([[0, 0, math.pi / 2]], drive)
    # Along the optical axis at 45 degrees the floor is reached 1 m ahead, sqrt(2) m away.
    assert pose @ [0, 0, math.sqrt(2), 1] == pytest.approx([0, 1, 0, 1])


@given(st.floats(-10, 10), st.floats(-80, 80))
def test_a_camera_pose_is_a_rotation_and_the_image_is_not_tilted(yaw: float, pitch: float) -> None:
    (pose,) = camera_poses([[0, 0, yaw]], DrivePlan(((0, 0),), pitch_deg=pitch))
    rotation = pose[:3, :3]
    assert rotation.T @ rotation == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1)
    assert rotation[2, 0] == 0  # the image's x axis is level
    assert rotation[2, 1] < 0  # and its y axis points down


waypoints = st.lists(st.tuples(*[st.integers(-5, 5)] * 2), min_size=1, max_size=6)


@given(waypoints, st.floats(1, 20))
def test_neither_speed_nor_turn_rate_is_ever_exceeded(
    points: list[tuple[int, int]], rate: float
) -> None:
    drive = DrivePlan(tuple(points), speed=0.5, turn_rate_deg=45)
    stamps, poses = planar_poses(drive, rate)
    steps = np.diff(poses, axis=0)
    assert np.diff(stamps) == pytest.approx(1 / rate)
    assert (np.hypot(steps[:, 0], steps[:, 1]) <= 0.5 / rate + 1e-9).all()
    assert (np.abs(steps[:, 2]) <= math.radians(45) / rate + 1e-9).all()
