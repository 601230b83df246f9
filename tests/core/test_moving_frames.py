from __future__ import annotations

import math

import numpy as np
import pytest

from hypermap.core.errors import FrameError
from hypermap.core.moving_frames import FixedPose, MovingFrames
from hypermap.core.trajectory import Trajectory, compose, invert, pose_from_rpy


def drive() -> Trajectory:
    """From x = 0 to x = 10 within ten seconds, turning left by 90 degrees."""
    half = math.sqrt(0.5)
    return Trajectory(
        stamps=np.array([0.0, 10.0]),
        positions=np.array([[0.0, 0, 0], [10.0, 0, 0]]),
        quats_xyzw=np.array([[0.0, 0, 0, 1], [0, 0, half, half]]),
    )


def robot() -> MovingFrames:
    return MovingFrames(
        {
            "base": ("map", drive()),
            "camera": ("base", FixedPose(pose_from_rpy(0.5, 0, 1, 0, 0, 0))),
            "laser": ("base", FixedPose(pose_from_rpy(0, 0, 0.2, 0, 0, 0))),
            "shelf": ("warehouse", FixedPose(np.eye(4))),
        }
    )


def test_a_pose_is_chained_from_the_camera_up_to_the_map() -> None:
    start, end = robot().motion("map", "camera").at([0.0, 10.0])
    assert start[:3, 3] == pytest.approx([0.5, 0, 1])
    assert end[:3, 3] == pytest.approx([10, 0.5, 1])  # the camera swings to the left
    assert end[:3, 0] == pytest.approx([0, 1, 0])


def test_the_edges_between_two_frames_leave_out_what_lies_above_both() -> None:
    assert set(robot().edges_between("camera", "laser")) == {("base", "camera"), ("base", "laser")}
    assert set(robot().edges_between("map", "laser")) == {("map", "base"), ("base", "laser")}
    assert robot().edges_between("base", "base") == {}


def test_two_branches_meet_at_their_common_frame_whatever_lies_above() -> None:
    camera_T_laser = robot().motion("camera", "laser").at([3.0])[0]
    assert camera_T_laser[:3, 3] == pytest.approx([-0.5, 0, -0.8])


def test_a_motion_and_its_opposite_cancel() -> None:
    there, back = (
        robot().motion(*pair).at([4.0]) for pair in (("map", "camera"), ("camera", "map"))
    )
    assert compose(there, back)[0] == pytest.approx(np.eye(4))


def test_a_frame_does_not_move_in_itself() -> None:
    assert robot().motion("camera", "camera").at([99.0])[0] == pytest.approx(np.eye(4))


def test_a_chain_is_known_where_all_its_links_are() -> None:
    assert robot().motion("map", "camera").covers([-1.0, 5.0, 11.0]).tolist() == [
        False,
        True,
        False,
    ]
    assert robot().motion("base", "camera").covers([-1.0, 5.0]).tolist() == [True, True]


@pytest.mark.parametrize(
    ("target", "source", "message"),
    [
        ("mop", "camera", "there is no frame 'mop'; did you mean 'map'?"),
        (
            "map",
            "odom",
            "there is no frame 'odom'; known: map, base, camera, laser, warehouse, shelf",
        ),
        (
            "map",
            "shelf",
            "frames 'map' and 'shelf' are not connected: the first is below 'map', "
            "the second below 'warehouse'",
        ),
    ],
)
def test_frames_without_a_connection_are_an_error(target: str, source: str, message: str) -> None:
    with pytest.raises(FrameError) as caught:
        robot().motion(target, source)
    assert str(caught.value) == message


def test_a_loop_of_frames_is_an_error() -> None:
    still = FixedPose(np.eye(4))
    with pytest.raises(FrameError, match="the frames a below b below a form a loop"):
        MovingFrames({"camera": ("a", still), "a": ("b", still), "b": ("a", still)})


@pytest.mark.parametrize(
    ("rpy", "forward", "up"),
    [
        ((0, 0, math.pi / 2), (0, 1, 0), (0, 0, 1)),
        ((0, math.pi / 2, 0), (0, 0, -1), (1, 0, 0)),
        ((math.pi / 2, 0, 0), (1, 0, 0), (0, -1, 0)),
        ((math.pi / 2, 0, math.pi / 2), (0, 1, 0), (1, 0, 0)),  # roll first, about a fixed axis
    ],
)
def test_roll_pitch_and_yaw_turn_about_fixed_axes(
    rpy: tuple[float, float, float],
    forward: tuple[float, float, float],
    up: tuple[float, float, float],
) -> None:
    pose = pose_from_rpy(0, 0, 0, *rpy)
    assert pose[:3, 0] == pytest.approx(forward)
    assert pose[:3, 2] == pytest.approx(up)
    assert compose(pose, invert(pose)) == pytest.approx(np.eye(4))


@pytest.mark.parametrize(
    ("frame", "root", "moves"),
    [
        ("camera", "map", True),
        ("base", "map", True),
        ("map", "map", False),
        ("shelf", "warehouse", False),
    ],
)
def test_every_frame_has_a_root_against_which_it_moves_or_not(
    frame: str, root: str, moves: bool
) -> None:
    assert robot().root_of(frame) == root
    assert robot().moves(frame) == moves
