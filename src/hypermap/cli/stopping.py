"""A recording that ends early when the user stops it."""

from __future__ import annotations

import math
import signal
from collections.abc import Iterator

from hypermap.cli.signals import Stop
from hypermap.cli.terminal import note
from hypermap.perception.frame import RgbdFrame
from hypermap.perception.recording import OnBadFrame, Recording, SameRecording


class StoppableRecording(SameRecording):
    """A recording that ends early when the user stops it; otherwise unchanged.

    Attributes:
        ended_early: whether it did.
        until: the newest stamp that belongs to what was read [s]; infinite if it did not end early.
    """

    def __init__(
        self, recording: Recording, stop: Stop, then: str = "saving the map so far"
    ) -> None:
        """Prepare it; `then` says what is done once it is stopped."""
        self.ended_early = False
        self.until = math.inf
        super().__init__(recording)
        self._stop, self._then = stop, then

    def frames(self, on_bad: OnBadFrame | None = None) -> Iterator[RgbdFrame]:
        """Yield the frames in order of time, until the user stops it."""
        newest = -math.inf
        for frame in self._recording.frames(on_bad):
            if self._stop.is_wanted:
                self.ended_early, self.until = True, newest
                way_out = ", Ctrl-C again gives up" if self._stop.number == signal.SIGINT else ""
                note(f"stopping; {self._then}{way_out}")
                return
            newest = max(newest, frame.stamp)
            yield frame
