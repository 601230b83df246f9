"""Which frames of a drive are mapped: each is counted, and what is wrong with others is logged."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace

from hypermap.mapping.counts import Counts
from hypermap.mapping.drives import Drive, EarlierDrives, wall_clock
from hypermap.mapping.keyframes import Keyframe, KeyframeSelector
from hypermap.mapping.left_out import LeftOutFrames
from hypermap.mapping.stages import KeyframeConfig
from hypermap.mapping.usable import why_unusable
from hypermap.perception.frame import RgbdFrame

_log = logging.getLogger(__name__)

_JUMP = 30 * 86_400.0  # [s] between two frames of one drive, even of a robot that was parked


class FrameIntake:
    """Takes in the frames of one drive, which may continue a map of earlier drives.

    Attributes:
        counts: frame counts of this drive so far.
        surplus: detections dropped so far, because their frames had too many.
        keyframes: skips frames whose camera has hardly moved.
        drive: the mapped frames of this drive.
    """

    def __init__(self, config: KeyframeConfig, name: str) -> None:
        """Begin a drive with this name."""
        self.counts = Counts()
        self.surplus = 0
        self.keyframes = KeyframeSelector(config)
        self.drive = Drive(name)
        self._earlier = EarlierDrives()
        self._counts_before = Counts()
        self._repeated: Drive | None = None  # the earlier drive of the last repeated frame
        self._left_out = LeftOutFrames()
        self._jump = (0.0, 0.0)  # stamps of the two frames in turn that are farthest apart [s]

    def go_on_after(
        self, drives: Sequence[Drive], keyframe: Keyframe | None, counts: Counts
    ) -> None:
        """Continue earlier drives, given their last keyframe and their frame counts."""
        self._earlier = EarlierDrives(tuple(drives))
        self._counts_before = counts
        if keyframe is None:
            return
        is_same_drive = bool(drives) and drives[-1].name == self.drive.name
        if is_same_drive and keyframe.stamp is not None:
            self.keyframes.go_on_with(keyframe)
        else:  # of another clock
            self.keyframes.go_on_from(keyframe.map_T_camera)

    @property
    def all_counts(self) -> Counts:
        """The frame counts of all drives."""
        return self._counts_before + self.counts

    @property
    def is_another_drive(self) -> bool:
        """Whether frames of this drive were mapped, and of earlier ones."""
        return bool(self.drive.keys and self._earlier.drives)

    def drives(self) -> list[Drive]:
        """Return copies of all drives with frames in the map."""
        now = replace(self.drive, keys=list(self.drive.keys))
        return [*self._earlier.drives, *([now] if now.keys else [])]

    def is_wanted(self, frame: RgbdFrame) -> bool:
        """Return whether to map a frame: a usable new keyframe; count the others."""
        if (reason := why_unusable(frame)) is not None:
            self.leave_out(frame.stamp, reason)
        elif (drive := self._earlier.with_frame(frame)) is not None:
            self._repeated = drive
            self.keyframes.repeat(frame.map_T_camera, frame.stamp)
            self._count(repeated=1)
        elif not self.keyframes.accept(frame.map_T_camera, frame.stamp):
            self._count(skipped=1)
        else:
            return True
        return False

    def offset_of(self, frame: RgbdFrame) -> float:
        """Return the offset from the stamps of this drive to the map's time [s].

        It is decided by the first frame that is wanted.
        """
        drive = self.drive
        if not drive.keys:
            drive.offset = self._earlier.offset_of(frame.stamp, drive.name, self._repeated)
        return drive.offset

    def was_mapped(self, frame: RgbdFrame) -> None:
        """Add a wanted frame, which was mapped, to the drive."""
        last, (before, after) = self.drive.last, self._jump
        if self.drive.keys and abs(frame.stamp - last) > abs(after - before):
            self._jump = (last, frame.stamp)
        self.drive.add(frame)
        self._count(used=1)

    def leave_out(self, stamp: float, reason: str) -> None:
        """Count an unusable frame, and log the reason; see `LeftOutFrames.add`."""
        self._left_out.add(stamp, reason)
        self._count(unusable=1)

    def count_surplus(self, stamp: float, dropped: int, kept: int) -> None:
        """Count the detections dropped because a frame had too many, and log the first frame."""
        if dropped:
            log = _log.debug if self.surplus else _log.warning
            log(
                "frame %.6f: dropped %d detections, because only the best %d of a frame are used "
                "(max_detections); later frames like this one are only counted",
                stamp,
                dropped,
                kept,
            )
            self.surplus += dropped

    @property
    def first_reason(self) -> str:
        """Why the first frame was left out as unusable; empty if none was."""
        return self._left_out.first_reason

    def tell_left_out(self) -> None:
        """Log how many frames more were left out, and which clocks are wrong."""
        self._left_out.log_rest()
        self._tell_wrong_clock()
        self._tell_wrong_order()

    def _tell_wrong_clock(self) -> None:
        if self.drive.is_ahead:
            _log.warning(
                "the stamps of %r lie in the future (%s), so the map does not know when this drive "
                "was; is the robot's clock right?",
                self.drive.name,
                wall_clock(self.drive.last),
            )
        if self.drive.has_no_clock and any(one.time is not None for one in self._earlier.drives):
            _log.warning(
                "the stamps of %r do not count from 1970 (%.3f s), as those of earlier drives do, "
                "so the map does not know when this drive was, and what has moved or is gone since "
                "then may stay where it was; is the robot's clock set?",
                self.drive.name,
                self.drive.last,
            )

        before, after = self._jump
        if abs(after - before) > _JUMP:
            _log.warning(
                "the stamps of %r jump from %s to %s, as where a clock is set on the way: what was "
                "shown before is taken for long ago, and what has moved since earlier drives may "
                "be reported as one object gone and another one first seen",
                self.drive.name,
                wall_clock(before),
                wall_clock(after),
            )

    def _tell_wrong_order(self) -> None:
        later = [d for d in self._earlier.drives if d.time and d.first > self.drive.last]
        if later and self.drive.time is not None:
            _log.warning(
                "%r was before the drive %r, which the map knows already: what was taken away in "
                "between may be on the map again; map drives in order of time",
                self.drive.name,
                later[-1].name,
            )
        for drive in self._earlier.drives:
            if self.drive.keys and drive.is_ahead and drive.first > self.drive.last:
                _log.warning(
                    "the stamps of the earlier drive %r lie in the future (%s): what has moved "
                    "since then is reported as one object gone and another one added",
                    drive.name,
                    wall_clock(drive.last),
                )

    def _count(self, **fates: int) -> None:
        self.counts += Counts(**fates)
