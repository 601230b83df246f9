"""Synchronizes messages of several topics by their nearest time stamps.

Plain Python: no threads, no clock, no ROS. Whoever calls from several threads guards it.
"""

from __future__ import annotations

from bisect import bisect_left, insort
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

_CAPACITY = 200  # messages kept of a topic, however fast they come
_STEPS = 10  # steps between stamps by which it is judged how soon the next message comes


@dataclass(frozen=True)
class MatchedMessages:
    """Messages that belong together.

    Attributes:
        stamp: that of the reference [ns].
        items: what was added, by stream; the reference has the name "".
        stamps: their stamps [ns], likewise.
    """

    stamp: int
    items: dict[str, Any]
    stamps: dict[str, int]


@dataclass(frozen=True)
class Settled:
    """What one message has decided.

    Attributes:
        matches: in order of time.
        lost: for each reference that will have no match, the stream that lacks a message; "" if
            none does, and it came too late.
        forgotten: how many references were given up because the clock jumped back.
        has_jumped: whether it did.
    """

    matches: list[MatchedMessages] = field(default_factory=list)
    lost: list[str] = field(default_factory=list)
    forgotten: int = 0
    has_jumped: bool = False


class Synchronizer:
    """Matches messages of a reference stream with the nearest ones of all other streams.

    A message belongs to at most one match, and two messages are matched only if neither has a
    nearer partner. Each stream is taken to be in order of time, but for small disorder; so a match
    is given as soon as no nearer message is to be expected, which mostly is at once.

    Source of the idea: ROS's message_filters, ApproximateTime.
    """

    def __init__(self, others: Sequence[str], slop: float, patience: float) -> None:
        """Prepare empty buffers.

        Args:
            others: names of the other streams.
            slop: seconds by which the stamps of a match may differ.
            patience: seconds that a reference is kept while its partners are missing. A stream
                that steps back by more has jumped.
        """
        self._others = tuple(others)
        self._slop = round(slop * 1e9)
        self._patience = round(patience * 1e9)
        self._streams = {name: _Stream() for name in ("", *others)}

    def add(self, stream: str, stamp: int, item: Any) -> Settled:
        """Take a message of a stream, "" for the reference, and return what it decides.

        A message is left out if its stamp is that of one that still waits, or if it is not newer
        than what was matched already; a reference counts as lost then, for lack of "".
        """
        forgotten, has_jumped = 0, False
        if stamp < self._streams[stream].newest - self._patience:
            forgotten, has_jumped = len(self._streams[""].items), True
            self.clear()
        if stamp <= self._streams[stream].matched:
            return Settled(lost=[""] if stream == "" else [])
        self._streams[stream].add(stamp, item)
        matches, lost = self._settle()
        lost += self._expire()
        return Settled(matches, lost, forgotten, has_jumped)

    def clear(self) -> None:
        """Forget everything."""
        for stream in self._streams.values():
            stream.clear()

    def __len__(self) -> int:
        """Return how many messages wait, of all streams."""
        return sum(len(stream.items) for stream in self._streams.values())

    def _settle(self) -> tuple[list[MatchedMessages], list[str]]:
        """Decide what can be decided."""
        matches: list[MatchedMessages] = []
        lost: list[str] = []
        reference = self._streams[""]
        for stamp in list(reference.stamps):
            partners = {name: self._partner(stamp, name) for name in self._others}
            lacking = [
                name for name, at in partners.items() if at is None and self._past(stamp, name)
            ]
            if lacking:
                lost.append(lacking[0])
                reference.pop(stamp)
            elif all(
                at is not None and self._is_final(stamp, name, at) for name, at in partners.items()
            ):
                # What waits before it could only be matched out of order.
                lost += [self._lacking(old) for old in reference.drop_before(stamp)]
                stamps = {
                    "": stamp,
                    **{name: at for name, at in partners.items() if at is not None},
                }
                items = {name: self._streams[name].pop(at) for name, at in stamps.items()}
                for name, at in stamps.items():
                    self._streams[name].drop_before(at)
                    self._streams[name].matched = at
                matches.append(MatchedMessages(stamp, items, stamps))
        return matches, lost

    def _partner(self, stamp: int, name: str) -> int | None:
        """Return the stamp of the nearest message within reach that has no nearer reference."""
        reference = self._streams[""]
        within = [
            at
            for at in self._streams[name].between(stamp - self._slop, stamp + self._slop)
            if reference.nearest(at) == stamp
        ]
        return min(within, key=lambda at: abs(at - stamp), default=None)

    def _past(self, stamp: int, name: str) -> bool:
        """Return whether a stream has come so far that it brings no partner any more."""
        return self._streams[name].newest > stamp + self._slop

    def _is_final(self, stamp: int, name: str, at: int) -> bool:
        """Return whether neither of two partners is to expect a nearer one."""
        distance = abs(at - stamp)
        return (
            self._streams[name].next_expected - stamp >= distance
            and self._streams[""].next_expected - at >= distance
        )

    def _lacking(self, stamp: int) -> str:
        """Return the first stream without a partner for a reference."""
        return next((name for name in self._others if self._partner(stamp, name) is None), "")

    def _expire(self) -> list[str]:
        """Drop what has waited too long; return what the references among it lacked."""
        end = max(stream.newest for stream in self._streams.values()) - self._patience
        expired = [stamp for stamp in self._streams[""].stamps if stamp < end]
        lost = [self._lacking(stamp) for stamp in expired]
        for stream in self._streams.values():
            stream.drop_before(end)
        for name, stream in self._streams.items():
            while len(stream.items) > _CAPACITY:
                lost += [self._lacking(stream.stamps[0])] if name == "" else []
                stream.pop(stream.stamps[0])
        return lost


class _Stream:
    """Messages of one topic that wait, in order of their stamps."""

    def __init__(self) -> None:
        self.stamps: list[int] = []
        self.items: dict[int, Any] = {}
        self.newest = self.matched = -1  # stamps of the newest message, and of the newest matched
        self._steps: deque[int] = deque(maxlen=_STEPS)

    @property
    def next_expected(self) -> int:
        """The earliest stamp that the next message is likely to have."""
        return self.newest + min(self._steps, default=0)

    def add(self, stamp: int, item: Any) -> None:
        if stamp in self.items:
            return
        insort(self.stamps, stamp)
        self.items[stamp] = item
        if stamp > self.newest:
            if self.newest >= 0:
                self._steps.append(stamp - self.newest)
            self.newest = stamp

    def pop(self, stamp: int) -> Any:
        del self.stamps[bisect_left(self.stamps, stamp)]
        return self.items.pop(stamp)

    def drop_before(self, stamp: int) -> list[int]:
        """Remove older messages and return their stamps."""
        end = bisect_left(self.stamps, stamp)
        old, self.stamps = self.stamps[:end], self.stamps[end:]
        for each in old:
            del self.items[each]
        return old

    def between(self, first: int, last: int) -> list[int]:
        return self.stamps[bisect_left(self.stamps, first) : bisect_left(self.stamps, last + 1)]

    def nearest(self, stamp: int) -> int:
        """Return the nearest stamp that waits; the earlier one of two."""
        i = bisect_left(self.stamps, stamp)
        near = self.stamps[max(0, i - 1) : i + 1]
        return min(near, key=lambda at: abs(at - stamp))

    def clear(self) -> None:
        self.stamps, self.newest, self.matched = [], -1, -1
        self.items = {}
        self._steps.clear()
