"""How a correction of poses moved the map over the floor, by time."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hypermap.core.samples import Samples
from hypermap.mapping.frame_log import floor_motion

_AROUND = 60.0  # seconds before the first and after the last frame that belong to a drive


@dataclass(frozen=True, eq=False)
class FloorMotions:
    """The motion of the map near the camera over the floor, by time.

    Attributes:
        stamps: of the frames [s], increasing, shape (N,).
        motions: affine transforms from old to new places [m], shape (N, 2, 3).
        drive_of: the number of each frame's drive, shape (N,).
        is_under_way: whether the last drive continues: all later samples belong to it.
    """

    stamps: NDArray[np.float64]
    motions: NDArray[np.float64]
    drive_of: NDArray[np.int64]
    is_under_way: bool = False

    @classmethod
    def between(
        cls,
        stamps: NDArray[np.float64],
        before: NDArray[np.float64],
        after: NDArray[np.float64],
        drive_of: NDArray[np.int64],
        is_under_way: bool = False,
    ) -> FloorMotions:
        """Return the motions of a correction of poses.

        Args:
            stamps: of the frames, at least one, shape (N,).
            before: map_T_camera of each, shape (N, 4, 4).
            after: likewise.
            drive_of: the number of each frame's drive, shape (N,). Of frames with one stamp, the
                last one counts.
            is_under_way: see the class.
        """
        known, rows = np.unique(stamps[::-1], return_index=True)
        rows = len(stamps) - 1 - rows
        motions = [floor_motion(before[row], after[row])[0].matrix()[:2] for row in rows]
        return cls(known, np.array(motions), drive_of[rows], is_under_way)

    def moved(self, samples: Samples) -> Samples:
        """Return samples moved to where they were really taken.

        Between two frames of a drive the motion is interpolated. Up to a minute before the first or
        after the last frame it is that of the frame. Other samples stay.
        """
        times = samples.stamps
        after = np.clip(np.searchsorted(self.stamps, times), 0, len(self.stamps) - 1)
        before = np.maximum(after - 1, 0)
        gap = self.stamps[after] - self.stamps[before]
        since, until = times - self.stamps[before], self.stamps[after] - times
        share = np.clip(since / np.where(gap > 0, gap, 1.0), 0, 1)
        is_within = (self.drive_of[before] == self.drive_of[after]) & (since >= 0) & (until >= 0)
        nearest = np.where(np.abs(since) < np.abs(until), 0.0, 1.0)
        distance = np.minimum(np.abs(since), np.abs(until))
        share = np.where(is_within, share, nearest)
        belongs = is_within | (distance <= _AROUND)
        if self.is_under_way:
            belongs |= times >= self.stamps[-1]
        points = np.column_stack([samples.points_xy, np.ones(len(times))])
        ends = [np.einsum("nij,nj->ni", self.motions[at], points) for at in (before, after)]
        moved = ends[0] + share[:, np.newaxis] * (ends[1] - ends[0])
        places = np.where(belongs[:, np.newaxis], moved, samples.points_xy)
        return replace(samples, points_xy=places)


class PoseChanges:
    """How the poses of the frames of one drive were corrected, frame by frame."""

    def __init__(self) -> None:
        self._stamps: list[float] = []
        self._before: list[NDArray[np.float64]] = []
        self._after: list[NDArray[np.float64]] = []

    def add(self, stamp: float, before: NDArray[np.float64], after: NDArray[np.float64]) -> None:
        """Add a frame: its stamp [s], and map_T_camera before and after, shape (4, 4)."""
        self._stamps.append(stamp)
        self._before.append(before)
        self._after.append(after)

    def moved(self, samples: Samples) -> Samples:
        """Return samples of the drive, moved as the frames of their time were."""
        if not self._stamps:
            return samples
        stamps, before, after = map(np.array, (self._stamps, self._before, self._after))
        return FloorMotions.between(stamps, before, after, np.zeros(len(stamps), np.int64)).moved(
            samples
        )
