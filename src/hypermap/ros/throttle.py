"""Throttles log lines that would repeat with every frame."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Hashable

from hypermap.ros.port import Level


class Throttle:
    """Lets the first line of a kind through, and then one every `period` seconds.

    Attributes:
        period: seconds.
    """

    def __init__(
        self,
        log: Callable[[Level, str], None],
        period: float = 10.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.period = period
        self._log = log
        self._clock = clock
        self._lock = threading.Lock()
        self._last: dict[Hashable, float] = {}
        self._held_back: dict[Hashable, int] = {}

    def log(self, level: Level, kind: Hashable, text: str) -> None:
        """Log a line, or count it: the next one of its kind then says how many there were."""
        with self._lock:
            now = self._clock()
            if now - self._last.get(kind, -self.period) < self.period:
                self._held_back[kind] = self._held_back.get(kind, 0) + 1
                return
            self._last[kind] = now
            count = self._held_back.pop(kind, 0)
        self._log(level, f"{text} ({count} more like it before)" if count else text)
