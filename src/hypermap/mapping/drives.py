"""Drives: the recordings that a map was made of, so that no frame counts twice."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timezone
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hypermap.core.history import EARLIEST, latest_time
from hypermap.perception.frame import RgbdFrame

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

    Attributes:
        name: of the recording.
        first: the oldest stamp of a mapped frame [s]; infinite if there is none.
        last: the newest one [s].
        keys: of its mapped frames, see `frame_key`.
    """

    name: str
    first: float = np.inf
    last: float = -np.inf
    keys: list[int] = field(default_factory=list)

    def add(self, frame: RgbdFrame) -> None:
        """Add a mapped frame."""
        self.first, self.last = min(self.first, frame.stamp), max(self.last, frame.stamp)
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
    """Return the id of a new map, a hash of drives and configuration: 16 hexadecimal digits."""
    first = [(drive.name, drive.first, drive.keys[0]) for drive in drives[:1]]
    said = json.dumps([first, config], sort_keys=True)
    return hashlib.blake2b(said.encode(), digest_size=8).hexdigest()


def packed(drives: list[Drive]) -> tuple[list[dict[str, Any]], NDArray[np.uint32]]:
    """Return drives as values for JSON, and their keys in one array, shape (N,)."""
    known = [drive for drive in drives if drive.keys]
    facts = [
        {"name": d.name, "first": d.first, "last": d.last, "frames": len(d.keys)} for d in known
    ]
    return facts, np.array([key for drive in known for key in drive.keys], np.uint32)


def unpacked(facts: list[dict[str, Any]], keys: NDArray[np.uint32]) -> tuple[Drive, ...]:
    """Return the drives of `packed`; raises KeyError or ValueError for anything else."""
    counts = [int(one["frames"]) for one in facts]
    if min(counts, default=0) < 0 or sum(counts) != len(keys):
        raise ValueError("the keys of the frames do not match the drives")
    ends = np.cumsum([0, *counts])
    return tuple(
        Drive(str(one["name"]), float(one["first"]), float(one["last"]), keys[a:b].tolist())
        for one, a, b in zip(facts, ends[:-1], ends[1:], strict=True)
    )
