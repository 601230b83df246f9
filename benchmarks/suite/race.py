"""A race: the same work done by us and by a peer, in turns, and the answers compared.

Each group of the benchmark yields races, figures and growths. A race has a peer, so that its ratio
says something on any machine; a figure has none and says something on this one. A growth compares
us with ourselves on less work.
"""

from __future__ import annotations

import gc
import importlib
import math
import statistics
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal, TypeVar

from suite.growth import exponent, n_log_n

Answer = TypeVar("Answer")
LONG_ENOUGH = 0.02  # seconds of a measured run at least, so that clocks and cold caches hardly show


class Disagreement(Exception):
    """The answers differ more than they may, so that times mean nothing."""


class Unavailable(Exception):
    """A peer or its data is not on this machine; the text says what to install."""


@dataclass(frozen=True)
class Settings:
    """What all groups share.

    Attributes:
        data: folder of real maps and recordings; None if there is none.
        repeat: how often each side does the work.
        quick: whether small sizes will do, to see that everything runs.
        build: folder for compiled programs and made-up inputs, kept from run to run.
    """

    data: Path | None
    repeat: int
    quick: bool
    build: Path

    def folder(self, name: str) -> Path:
        """Return a folder of the real data.

        Raises:
            Unavailable: If it is not there.
        """
        if self.data is None or not (self.data / name).is_dir():
            raise Unavailable(f"there is no folder {name} in --data ({self.data})")
        return self.data / name


@dataclass(frozen=True)
class Race:
    """The times of both sides for the same work.

    Attributes:
        work: what was done, with its size.
        peer: who else did it, with its version and language.
        ours: seconds of each of our runs.
        theirs: seconds of each of the peer's.
        agreement: how the answers were compared, and how far they agree.
        asked: how many times faster than the peer we mean to be; None if nothing is asked.
    """

    work: str
    peer: str
    ours: tuple[float, ...]
    theirs: tuple[float, ...]
    agreement: str
    asked: float | None = None

    @property
    def ratio(self) -> float:
        """How many times faster we are, by the medians."""
        return statistics.median(self.theirs) / statistics.median(self.ours)


@dataclass(frozen=True)
class Figure:
    """Something measured without a peer.

    Attributes:
        work: what was measured, with its size.
        values: of each run.
        unit: of the values, as "frames/s".
        asked: the value to reach; None if nothing is asked.
        less_is_better: whether a smaller value is the better one.
        note: what else a reader should know.
    """

    work: str
    values: tuple[float, ...]
    unit: str
    asked: float | None = None
    less_is_better: bool = False
    note: str = ""


Kind = Literal["objects", "cells", "frames", "evidence"]


@dataclass(frozen=True)
class Growth:
    """How the time for some work, and the memory that it needs, grow with its size.

    Attributes:
        work: what was done.
        of: what the sizes count; evidence is that of each object.
        sizes: of the work, ascending.
        seconds: what each size took; the median where it was measured more than once.
        bytes: the memory of each size; empty where it was not measured.
        limit: the largest exponent allowed; None for that of n log n, and `TOLERANCE` more.
        note: what else a reader should know.
    """

    TOLERANCE: ClassVar[float] = 0.05  # what clocks, and memory beyond the caches, add to exponents

    work: str
    of: Kind
    sizes: tuple[int, ...]
    seconds: tuple[float, ...]
    bytes: tuple[float, ...] = ()
    limit: float | None = None
    note: str = ""

    @property
    def exponents(self) -> dict[str, float]:
        """The exponent of time, and of memory if it was measured: 1 is linear growth, 0 is none."""
        found = {"time": exponent(self.sizes, self.seconds)}
        return found | ({"memory": exponent(self.sizes, self.bytes)} if self.bytes else {})

    @property
    def asked(self) -> float:
        """The exponent that neither time nor memory may exceed."""
        if self.limit is not None:
            return self.limit
        return round(n_log_n(self.sizes) + self.TOLERANCE, 3)


@dataclass(frozen=True)
class Failure:
    """Work that gave no times.

    Attributes:
        work: what was to be measured.
        reason: what is missing, and how to get it; or how the answers differ.
        is_wrong: whether answers differ, so that the whole benchmark fails.
    """

    work: str
    reason: str
    is_wrong: bool = False


Row = Race | Figure | Growth | Failure
Group = Callable[[Settings], Iterator[Row]]


def each_of(settings: Settings, parts: Mapping[str, Group]) -> Iterator[Row]:
    """Yield the rows of all parts of a group; where one fails, the others go on.

    Args:
        settings: what all parts get.
        parts: what each is about -> its rows.
    """
    for work, part in parts.items():
        yield from guarded(work, part, settings)


def guarded(work: str, group: Group, settings: Settings) -> Iterator[Row]:
    """Yield the rows of a group; where it fails, it ends with a row that says so."""
    try:
        yield from group(settings)
    except Unavailable as error:
        yield Failure(work, str(error))
    except Disagreement as error:
        yield Failure(work, str(error), is_wrong=True)
    except Exception as error:  # a bug must not cost what was measured before and comes after
        traceback.print_exc()
        yield Failure(work, f"{type(error).__name__}: {error}", is_wrong=True)


def library(name: str) -> Any:
    """Import a peer's Python library and return it.

    Raises:
        Unavailable: If it is not installed.
    """
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        remedy = "python -m pip install -r requirements/bench.txt"
        raise Unavailable(f"the library {error.name} is missing; {remedy}") from error


def seconds_of(work: Callable[[], Answer]) -> tuple[float, Answer]:
    """Return the seconds that a call takes, and its answer; without pauses to collect garbage."""
    was_enabled = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        start = time.perf_counter()
        answer = work()
        return time.perf_counter() - start, answer
    finally:
        if was_enabled:
            gc.enable()


def run_of(work: Callable[[], object]) -> Callable[[], float]:
    """Return what measures one run, in mean seconds of a call.

    A run of short work is many calls, so that all but its first find the caches warm.
    """
    calls, passed = 1, seconds_of(work)[0]

    def all_calls() -> None:
        for _ in range(calls):
            work()

    while passed < LONG_ENOUGH:
        calls = math.ceil(1.2 * calls * LONG_ENOUGH / passed)
        passed = seconds_of(all_calls)[0]
    return lambda: seconds_of(all_calls)[0] / calls


def in_turns(
    ours: Callable[[], float], theirs: Callable[[], float], settings: Settings
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the seconds of both sides' runs, one of ours and one of theirs after the other."""
    mine, others = zip(*((ours(), theirs()) for _ in range(settings.repeat)), strict=True)
    return mine, others


def race(
    work: str,
    peer: str,
    ours: Callable[[], Answer],
    theirs: Callable[[], Answer],
    agree: Callable[[Answer, Answer], str],
    settings: Settings,
    asked: float | None = None,
    each: int = 1,
) -> Race:
    """Return the times of two functions in this process, which take turns.

    Both are called once beforehand, and those answers are compared.

    Args:
        work: what is done.
        peer: the program to compare with.
        ours: our way.
        theirs: the peer's way.
        agree: returns how far the answers agree; raises Disagreement if they do not.
        settings: how often.
        asked: the ratio to reach.
        each: questions in one call; the times are those of one question.
    """
    agreement = agree(ours(), theirs())
    mine, others = in_turns(run_of(ours), run_of(theirs), settings)
    return Race(
        work,
        peer,
        tuple(seconds / each for seconds in mine),
        tuple(seconds / each for seconds in others),
        agreement,
        asked,
    )
