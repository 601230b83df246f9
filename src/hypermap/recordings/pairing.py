"""Which color image and which pose go with which depth image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hypermap.core.arrays import IntArray
from hypermap.core.errors import FormatError
from hypermap.core.moving_frames import Motion
from hypermap.recordings.options import RecordingOptions
from hypermap.text import counted

_ROUNDING = 1e-6  # s; rounding error of a difference between stamps in seconds since 1970


@dataclass(frozen=True, eq=False)
class FramePlan:
    """The frames of a recording, in order of time.

    Attributes:
        depth: index of each frame's depth image, shape (N,).
        color: index of its color image, shape (N,); -1 for none.
        map_T_camera: its pose, shape (N, 4, 4).
        notes: sentences on what was skipped.
    """

    depth: IntArray
    color: IntArray
    map_T_camera: NDArray[np.float64]
    notes: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.depth)


def plan_frames(
    depth_stamps: NDArray[np.float64],
    color_stamps: NDArray[np.float64] | None,
    world_T_camera: Motion,
    pose_span: tuple[float, float],
    options: RecordingOptions,
) -> FramePlan:
    """Return the frames that are complete: with depth, a pose and, if there is any, color.

    Args:
        depth_stamps: times of the depth images [s], shape (N,).
        color_stamps: times of the color images [s], shape (M,); None for frames without color.
        world_T_camera: the motion of the camera, as recorded.
        pose_span: times of the first and last pose [s], for the error if none fits.
        options: time difference, world and step.

    Raises:
        FormatError: If no frame is left.
    """
    if len(depth_stamps) == 0:
        raise FormatError("there are no depth images")
    notes = []
    if color_stamps is None:
        depth = np.argsort(depth_stamps, kind="stable")
        color = np.full(len(depth), -1)
    else:
        depth, color = _with_color(depth_stamps, color_stamps, options.max_time_difference)
        if len(depth) < len(depth_stamps):
            notes.append(
                f"left out {len(depth_stamps) - len(depth)} of "
                f"{counted(len(depth_stamps), 'depth image')}, without a color image within "
                f"{options.max_time_difference:g} s (--max-time-difference)"
            )
    stamps = depth_stamps[depth] + options.time_offset
    known = world_T_camera.covers(stamps)
    if not known.any():
        meet = stamps.min() <= pose_span[1] and pose_span[0] <= stamps.max()
        why = (
            f"gaps of up to {options.max_pose_gap:g} s between poses are bridged (--max-pose-gap)"
            if meet
            else "if their clocks differ by a few seconds, give --time-offset; by more, convert "
            "the stamps of the poses"
        )
        raise FormatError(
            f"no frame has a pose: depth images reach {_span(stamps)}, poses "
            f"{_span(np.array(pose_span))}; {why}"
        )
    if not known.all():
        notes.append(
            f"left out {np.count_nonzero(~known)} of {counted(len(known), 'frame')}, outside the "
            f"poses or in a gap between poses longer than {options.max_pose_gap:g} s "
            "(--max-pose-gap)"
        )
    depth, color = depth[known][:: options.every], color[known][:: options.every]
    recorded = world_T_camera.at(depth_stamps[depth] + options.time_offset)
    return FramePlan(depth, color, options.poses_in_map(recorded), tuple(notes))


def _with_color(
    depth_stamps: NDArray[np.float64], color_stamps: NDArray[np.float64], max_difference: float
) -> tuple[IntArray, IntArray]:
    """Return which depth images have a color image, and which; shape (K,) each."""
    depth, color = associate(depth_stamps, color_stamps, max_difference)
    if len(depth) == 0:
        raise FormatError(
            f"no depth image has a color image within {max_difference:g} s "
            f"(--max-time-difference): depth images reach {_span(depth_stamps)}, color images "
            f"{_span(color_stamps)}{_nearest(depth_stamps, color_stamps)}"
        )
    return depth, color


def _nearest(stamps: NDArray[np.float64], others: NDArray[np.float64]) -> str:
    """Say how near the stamps of two lists come to each other."""
    either = np.concatenate([stamps, others])
    order = np.argsort(either, kind="stable")
    is_pair = np.diff(order < len(stamps))
    steps = np.diff(either[order])[is_pair]
    return f"; the nearest two are {steps.min():.3f} s apart" if len(steps) else ""


def associate(
    stamps: NDArray[np.float64], others: NDArray[np.float64], max_difference: float
) -> tuple[IntArray, IntArray]:
    """Pair stamps of two lists one to one, the nearest pairs first.

    Args:
        stamps: seconds, in any order, shape (N,).
        others: seconds, in any order, shape (M,).
        max_difference: seconds that the stamps of a pair may differ.

    Returns:
        Indices into `stamps` and into `others`, each of shape (K,), in order of time.

    Source: associate.py of the TUM RGB-D benchmark.

    >>> associate(np.array([1.0, 2.0]), np.array([2.01, 1.995, 5.0]), 0.02)
    (array([1]), array([1]))
    """
    order = np.argsort(others, kind="stable")
    reach = max_difference + _ROUNDING
    first = np.searchsorted(others[order], stamps - reach)
    count = np.searchsorted(others[order], stamps + reach, side="right") - first
    # All candidate pairs: for each stamp, a run of neighbors in the sorted others.
    a = np.repeat(np.arange(len(stamps)), count)
    run_start = np.repeat(np.cumsum(count) - count, count)
    b = order[np.repeat(first, count) + np.arange(len(a)) - run_start]
    free_a, free_b = np.ones(len(stamps), dtype=bool), np.ones(len(others), dtype=bool)
    pairs = []
    for k in np.argsort(np.abs(stamps[a] - others[b]), kind="stable"):
        if free_a[a[k]] and free_b[b[k]]:
            free_a[a[k]] = free_b[b[k]] = False
            pairs.append((a[k], b[k]))
    pairs.sort(key=lambda pair: stamps[pair[0]])
    table = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    return table[:, 0], table[:, 1]


def _span(stamps: NDArray[np.float64]) -> str:
    if len(stamps) == 0:
        return "nowhere, there are none"
    return f"from {stamps.min():.3f} to {stamps.max():.3f} s"
