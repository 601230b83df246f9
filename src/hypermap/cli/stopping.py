"""A recording that ends early when the user stops it."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path

from hypermap.cli.signals import Stop
from hypermap.cli.terminal import note
from hypermap.core.occupancy import OccupancyLayer
from hypermap.perception.frame import RgbdFrame
from hypermap.perception.recording import OnBadFrame, Recording, RecordingInfo


class StoppableRecording:
    """A recording that ends early when the user stops it; otherwise unchanged.

    Attributes:
        ended_early: whether it did.
    """

    def __init__(self, recording: Recording, stop: Stop) -> None:
        self.ended_early = False
        self._recording = recording
        self._stop = stop

    @property
    def path(self) -> Path:
        """Where it lies."""
        return self._recording.path

    @property
    def frame_id(self) -> str:
        """The fixed frame of its poses."""
        return self._recording.frame_id

    def __len__(self) -> int:
        return len(self._recording)

    def frames(self, on_bad: OnBadFrame | None = None) -> Iterator[RgbdFrame]:
        """Yield the frames in order of time, until the user stops it."""
        for frame in self._recording.frames(on_bad):
            if self._stop.is_wanted:
                self.ended_early = True
                way_out = ", Ctrl-C again gives up" if self._stop.number == signal.SIGINT else ""
                note(f"stopping; saving the map so far{way_out}")
                return
            yield frame

    def info(self) -> RecordingInfo:
        """Say what is inside and what is missing."""
        return self._recording.info()

    def occupancy(self) -> OccupancyLayer | None:
        """Return the recorded occupancy map, if there is one."""
        return self._recording.occupancy()
