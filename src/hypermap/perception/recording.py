"""The protocol of recordings of any format."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from hypermap.core.errors import HypermapError
from hypermap.core.occupancy import OccupancyLayer
from hypermap.perception.frame import RgbdFrame

OnBadFrame: TypeAlias = "Callable[[float, HypermapError], None]"
"""Called with the stamp of a frame that cannot be read [s], and why."""

_Part = TypeVar("_Part")


@dataclass(frozen=True)
class Stream:
    """One kind of data in a recording.

    Attributes:
        name: topic or file.
        kind: message type, or a word such as "depth images".
        count: number of messages or images.
        use: what mapping uses it for; empty if it does not.
    """

    name: str
    kind: str
    count: int
    use: str = ""


@dataclass(frozen=True)
class RecordingInfo:
    """What is in a recording, and what is missing for mapping.

    Attributes:
        path: file or folder.
        format: such as "TUM RGB-D" or "ROS 1 bag".
        duration: seconds from the first to the last frame.
        frames: number of frames that mapping would use.
        image_size: columns and rows of the depth images; None if there are none.
        streams: everything in the recording.
        missing: sentences on what mapping needs and how to provide it; empty if nothing is missing.
        notes: sentences on what was skipped or assumed.
    """

    path: Path
    format: str
    duration: float
    frames: int
    image_size: tuple[int, int] | None
    streams: tuple[Stream, ...]
    missing: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class PendingFrame:
    """A frame that is not yet read; it may be pickled and read by another process.

    Attributes:
        stamp: of its depth image [s].
        map_T_camera: its pose, shape (4, 4); None if it is known only once the frame is read.
        load: returns the frame, or raises a HypermapError if it cannot be read.
    """

    stamp: float
    map_T_camera: NDArray[np.float64] | None
    load: Callable[[], RgbdFrame]


class Recording(Protocol):
    """A recording that can be turned into frames."""

    @property
    def path(self) -> Path:
        """File or folder of the recording."""
        ...

    @property
    def frame_id(self) -> str:
        """The fixed frame of its poses, which is also the frame of the map."""
        ...

    def __len__(self) -> int:
        """Return the largest number of frames that `frames` can yield."""
        ...

    def frames(self, on_bad: OnBadFrame | None = None) -> Iterator[RgbdFrame]:
        """Yield the frames in order of time.

        Args:
            on_bad: called for each frame that cannot be read; then the frame is skipped.

        Raises:
            FormatError: If something that mapping needs is missing or broken; for a single frame,
                only without `on_bad`.
        """
        ...

    def info(self) -> RecordingInfo:
        """Return what is in the recording and what is missing; missing parts raise no error."""
        ...

    def occupancy(self) -> OccupancyLayer | None:
        """Return the recorded occupancy map, if there is one."""
        ...


class PendingRecording(Recording, Protocol):
    """A recording whose frames can be read in any order, by several processes."""

    def pending(self, on_bad: OnBadFrame | None = None) -> Iterator[PendingFrame]:
        """Yield what `frames` yields, not yet read.

        Args:
            on_bad: called for each part of the recording that is known to be damaged.

        Raises:
            FormatError: As `frames` does.
        """
        ...


class SameRecording:
    """A recording that is another one in all but its frames."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording

    @property
    def path(self) -> Path:
        """Its path."""
        return self._recording.path

    @property
    def frame_id(self) -> str:
        """The fixed frame of its poses."""
        return self._recording.frame_id

    def __len__(self) -> int:
        return len(self._recording)

    def info(self) -> RecordingInfo:
        """Say what is inside and what is missing."""
        return self._recording.info()

    def occupancy(self) -> OccupancyLayer | None:
        """Return the recorded occupancy map, if there is one."""
        return self._recording.occupancy()


def or_report(read: Callable[[], _Part], stamp: float, on_bad: OnBadFrame | None) -> _Part | None:
    """Return a part of a frame; None if it cannot be read and `on_bad` was called.

    Raises:
        HypermapError: If `read` raises it and there is no `on_bad`.
    """
    try:
        return read()
    except HypermapError as error:
        if on_bad is None:
            raise
        on_bad(stamp, error)
        return None
