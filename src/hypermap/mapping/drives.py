"""Drives: the recordings that a map was made of, so that no frame counts twice."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timezone
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.history import EARLIEST, latest_time
from hypermap.mapping.evidence_buffer import STALE
from hypermap.perception.frame import RgbdFrame

BETWEEN = 2 * STALE
"""Seconds between two drives whose clocks began again."""

_EVERY = 8  # every so many rows and columns of a depth image identify it


def frame_key(frame: RgbdFrame) -> int:
    """Return a 32-bit hash of a frame's stamp and depth.

    The pose does not count: the same recording with other poses is the same recording.
    """
    digest = hashlib.blake2b(np.float64(frame.stamp).tobytes(), digest_size=4)
    digest.update(np.ascontiguousarray(frame.depth[::_EVERY, ::_EVERY]).tobytes())
    return int.from_bytes(digest.digest(), "little")


@dataclass
class Drive:
    """The mapped frames of one recording.

    Clocks of simulators and of recordings without a date begin at 0 with each drive. The map's own
    time is the recording's plus `offset`, so that drives with the same stamps are not one.

    Attributes:
        name: of the recording.
        first: the oldest stamp of a mapped frame [s]; infinite if there is none.
        last: the newest one [s].
        keys: of its mapped frames, see `frame_key`.
        offset: from the recording's stamps to the map's time [s].
        start: pose of the camera in its first mapped frame, row by row [m]; empty where the drive
            comes from a file.
        is_beside: whether another robot has driven at the same time, so that the stamps of poses do
            not tell which drive's they are.
    """

    name: str
    first: float = np.inf
    last: float = -np.inf
    keys: list[int] = field(default_factory=list)
    offset: float = 0.0
    start: tuple[float, ...] = field(default=(), compare=False)
    is_beside: bool = False

    def add(self, frame: RgbdFrame) -> None:
        """Add a mapped frame."""
        self.first, self.last = min(self.first, frame.stamp), max(self.last, frame.stamp)
        if not self.keys:
            rounded = np.round(frame.map_T_camera[:3], 6) + 0.0  # never the negative zero
            self.start = tuple(rounded.ravel().tolist())
        self.keys.append(frame_key(frame))

    @property
    def time(self) -> float | None:
        """When it ended, seconds since 1970; None if its clock began at 0 or is ahead of ours."""
        return self.last if self.keys and self.last > EARLIEST and not self.is_ahead else None

    @property
    def is_ahead(self) -> bool:
        """Whether its clock is more than a day ahead of ours, so that it is wrong."""
        return bool(self.keys) and self.last > latest_time()

    @property
    def has_no_clock(self) -> bool:
        """Whether its stamps count from the start of something, not from 1970."""
        return bool(self.keys) and self.last <= EARLIEST

    def overlaps(self, other: Drive) -> bool:
        """Whether some time belongs to it and to another one, by their stamps."""
        return self.first <= other.last and other.first <= self.last

    def described(self) -> dict[str, Any]:
        """Return its entry in a map's metadata; times are in UTC if the clock is right."""
        facts: dict[str, Any] = {"name": self.name, "frames": len(self.keys)}
        if self.keys and self.first > EARLIEST:
            facts |= {"began": wall_clock(self.first), "ended": wall_clock(self.last)}
        return facts


class EarlierDrives:
    """The drives of a map that mapping continues; they do not change."""

    def __init__(self, drives: tuple[Drive, ...] = ()) -> None:
        self.drives = drives
        self._keys = [frozenset(drive.keys) for drive in drives]

    def with_frame(self, frame: RgbdFrame) -> Drive | None:
        """Return the drive that a frame belongs to; None for a new frame."""
        for drive, keys in zip(self.drives, self._keys, strict=True):
            if drive.first <= frame.stamp <= drive.last and frame_key(frame) in keys:
                return drive
        return None

    def offset_of(self, stamp: float, name: str = "", repeated: Drive | None = None) -> float:
        """Return the offset of a new drive, from its stamps to the map's time [s].

        Its clock began again if the map has a later time already; then the drive comes hours later.
        A clock that counts from 1970 is right, whatever the order of the drives. A drive that
        repeats another one is the same, but not if only the beginning is, as in simulators that
        begin alike.

        Args:
            stamp: of the drive's first frame that the map does not contain [s].
            name: of the drive.
            repeated: the drive to which frames before that belong; None if there are none.
        """
        if repeated is not None and (name == repeated.name or stamp > repeated.last):
            return repeated.offset
        if stamp > EARLIEST or not self.drives or not all(d.has_no_clock for d in self.drives):
            return 0.0
        end, newest = max((drive.last + drive.offset, drive.offset) for drive in self.drives)
        return newest if stamp + newest > end else end + BETWEEN - stamp


def wall_clock(stamp: float) -> str:
    """Return a stamp as date and time in UTC, in ISO 8601 format.

    >>> wall_clock(1_700_000_000.4)
    '2023-11-14T22:13:20Z'
    """
    try:
        return datetime.fromtimestamp(stamp, timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ")
    except (ValueError, OverflowError, OSError):  # beyond the year 9999
        return f"{stamp:.0f} s"


def map_id(drives: Sequence[Drive], config: Mapping[str, Any]) -> str:
    """Return the id of a new map, 16 hexadecimal digits: a hash of where it begins.

    That is the first frame with its pose, and the configuration: the same recording with poses of
    another SLAM is another map, in a frame of its own.
    """
    first = [(drive.name, drive.first, drive.keys[0], drive.start) for drive in drives[:1]]
    said = json.dumps([first, config], sort_keys=True)
    return hashlib.blake2b(said.encode(), digest_size=8).hexdigest()


def rows_of_drives(count: int, drives: Sequence[Drive]) -> list[slice]:
    """Return the rows of each drive's frames among the newest frames of all drives.

    Stamps do not tell drives apart: those of many recordings begin at 0.

    Args:
        count: of the newest frames.
        drives: all drives, oldest first.
    """
    ends = count - np.cumsum([0, *(len(drive.keys) for drive in reversed(drives))])
    ends = np.maximum(ends, 0).tolist()
    return [slice(begin, end) for end, begin in pairwise(ends)][::-1]


def numbers_of_drives(count: int, drives: Sequence[Drive]) -> NDArray[np.int64]:
    """Return the number of each frame's drive among the newest frames of all drives, shape (N,)."""
    numbers = np.full(count, -1)
    for number, rows in enumerate(rows_of_drives(count, drives)):
        numbers[rows] = number
    return numbers


def packed(drives: list[Drive]) -> tuple[list[dict[str, Any]], NDArray[np.uint32]]:
    """Return drives as values for JSON, and their keys in one array, shape (N,)."""
    known = [drive for drive in drives if drive.keys]
    facts = [
        {"name": d.name, "first": d.first, "last": d.last, "frames": len(d.keys)}
        | ({"offset": d.offset} if d.offset else {})
        | ({"is_beside": True} if d.is_beside else {})
        for d in known
    ]
    return facts, np.array([key for drive in known for key in drive.keys], np.uint32)


def unpacked(facts: list[dict[str, Any]], keys: NDArray[np.uint32]) -> tuple[Drive, ...]:
    """Return the drives of `packed`; raises KeyError or ValueError for anything else."""
    counts = [int(one["frames"]) for one in facts]
    if min(counts, default=0) < 0 or sum(counts) != len(keys):
        raise ValueError("the keys of the frames do not match the drives")
    ends = np.cumsum([0, *counts])
    return tuple(
        Drive(
            str(one["name"]),
            float(one["first"]),
            float(one["last"]),
            keys[a:b].tolist(),
            float(one.get("offset", 0)),
            is_beside=bool(one.get("is_beside", False)),
        )
        for one, a, b in zip(facts, ends[:-1], ends[1:], strict=True)
    )
