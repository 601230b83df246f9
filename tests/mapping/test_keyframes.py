"""Leaving out frames whose camera has hardly moved."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from hypermap.mapping.keyframes import KeyframeSelector, rotation_angle
from hypermap.mapping.stages import KeyframeConfig

CONFIG = KeyframeConfig(min_distance=0.1, min_angle_deg=5.0)


def pose(x: float = 0.0, turn_deg: float = 0.0) -> NDArray[np.float64]:
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_euler("y", turn_deg, degrees=True).as_matrix()
    matrix[0, 3] = x
    return matrix


@pytest.mark.parametrize(
    ("second", "accepted"),
    [
        (pose(), False),
        (pose(x=0.09, turn_deg=4.9), False),
        (pose(x=0.11), True),
        (pose(x=-0.11), True),
        (pose(turn_deg=5.1), True),
        (pose(turn_deg=-5.1), True),
        (pose(turn_deg=180), True),
    ],
)
def test_a_frame_is_accepted_when_its_camera_moved_or_turned(
    second: NDArray[np.float64], accepted: bool
) -> None:
    selector = KeyframeSelector(CONFIG)
    assert selector.accept(pose(), 0.0)
    assert selector.accept(second, 0.1) is accepted


def test_slow_motion_adds_up() -> None:
    selector = KeyframeSelector(CONFIG)
    accepted = [selector.accept(pose(x=0.04 * i), 0.1 * i) for i in range(7)]
    assert accepted == [True, False, False, True, False, False, True]


def test_thresholds_of_zero_accept_every_frame() -> None:
    selector = KeyframeSelector(KeyframeConfig(min_distance=0, min_angle_deg=0))
    assert all(selector.accept(pose(), 0.1 * i) for i in range(3))


def test_a_camera_at_rest_looks_again_less_and_less_often() -> None:
    selector = KeyframeSelector(CONFIG)
    looks = [t for t in range(250) if selector.accept(pose(), float(t))]
    assert looks == [0, 1, 3, 7, 15, 31, 63, 123, 183, 243]
    assert selector.accept(pose(x=1.0), 250.0)
    assert not selector.accept(pose(x=1.0), 250.5)
    assert selector.accept(pose(x=1.0), 251.0)  # from the beginning, as it has moved


def test_a_clock_that_jumps_back_does_not_blind_a_camera_at_rest() -> None:
    selector = KeyframeSelector(CONFIG)
    assert selector.accept(pose(), 1000.0)
    assert selector.accept(pose(), 10.0)
    assert not selector.accept(pose(), 11.0)


def test_a_camera_at_rest_that_goes_on_waits_first() -> None:
    selector = KeyframeSelector(CONFIG)
    selector.go_on_from(pose())
    assert [t for t in range(4) if selector.accept(pose(), 100.0 + t)] == [1, 3]
    selector.undo()
    assert selector.accept(pose(), 103.0)


def test_a_repeated_recording_of_a_camera_at_rest_gives_the_same_keyframes() -> None:
    selector = KeyframeSelector(CONFIG)
    stamps = [float(t) for t in range(100)]
    before = [t for t in stamps[:50] if selector.accept(pose(), t)]
    after = []
    for t in stamps:
        if t in before:
            selector.repeat(pose(), t)
        elif selector.accept(pose(), t):
            after.append(t)
    assert (before, after) == ([0, 1, 3, 7, 15, 31], [63])
    selector.repeat(pose(x=1.0), 100.0)
    assert selector.accept(pose(x=1.0), 101.0)


def test_a_long_wait_does_not_become_shorter() -> None:
    selector = KeyframeSelector(KeyframeConfig(look_again=90.0))
    assert [t for t in range(0, 300, 10) if selector.accept(pose(), float(t))] == [0, 90, 180, 270]


def test_it_may_look_once_alone() -> None:
    selector = KeyframeSelector(KeyframeConfig(look_again=0.0))
    assert [t for t in range(100) if selector.accept(pose(), float(t))] == [0]


@given(angle=st.floats(1e-9, np.pi), axis=st.tuples(*[st.floats(-1, 1)] * 3))
def test_the_angle_of_a_rotation_is_found_again(
    angle: float, axis: tuple[float, float, float]
) -> None:
    length = np.linalg.norm(axis)
    if length < 1e-3:
        return
    rotation = Rotation.from_rotvec(np.array(axis) / length * angle).as_matrix()
    assert rotation_angle(rotation) == pytest.approx(angle, rel=1e-6, abs=1e-7)
