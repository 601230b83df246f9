"""What a part of the campaign is given, and what it hands back."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path


@dataclass(frozen=True)
class Budget:
    """What a part may spend, and where its luck comes from.

    Attributes:
        seconds: about how long it may run.
        seed: of all that it draws; the same seed draws the same.
        short: whether it is the short form, as CI runs it: a small, fixed amount of work.
        folder: an existing folder of its own; what it leaves there are findings' files.
    """

    seconds: float
    seed: int
    short: bool
    folder: Path


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
    """

    name: str
    runs: int
    findings: list[Finding] = field(default_factory=list)
    figures: dict[str, float | str] = field(default_factory=dict)


def merged(name: str, results: Iterable[Result]) -> Result:
    """Return what several have done as one part of that name."""
    every = list(results)
    return Result(
        name,
        sum(result.runs for result in every),
        [finding for result in every for finding in result.findings],
        {what: figure for result in every for what, figure in result.figures.items()},
    )
