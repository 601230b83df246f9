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

Edge = tuple[str, str]  # parent, child


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

    def add(self, message: Any, is_static: bool) -> None:
        """Add the transforms of a TFMessage; a later one of the same edge and stamp counts."""
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
                self._moving[edge].append(as_seconds(nanoseconds(item.header.stamp)))
                self._moving[edge].extend(numbers)

    def span(self) -> tuple[float, float]:
        """Return the first and last stamp of what moves [s]; NaN if nothing does."""
        stamps = [np.frombuffer(log)[::8] for log in self._moving.values()]
        if not stamps:
            return math.nan, math.nan
        return min(float(s.min()) for s in stamps), max(float(s.max()) for s in stamps)

    def frames(self, max_gap: float) -> tuple[MovingFrames, list[str]]:
        """Return the tree, and notes on problems.

        Args:
            max_gap: seconds between two transforms across which none is interpolated.

        Raises:
            FrameError: If the frames form a loop.
        """
        motions: dict[Edge, Motion] = {
            edge: _trajectory(log, max_gap) for edge, log in self._moving.items()
        }
        motions.update({edge: FixedPose(pose) for edge, pose in self._fixed.items()})
        parents: dict[str, list[str]] = defaultdict(list)
        for parent, child in motions:
            parents[child].append(parent)
        edges, notes = {}, []
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
            notes.append(f"{self.broken} transforms are not finite and are left out")
        if self.unnamed:
            notes.append(f"{self.unnamed} transforms do not name their frames and are left out")
        return MovingFrames(edges), notes


def _trajectory(log: array[float], max_gap: float) -> Trajectory:
    table = np.frombuffer(log).reshape(-1, 8)
    # Of several transforms with the same stamp, the one that came last.
    _, last = np.unique(table[::-1, 0], return_index=True)
    table = table[::-1][last]
    return Trajectory(table[:, 0], table[:, 1:4], table[:, 4:], max_gap)
