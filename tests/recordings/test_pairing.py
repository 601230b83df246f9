from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from hypermap.core.errors import FormatError
from hypermap.core.moving_frames import FixedPose
from hypermap.core.trajectory import Trajectory, pose_from_rpy, trajectory_of
from hypermap.recordings import RecordingOptions
from hypermap.recordings.pairing import associate, plan_frames

times = st.lists(st.integers(0, 200), max_size=20, unique=True).map(
    lambda numbers: np.array(numbers, dtype=float) / 100
)


@given(times, times, st.sampled_from([0.0, 0.02, 0.1]))
def test_pairs_are_one_to_one_near_in_order_and_none_is_missed(
    a: NDArray[np.float64], b: NDArray[np.float64], limit: float
) -> None:
    i, j = associate(a, b, limit)
    assert len(set(i)) == len(set(j)) == len(i)
    assert (np.abs(a[i] - b[j]) <= limit + 1e-6).all()
    assert (np.diff(a[i]) >= 0).all()
    left_a = np.delete(a, i)
    left_b = np.delete(b, j)
    assert not (np.abs(left_a[:, None] - left_b) < limit - 1e-6).any()


@given(st.permutations(range(12)), st.integers(0, 2**31))
def test_the_nearest_pairs_come_first_as_in_the_benchmarks_own_script(
    order: list[int], seed: int
) -> None:
    random = np.random.default_rng(seed)
    a, b = random.uniform(0, 1, 12), random.uniform(0, 1, 12)
    expected, free_a, free_b = [], set(range(12)), set(range(12))
    for i, j in sorted(product(range(12), range(12)), key=lambda p: abs(a[p[0]] - b[p[1]])):
        if abs(a[i] - b[j]) <= 0.05 and i in free_a and j in free_b:
            free_a.remove(i)
            free_b.remove(j)
            expected.append((a[i], b[j]))
    i, j = associate(a[order], b, 0.05)
    assert list(zip(a[order][i], b[j], strict=True)) == sorted(expected)


def test_a_difference_of_exactly_the_limit_counts_in_spite_of_rounding() -> None:
    i, _ = associate(np.array([1305031229.528748]), np.array([1305031229.548748]), 0.02)
    assert len(i) == 1


def drive(start: float, end: float) -> Trajectory:
    poses = np.array([[0.0, 0, 0], [1, 0, 0]])
    return Trajectory(np.array([start, end]), poses, np.array([[0.0, 0, 0, 1]] * 2), max_gap=10)


def test_frames_need_color_and_a_pose_and_what_is_left_out_is_counted() -> None:
    depth = np.array([4.0, 0.0, 1.0, 2.0, 3.0])
    color = np.array([0.01, 1.01, 2.5, 3.01, 4.01])
    plan = plan_frames(depth, color, drive(0.5, 3.5), (0.5, 3.5), RecordingOptions())
    assert depth[plan.depth].tolist() == [1, 3]
    assert color[plan.color].tolist() == [1.01, 3.01]
    assert plan.map_T_camera[:, 0, 3] == pytest.approx([0.5 / 3, 2.5 / 3])
    assert plan.notes == (
        "left out 1 of 5 depth images, without a color image within 0.02 s (--max-time-difference)",
        "left out 2 of 4 frames, outside the poses or in a gap between poses longer than 1 s "
        "(--max-pose-gap)",
    )


def test_without_color_all_depth_images_are_frames_in_order_of_time() -> None:
    depth = np.array([2.0, 1.0, 3.0])
    plan = plan_frames(depth, None, FixedPose(np.eye(4)), (1, 3), RecordingOptions(every=2))
    assert plan.depth.tolist() == [1, 2]
    assert plan.color.tolist() == [-1, -1]


def test_the_pose_of_the_world_in_the_map_comes_first() -> None:
    lifted = RecordingOptions(map_T_world=(0, 0, 1, np.pi, 0, 0))
    camera = FixedPose(pose_from_rpy(2, 3, 4, 0, 0, 0))
    plan = plan_frames(np.array([0.0]), None, camera, (0, 0), lifted)
    assert plan.map_T_camera[0, :3, 3] == pytest.approx([2, -3, -3])


def test_all_images_in_gaps_between_poses_are_an_error() -> None:
    drive_with_a_gap = trajectory_of(np.array([0.0, 9.0]), np.array([np.eye(4)] * 2), 1.0)
    with pytest.raises(FormatError, match=r"gaps of up to 1 s .* bridged \(--max-pose-gap\)$"):
        plan_frames(np.array([4.0]), None, drive_with_a_gap, (0.0, 9.0), RecordingOptions())


@pytest.mark.parametrize(
    ("depth", "color", "message"),
    [
        ([], [1.0], "there are no depth images"),
        (
            [1.0, 2.0],
            [5.0, 6.0],
            "no depth image has a color image within 0.02 s (--max-time-difference): depth images "
            "reach from 1.000 to 2.000 s, color images from 5.000 to 6.000 s; the "
            "nearest two are 3.000 s apart",
        ),
        (
            [1.0],
            [],
            "no depth image has a color image within 0.02 s (--max-time-difference): depth images "
            "reach from 1.000 to 1.000 s, color images nowhere, there are none",
        ),
        (
            [9.0, 10.0],
            [9.0, 10.0],
            "no frame has a pose: depth images reach from 9.000 to 10.000 s, poses from 0.500 to "
            "3.500 s; if their clocks differ by a few seconds, give --time-offset; by more, "
            "convert the stamps of the poses",
        ),
    ],
)
def test_no_frame_at_all_is_an_error(depth: list[float], color: list[float], message: str) -> None:
    with pytest.raises(FormatError) as caught:
        plan_frames(
            np.array(depth), np.array(color), drive(0.5, 3.5), (0.5, 3.5), RecordingOptions()
        )
    assert str(caught.value) == message
