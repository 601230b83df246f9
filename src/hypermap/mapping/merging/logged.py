"""Which frames of two maps are mapped again, one drive after the other, so that the later decide.

A map keeps its newest frames, and the map before them (`frame_log`). Frames of one map that are
older than what the other map has without frames stay as they are, as do those that are older than
all of the other map: that one goes on from there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import takewhile

import numpy as np

from hypermap.core.frames import Pose2D
from hypermap.mapping.drives import Drive, rows_of_drives
from hypermap.mapping.evidence_buffer import STALE
from hypermap.mapping.frame_log import LogPart
from hypermap.mapping.mapper_state import MapperState
from hypermap.mapping.tracks import TrackTable


@dataclass(frozen=True, eq=False)
class LoggedDrive:
    """A drive in the log of a map; more than one where these go on with a part of the log.

    Attributes:
        drives: one, in most cases.
        parts: of the log.
        begin: the time of its first frame that is kept [s].
        end: of the last one [s].
    """

    drives: tuple[Drive, ...]
    parts: tuple[LogPart, ...]
    begin: float
    end: float

    @property
    def is_whole(self) -> bool:
        """Whether all of its frames are kept."""
        frames = sum(len(part.frames) for part in self.parts)
        return frames == sum(len(drive.keys) for drive in self.drives)


@dataclass(frozen=True, eq=False)
class Side:
    """One of two maps that are merged.

    Attributes:
        name: of the map, in messages.
        state: of its mapper.
        tracks: its present tracks, one for each object, with edits made by hand.
        a_T_b: transforms points of the map to the frame of the merged one.
        later: by how much its times are later in the merged map [s].
    """

    name: str
    state: MapperState
    tracks: TrackTable
    a_T_b: Pose2D
    later: float

    @cached_property
    def logged(self) -> list[LoggedDrive]:
        """The drives in its log, oldest first."""
        parts, drives = self.state.log, self.state.drives
        ends = np.cumsum([0, *(len(part.frames) for part in parts)]).tolist()
        rows_of = rows_of_drives(ends[-1], drives)
        if ends[-1] == 0 or ends[-1] > sum(len(drive.keys) for drive in drives):
            return []
        found, some, begin = [], list[Drive](), 0
        for drive, rows in zip(drives, rows_of, strict=True):
            if rows.stop == rows.start:
                continue
            some.append(drive)
            if rows.stop in ends:  # other drives go on with the last part of this one
                end = ends.index(rows.stop)
                found.append(self._logged_drive(some, parts[begin:end]))
                some, begin = [], end
        return found

    def _logged_drive(self, drives: Sequence[Drive], parts: Sequence[LogPart]) -> LoggedDrive:
        stamps = [stamp for part in parts for stamp in part.stamps]
        begin = min(stamps) + drives[0].offset + self.later
        end = max(stamps) + drives[-1].offset + self.later
        return LoggedDrive(tuple(drives), tuple(parts), begin, end)

    @property
    def first(self) -> float:
        """The time of its first frame [s]; infinite if there is none."""
        begins = (drive.first + drive.offset for drive in self.state.drives)
        return min(begins, default=math.inf) + self.later

    def last(self, kept: int) -> float:
        """Return the last time before all but some of the logged drives [s]; -inf if none."""
        if kept:
            return max(one.end for one in self.logged[:kept])
        if self.logged:
            return self.logged[0].parts[0].before.tracks.last_stamp() + self.later
        ends = (drive.last + drive.offset for drive in self.state.drives)
        return max(ends, default=-math.inf) + self.later

    def drives_before(self, kept: int) -> list[Drive]:
        """Return the drives before all but some of the logged ones, in the merged map's time."""
        again = {id(drive) for one in self.logged[kept:] for drive in one.drives}
        return [self.in_time(drive) for drive in self.state.drives if id(drive) not in again]

    def in_time(self, drive: Drive) -> Drive:
        """Return one of its drives in the time of the merged map."""
        return replace(drive, offset=drive.offset + self.later) if self.later else drive


def kept_drives(sides: tuple[Side, Side]) -> tuple[int, int]:
    """Return how many of the logged drives of each of two maps are not mapped again.

    Times within `STALE` count as the same: what two robots have mapped at the same time is mapped
    again even if the maps keep only their newest frames.
    """
    firsts = [side.first for side in sides]
    kept = [_before(sides[0], firsts[1]), _before(sides[1], firsts[0])]
    has_changed = True
    while has_changed:
        has_changed = False
        for number, side in enumerate(sides):
            end = sides[1 - number].last(kept[1 - number]) - STALE
            while kept[number] < len(side.logged) and side.logged[kept[number]].begin < end:
                kept[number] += 1
                has_changed = True
    return kept[0], kept[1]


def in_order(sides: tuple[Side, Side], kept: tuple[int, int]) -> list[tuple[Side, LoggedDrive]]:
    """Return the drives of both maps that are mapped again, with their maps, in order of time."""
    pairs = [(side, one) for n, side in zip(kept, sides, strict=True) for one in side.logged[n:]]
    return sorted(pairs, key=lambda pair: pair[1].begin)


def _before(side: Side, time: float) -> int:
    """Return how many of the logged drives of a map, from the first on, end before a time [s]."""
    return len(list(takewhile(lambda one: one.end < time, side.logged)))
