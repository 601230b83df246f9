"""How a correction of poses moved the map over the floor, by time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hypermap.core.samples import Samples
from hypermap.mapping.frame_log import floor_motions

_AROUND = 60.0  # seconds before the first and after the last frame that belong to a drive


@dataclass(frozen=True, eq=False)
class FloorMotions:
    """The motion of the map near the camera over the floor, by drive and by time.

    Attributes:
        drives: the motions of each drive, oldest first.
    """

    drives: Sequence[DriveMotions]

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
            stamps: of the frames [s], at least one, shape (N,).
            before: map_T_camera of each, shape (N, 4, 4).
            after: likewise.
            drive_of: the number of each frame's drive, shape (N,). Of frames of a drive with one
                stamp, the last one counts.
            is_under_way: whether the last drive continues: all later samples may belong to it.
        """
        numbers = np.unique(drive_of)
        chosen = [drive_of == number for number in numbers]
        return cls(
            [
                DriveMotions.between(
                    stamps[rows], before[rows], after[rows], is_under_way and number == numbers[-1]
                )
                for number, rows in zip(numbers, chosen, strict=True)
            ]
        )

    def moved(self, samples: Samples) -> Samples:
        """Return samples moved to where they were really taken.

        A sample moves with the drive of its time; of several drives, as of simulators whose clocks
        begin at 0, with the one whose camera was nearest to it. Samples of no drive stay.
        """
        places, least = samples.points_xy, np.full((len(samples.stamps), 2), np.inf)
        for drive in self.drives:
            moved, away = drive.moved(samples)
            gap, best = away[:, 0], least[:, 0]
            is_better = (gap < best) | ((gap == best) & (away[:, 1] <= least[:, 1]))
            is_better &= np.isfinite(gap)
            places = np.where(is_better[:, np.newaxis], moved, places)
            least[is_better] = away[is_better]
        return replace(samples, points_xy=places)


@dataclass(frozen=True, eq=False)
class DriveMotions:
    """The motion of the map near the camera during one drive, by time.

    Attributes:
        stamps: of the frames [s], increasing, shape (N,).
        motions: affine transforms from old to new places [m], shape (N, 2, 3).
        cameras_xy: the old places of the camera [m], shape (N, 2).
        is_under_way: whether the drive continues: all later samples may belong to it.
    """

    stamps: NDArray[np.float64]
    motions: NDArray[np.float64]
    cameras_xy: NDArray[np.float64]
    is_under_way: bool

    @classmethod
    def between(
        cls,
        stamps: NDArray[np.float64],
        before: NDArray[np.float64],
        after: NDArray[np.float64],
        is_under_way: bool,
    ) -> DriveMotions:
        """Return the motions of one drive; the arguments are those of `FloorMotions.between`."""
        known, rows = np.unique(stamps[::-1], return_index=True)
        rows = len(stamps) - 1 - rows
        ways = floor_motions(before[rows], after[rows])
        motions = np.array([motion.matrix()[:2] for motion, _ in ways])
        return cls(known, motions, before[rows, :2, 3], is_under_way)

    def moved(self, samples: Samples) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return where samples were really taken, if during this drive, and how likely that is.

        Between two frames the motion is interpolated. Up to a minute before the first or after the
        last frame it is that of the frame.

        Returns:
            Places [m], shape (N, 2); and for how long the drive had not begun, or was over [s],
            infinite if it is another one, and how far the camera was away [m], shape (N, 2).
        """
        times = samples.stamps
        after = np.clip(np.searchsorted(self.stamps, times), 0, len(self.stamps) - 1)
        before = np.maximum(after - 1, 0)
        span = self.stamps[after] - self.stamps[before]
        since = times - self.stamps[before]
        share = np.clip(since / np.where(span > 0, span, 1.0), 0, 1)[:, np.newaxis]
        gap = np.maximum(self.stamps[0] - times, times - self.stamps[-1])
        gap = np.where(self.is_under_way & (times >= self.stamps[-1]), 0.0, np.maximum(gap, 0))
        points = np.column_stack([samples.points_xy, np.ones(len(times))])
        ends = [np.einsum("nij,nj->ni", self.motions[at], points) for at in (before, after)]
        cameras = [self.cameras_xy[at] for at in (before, after)]
        places, camera = (a + share * (b - a) for a, b in (ends, cameras))
        away = np.hypot(*(samples.points_xy - camera).T)
        return places, np.column_stack([np.where(gap <= _AROUND, gap, np.inf), away])


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
