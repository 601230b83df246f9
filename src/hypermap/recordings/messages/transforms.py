"""A tree of moving frames from tf messages."""

from __future__ import annotations

import math
from array import array
from collections import defaultdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.moving_frames import FixedPose, Motion, MovingFrames
from hypermap.core.trajectory import Trajectory, pose_matrix
from hypermap.recordings.messages.header import as_seconds, clean_frame, nanoseconds
from hypermap.text import counted

Edge = tuple[str, str]  # parent, child

_JUMP_BACK = 1.0  # [s] by which a stamp is earlier than the one before it if a clock was set back
_LEAP, _AT_ONCE = 0.1, 0.1  # [m], [s]: no robot moves so far so soon, and back again
_SAME = 1e-4  # difference of poses that are the same [m, rad]


class TransformLog:
    """Collects transforms; `frames` makes the tree of them all.

    Attributes:
        broken: number of transforms left out because they are not finite.
        unnamed: number of those left out because they do not name a frame, as tf2 does.
    """

    def __init__(self) -> None:
        self.broken = self.unnamed = 0
        self._fixed: dict[Edge, NDArray[np.float64]] = {}
        # Eight numbers per transform in a flat array: a long drive has millions of them.
        self._moving: dict[Edge, array[float]] = defaultdict(lambda: array("d"))
        self._stamped: set[Edge] = set()

    def add(self, message: Any, is_static: bool, log_time: int = 0) -> None:
        """Add the transforms of a TFMessage; a later one of the same edge and stamp counts.

        Args:
            message: the message.
            is_static: whether it is of `tf_static`.
            log_time: when it was recorded [ns], which counts where the stamp is zero.
        """
        for item in message.transforms:
            edge = clean_frame(item.header.frame_id), clean_frame(item.child_frame_id)
            p, q = item.transform.translation, item.transform.rotation
            numbers = (p.x, p.y, p.z, q.x, q.y, q.z, q.w)
            if not all(map(math.isfinite, numbers)) or not any(numbers[3:]):
                self.broken += 1
            elif not all(edge):
                self.unnamed += 1
            elif is_static:
                self._fixed[edge] = pose_matrix(numbers[:3], numbers[3:])
            else:
                if stamp := nanoseconds(item.header.stamp):
                    self._stamped.add(edge)
                self._moving[edge].append(as_seconds(stamp or log_time))
                self._moving[edge].extend(numbers)

    def span(self) -> tuple[float, float]:
        """Return the first and last stamp of what moves [s]; NaN if nothing does."""
        stamps = [self.stamps(edge) for edge in self._moving]
        if not stamps:
            return math.nan, math.nan
        return min(float(s.min()) for s in stamps), max(float(s.max()) for s in stamps)

    def stamps(self, edge: Edge) -> NDArray[np.float64]:
        """Return the stamps of an edge's moving transforms [s], (N,), in the order of recording."""
        return np.frombuffer(self._moving[edge])[::8]

    def frames(self, max_gap: float) -> tuple[MovingFrames, list[str]]:
        """Return the tree, and notes on problems.

        Args:
            max_gap: seconds between two transforms across which none is interpolated.

        Raises:
            FrameError: If the frames form a loop.
        """
        motions, notes = self._motions(max_gap)
        parents: dict[str, list[str]] = defaultdict(list)
        for parent, child in motions:
            parents[child].append(parent)
        edges = {}
        for child, candidates in parents.items():
            # A frame with two parents is an error; like most programs, use the most frequent one.
            parent = max(candidates, key=lambda p: len(self._moving.get((p, child), ())))
            edges[child] = (parent, motions[parent, child])
            if len(candidates) > 1:
                notes.append(
                    f"frame {child!r} has several parents in tf ({', '.join(candidates)}); "
                    f"{parent!r} is used"
                )
        if self.broken:
            notes.append(f"{counted(self.broken, 'transform')} left out: not finite")
        if self.unnamed:
            notes.append(f"{counted(self.unnamed, 'transform')} left out: without names of frames")
        return MovingFrames(edges), notes

    def _motions(self, max_gap: float) -> tuple[dict[Edge, Motion], list[str]]:
        """Return how the frames of each edge move, and notes on problems."""
        motions: dict[Edge, Motion] = {}
        notes, twice = [], {}
        for edge, log in self._moving.items():
            table = np.frombuffer(log).reshape(-1, 8)
            if edge not in self._stamped:
                is_fixed = np.allclose(table[:, 1:], table[0, 1:], atol=_SAME)
                taken = "it is taken as fixed" if is_fixed else "the times of recording are taken"
                notes.append(f"the stamps of {edge[1]!r} in {edge[0]!r} are zero in tf: {taken}")
                if is_fixed and edge not in self._fixed:
                    motions[edge] = FixedPose(pose_matrix(table[0, 1:4], table[0, 4:]))
                    continue
            if (pose := self._fixed.get(edge)) is not None:
                poses = pose_matrix(table[:, 1:4], table[:, 4:])
                if np.allclose(poses, pose, atol=_SAME):
                    motions[edge] = FixedPose(pose)
                    continue
                notes.append(
                    f"frame {edge[1]!r} is fixed in {edge[0]!r} by tf_static, but moves in tf: "
                    "what tf_static says of it is left out"
                )
            is_twice = _is_twice(table)
            if is_twice.any():
                twice[edge] = table[is_twice, 0]
                is_twice[0] &= not is_twice.all()  # the frame stays in the tree
            motions[edge] = _trajectory(table[~is_twice], max_gap)
        if twice:
            notes.append(_said_twice(twice))
        fixed = {edge: FixedPose(pose) for edge, pose in self._fixed.items()}
        return {**motions, **{edge: fixed[edge] for edge in fixed if edge not in motions}}, notes


def _is_twice(table: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which transforms are of times that are there twice, after a clock was set back.

    Args:
        table: stamps and poses in the order of recording, shape (N, 8).

    Returns:
        Shape (N,). What was recorded again unchanged, as from a bag that is played in a loop, does
        not count.
    """
    run = np.cumsum(np.diff(table[:, 0], prepend=table[0, 0]) < -_JUMP_BACK)
    is_twice = np.zeros(len(table), dtype=bool)
    if run[-1] == 0:
        return is_twice
    new = np.sort(np.unique(table, axis=0, return_index=True)[1])
    stamps, run = table[new, 0], run[new]
    starts = np.flatnonzero(np.diff(run, prepend=-1))
    first, last = np.minimum.reduceat(stamps, starts), np.maximum.reduceat(stamps, starts)
    begun = np.searchsorted(np.sort(first), table[:, 0], side="right")
    ended = np.searchsorted(np.sort(last), table[:, 0], side="left")
    return begun - ended > 1


def _said_twice(twice: dict[Edge, NDArray[np.float64]]) -> str:
    (parent, child), stamps = max(twice.items(), key=lambda item: len(item[1]))
    others = f" (and {len(twice) - 1} more)" if len(twice) > 1 else ""
    return (
        f"the stamps of tf go back: poses of {child!r} in {parent!r}{others} are there twice from "
        f"{stamps.min():.3f} to {stamps.max():.3f} s, and are left out; was a simulation begun "
        "again, or a clock set back? Record each run in a bag of its own"
    )


def _trajectory(table: NDArray[np.float64], max_gap: float) -> Trajectory:
    # Of several transforms with the same stamp, the one that came last.
    _, last = np.unique(table[::-1, 0], return_index=True)
    table = table[::-1][last]
    return Trajectory(table[:, 0], table[:, 1:4], table[:, 4:], max_gap)


def leap_of(motion: Trajectory) -> float:
    """Return how far a frame jumps to and fro, as when two nodes disagree [m]; 0 if it does not."""
    steps, times = np.diff(motion.positions, axis=0), np.diff(motion.stamps)
    far = np.linalg.norm(steps, axis=1)
    is_leap = (far > _LEAP) & (times < _AT_ONCE)
    is_return = np.einsum("ni,ni->n", steps[:-1], steps[1:]) < -0.5 * far[:-1] * far[1:]
    is_back = is_leap[:-1] & is_leap[1:] & is_return
    often = np.count_nonzero(is_back) > 0.1 * len(times)
    return float(np.median(far[:-1][is_back])) if often else 0.0
