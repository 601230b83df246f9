"""Statistics of a live node: what became of the frames, how fast, and any problems."""

from __future__ import annotations

import enum
import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hypermap.text import counted

WINDOW = 10.0  # seconds that rates and states look back
_MOST = 10_000  # events kept, whatever their rate


class Fate(str, enum.Enum):
    """What becomes of a frame; the values are the words of logs and diagnostics."""

    MAPPED = "mapped"
    STILL = "camera hardly moved"
    RATE = "above max_rate"
    REPEATED = "in the map already"
    BUSY = "busy"
    NO_COLOR = "no color image"
    NO_DETECTIONS = "no detections"
    NO_CAMERA_INFO = "no camera info"
    NO_TF = "no tf"
    TOO_OLD = "too old"
    CLOCK_JUMP = "clock jumped back"
    UNUSABLE = "unusable"


FINE = (Fate.MAPPED, Fate.STILL, Fate.RATE, Fate.REPEATED)
"""Fates of frames that are as they should be."""


class State(enum.Enum):
    """How serious it is."""

    OK = "OK"
    WARN = "WARN"
    ERROR = "ERROR"


@dataclass(frozen=True)
class Report:
    """How the node fares at a moment.

    Attributes:
        state: how serious it is.
        message: what is the matter, in one sentence.
        totals: how many frames met each fate, since the start.
        frame_rate: frames that came, per second; of the last `WINDOW` seconds, as all below.
        map_rate: frames that were mapped or looked at and found to be still, per second.
        latency: from the depth message's arrival to the end of its mapping [s]: median and 95 %;
            NaN if nothing was mapped.
        dropped: share of the frames that were dropped though they should not be, 0..1.
    """

    state: State
    message: str
    totals: dict[Fate, int]
    frame_rate: float
    map_rate: float
    latency: tuple[float, float]
    dropped: float


@dataclass(frozen=True)
class _Event:
    time: float
    fate: Fate
    latency: float


class Statistics:
    """Counts what becomes of frames; safe to use from several threads."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._totals: Counter[Fate] = Counter()
        self._events: deque[_Event] = deque(maxlen=_MOST)
        self._start = clock()

    def count(self, fate: Fate, latency: float = np.nan) -> None:
        """Count a frame.

        Args:
            fate: what became of it.
            latency: seconds from its arrival until it was mapped.
        """
        with self._lock:
            self._totals[fate] += 1
            self._events.append(_Event(self._clock(), fate, latency))

    @property
    def totals(self) -> dict[Fate, int]:
        """How many frames met each fate."""
        with self._lock:
            return dict(self._totals)

    def report(self, waits_for: str) -> Report:
        """Return how the node fares.

        Args:
            waits_for: the topics that frames come from, for what is said when none comes.
        """
        with self._lock:
            now = self._clock()
            events = [event for event in self._events if event.time > now - WINDOW]
            totals = dict(self._totals)
        seconds = max(min(WINDOW, now - self._start), 1e-3)
        fates = Counter(event.fate for event in events)
        fine = sum(fates[fate] for fate in FINE)
        latencies = [event.latency for event in events if event.fate is Fate.MAPPED]
        median, late = np.percentile(latencies, [50, 95]) if latencies else (np.nan, np.nan)
        state, message = _judged(fates, fine, waits_for)
        return Report(
            state,
            message,
            totals,
            frame_rate=len(events) / seconds,
            map_rate=(fates[Fate.MAPPED] + fates[Fate.STILL]) / seconds,
            latency=(float(median), float(late)),
            dropped=1 - fine / len(events) if events else 0.0,
        )


def _judged(fates: Counter[Fate], fine: int, waits_for: str) -> tuple[State, str]:
    """Return how serious it is, and the sentence about it."""
    total = fates.total()
    if total == 0:
        return State.WARN, f"no frames; waiting for {waits_for}"
    faults = Counter({fate: n for fate, n in fates.items() if fate not in FINE})
    if not faults:
        return State.OK, "mapping"
    [(worst, count)] = faults.most_common(1)
    share = f"{worst.value}: {count} of {counted(total, 'frame')}"
    if fine == 0:
        return State.ERROR, f"nothing is mapped; {share}"
    if faults.total() > total / 2:
        return State.WARN, f"most frames are dropped; {share}"
    return State.OK, f"mapping; dropped, {share}"
