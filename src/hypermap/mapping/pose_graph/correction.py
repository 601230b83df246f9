"""Corrects the poses of a recording by its own depth images, before it is mapped."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hypermap.core.errors import HypermapError
from hypermap.core.trajectory import quats_of
from hypermap.mapping.consistency import Consistency
from hypermap.mapping.corrections import (
    NO_BETTER_MATCHES,
    NO_MATCHES,
    WORSE_BY_MATCHES,
    Corrections,
)
from hypermap.mapping.floor_motions import PoseChanges
from hypermap.mapping.keyframes import KeyframeSelector
from hypermap.mapping.pose_graph.building import Building
from hypermap.mapping.pose_graph.planar import Array, compose, inverse, moved, planar, wrapped
from hypermap.mapping.pose_graph.view import View
from hypermap.mapping.stages import KeyframeConfig
from hypermap.mapping.usable import why_unusable
from hypermap.perception.frame import RgbdFrame
from hypermap.perception.recording import (
    OnBadFrame,
    PendingFrame,
    PendingRecording,
    Recording,
    SameRecording,
)

_KEYFRAMES = KeyframeConfig(min_distance=0.1, min_angle_deg=5.0, look_again=0.0)
_FEWEST_MATCHES = 5
_BETTER = 5.0  # times smaller must the errors of matches be with corrected poses
_CAP = 100.0  # of a squared Mahalanobis distance


@dataclass(frozen=True, eq=False)
class CorrectedPoses:
    """The poses of a recording's frames, corrected if that improves them.

    Attributes:
        poses: `map_T_camera` of the usable frames, shape (4, 4), by stamp [s], in order.
        loops: number of loop closures.
        corrections: how many poses were corrected, and by how much.
        recorded: the same poses as they were recorded.
    """

    poses: Mapping[float, Array]
    loops: int
    corrections: Corrections
    recorded: Mapping[float, Array]

    def summary(self) -> dict[str, Any]:
        """Return the counts, for a map's metadata; see `Corrections.summary`."""
        return self.corrections.summary() | {"by": "a pose graph", "loops": self.loops}

    def changes(self) -> PoseChanges:
        """Return how each pose was corrected."""
        changes = PoseChanges()
        for stamp, pose in self.poses.items():
            changes.add(stamp, self.recorded[stamp], pose)
        return changes

    def tum(self) -> str:
        """Return the poses as a trajectory file in TUM format."""
        matrices = np.array(list(self.poses.values())).reshape(-1, 4, 4)
        numbers = np.hstack([matrices[:, :3, 3], quats_of(matrices[:, :3, :3])])
        lines = (
            f"{stamp:.6f} " + " ".join(f"{number:.6f}" for number in row)
            for stamp, row in zip(self.poses, numbers.tolist(), strict=True)
        )
        return "# timestamp tx ty tz qx qy qz qw\n" + "".join(line + "\n" for line in lines)


def correct_poses(
    recording: Recording, on_frame: Callable[[], None] | None = None
) -> CorrectedPoses:
    """Return poses of a recording with which its depth images agree with each other.

    The first pose stays, and so do heights, roll and pitch. If the images agree about as well with
    the given poses, as if these are exact, all stay.

    Args:
        recording: read once, without its color images.
        on_frame: called after each frame.
    """
    collected = _Collected()
    for frame in recording.frames(_leave_out):
        if why_unusable(frame) is None:
            collected.add(frame)
        if on_frame is not None:
            on_frame()
    return collected.corrected()


class CorrectedRecording(SameRecording):
    """A recording with other poses; frames without one keep theirs.

    Frames after `until` [s] are left out: nobody has corrected their poses.
    """

    def __init__(
        self,
        recording: PendingRecording,
        poses: Mapping[float, Array],
        until: float = math.inf,
    ) -> None:
        super().__init__(recording)
        self._pending, self._poses, self._until = recording, poses, until

    def frames(self, on_bad: OnBadFrame | None = None) -> Iterator[RgbdFrame]:
        """Yield the frames in order of time; see `Recording.frames`."""
        for frame in self._recording.frames(on_bad):
            if frame.stamp > self._until:
                return
            pose = self._poses.get(frame.stamp)
            yield frame if pose is None else frame.moved_to(pose)

    def pending(self, on_bad: OnBadFrame | None = None) -> Iterator[PendingFrame]:
        """Yield the frames, not yet read; see `PendingRecording.pending`."""
        for frame in self._pending.pending(on_bad):
            if frame.stamp > self._until:
                return
            pose = self._poses.get(frame.stamp)
            if pose is None:
                yield frame
            else:
                yield PendingFrame(frame.stamp, pose, _Moved(frame.load, pose))


@dataclass(frozen=True, eq=False)
class _Moved:
    """Loads a frame and moves it; can be pickled."""

    load: Callable[[], RgbdFrame]
    map_T_camera: Array

    def __call__(self) -> RgbdFrame:
        return self.load().moved_to(self.map_T_camera)


class _Collected:
    """Collects the frames of a recording."""

    def __init__(self) -> None:
        self._poses: dict[float, Array] = {}
        self._keyframes = KeyframeSelector(_KEYFRAMES)
        self._building = Building()
        self._consistency = Consistency()

    def add(self, frame: RgbdFrame) -> None:
        """Add a usable frame."""
        self._poses[frame.stamp] = frame.map_T_camera
        if self._keyframes.accept(frame.map_T_camera, frame.stamp):
            self._building.add(View.of(frame), frame)
            self._consistency.add(frame)

    def corrected(self) -> CorrectedPoses:
        """Return the corrected poses, or those recorded if they are not better."""
        corrections, building = Corrections(), self._building
        building.finish()
        if (reason := self._why_not()) is not None:
            for _ in self._poses:
                corrections.leave(reason)
            return CorrectedPoses(self._poses, building.loops.closed, corrections, self._poses)
        poses = self._moved_poses()
        for stamp, pose in poses.items():
            before = self._poses[stamp]
            shift = pose[:2, 3] - before[:2, 3]
            turn = wrapped(planar(pose)[2] - planar(before)[2])
            corrections.add(float(np.hypot(*shift)), float(turn))
        return CorrectedPoses(poses, building.loops.closed, corrections, self._poses)

    def _why_not(self) -> str | None:
        """Return why all poses stay as recorded; None if they do not."""
        given, corrected = self._building.match_errors()
        if len(given) < _FEWEST_MATCHES:
            return NO_MATCHES
        if _mean(given) < _BETTER * _mean(corrected):
            return NO_BETTER_MATCHES
        gain = self._consistency.gain_of(self._moved_poses())
        return WORSE_BY_MATCHES if gain is not None and gain < 0 else None

    def _moved_poses(self) -> dict[float, Array]:
        """Return all poses, moved by the interpolated corrections of views, by stamp [s]."""
        building = self._building
        motions = compose(building.poses, inverse(building.given))
        stamps = building.stamps
        result = {}
        for stamp, pose in self._poses.items():
            after = min(int(np.searchsorted(stamps, stamp)), len(stamps) - 1)
            before = max(after - (stamps[after] > stamp), 0)
            gap = stamps[after] - stamps[before]
            share = (stamp - stamps[before]) / gap if gap > 0 else 0.0
            given = planar(pose)
            places = compose(motions[[before, after]], given)
            change = places[1] - places[0]
            change[2] = math.remainder(change[2], math.tau)
            result[stamp] = moved(pose, given, places[0] + min(share, 1.0) * change)
        return result


def _mean(squares: Array) -> float:
    """Return the mean of squared Mahalanobis distances, capped against outliers."""
    return float(np.minimum(squares, _CAP).mean())


def _leave_out(_stamp: float, _error: HypermapError) -> None:
    """Leave out a frame that cannot be read, as mapping does."""
