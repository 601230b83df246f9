"""The campaign's table, and the list of what fell."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from campaign.part import Result

HEADINGS = ("part", "runs", "findings", "left out", "seconds", "slowest", "peak MB")
SLOWEST = "slowest"  # the figure that has a column


@dataclass(frozen=True)
class Row:
    """A part's result, and what it took.

    Attributes:
        result: what the part handed back.
        seconds: how long it ran.
        peak_mb: the most memory that one of its processes held, in MB of 10^6 bytes.
    """

    result: Result
    seconds: float
    peak_mb: float


def table(rows: Sequence[Row]) -> str:
    """Return the table of all parts, as Markdown.

    >>> print(table([Row(Result("kill", 305, [], {"slowest": "0.1 s"}), 12.3, 98.7)]))
    | part | runs | findings | left out | seconds | slowest | peak MB |
    | --- | ---: | ---: | ---: | ---: | --- | ---: |
    | kill | 305 | 0 | 0 | 12 | 0.1 s | 99 |
    """
    lines = [_line(HEADINGS), "| --- | ---: | ---: | ---: | ---: | --- | ---: |"]
    for row in rows:
        result = row.result
        slowest = result.figures.get(SLOWEST, "")
        counts = f"{result.runs:,}", str(len(result.findings)), str(len(result.left_out))
        took = f"{row.seconds:.0f}", str(slowest), f"{row.peak_mb:.0f}"
        lines.append(_line((result.name, *counts, *took)))
    return "\n".join(lines)


def figures(result: Result) -> str:
    """Return what else a part measured, one figure per line."""
    others = {name: value for name, value in result.figures.items() if name != SLOWEST}
    return "\n".join(f"  {name}: {_value(value)}" for name, value in others.items())


def findings(result: Result) -> str:
    """Return what fell, one finding per line, with how to see it again; and what was left out."""
    lines = []
    for finding in result.findings:
        file = f", {finding.file}" if finding.file is not None else ""
        lines.append(f"  FOUND {finding.what} (seed {finding.seed}{file})")
    lines += [f"  LEFT OUT for lack of time: {what}" for what in result.left_out]
    return "\n".join(lines)


def _value(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:,.6g}"


def _line(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"
