"""What a part of the campaign is given, and what it hands back."""

from __future__ import annotations

import math
import time
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path


@dataclass(frozen=True)
class Budget:
    """What a part may spend, and where its luck comes from.

    Attributes:
        seconds: how long it may run, preparation included.
        seed: of all that it draws; the same seed draws the same.
        short: whether it is the short form, as CI runs it: a small, fixed amount of work.
        folder: an existing folder of its own; what it leaves there are findings' files.
        begun: when its time began, by the system's monotonic clock [s].
    """

    seconds: float
    seed: int
    short: bool
    folder: Path
    begun: float = field(default_factory=time.monotonic)

    @property
    def left(self) -> float:
        """How many seconds are left; the short form has no end."""
        return math.inf if self.short else self.begun + self.seconds - time.monotonic()

    @property
    def is_over(self) -> bool:
        """Whether the time is over: what was not tried by now is `left_out`."""
        return self.left <= 0

    def share(self, of: float) -> Budget:
        """Return a budget, from now on, of one of so many equal shares of what is left."""
        seconds = self.seconds if self.short else max(self.left, 0.0)
        return replace(self, seconds=seconds / of, begun=time.monotonic())


@dataclass(frozen=True)
class Finding:
    """Something that should not have happened.

    Attributes:
        what: in one line, what happened and where.
        seed: with which it happens again.
        file: what it happened with, if that is a file.
    """

    what: str
    seed: int
    file: Path | None = None


@dataclass(frozen=True)
class Result:
    """What a part has done.

    Attributes:
        name: of the part.
        runs: how many times it tried something.
        findings: what fell.
        figures: what else it measured, with the unit in the name, as "objects lost"; the table
            shows "slowest" (text) in a column of its own.
        left_out: in words, what there was no time for.
    """

    name: str
    runs: int
    findings: list[Finding] = field(default_factory=list)
    figures: dict[str, float | str] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)


def merged(name: str, results: Iterable[Result]) -> Result:
    """Return what several have done as one part of that name."""
    every = list(results)
    return Result(
        name,
        sum(result.runs for result in every),
        [finding for result in every for finding in result.findings],
        {what: figure for result in every for what, figure in result.figures.items()},
        [what for result in every for what in result.left_out],
    )
