"""What a benchmark found: as lines while it runs, as JSON for programs, as Markdown for people."""

from __future__ import annotations

import dataclasses
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from suite.race import Failure, Figure, Race, Row

HEAD = ("ours", "peer", "ratio", "quartiles", "asked", "reached")
_UNITS = ((1.0, "s"), (1e-3, "ms"), (1e-6, "us"), (0.0, "ns"))


@dataclass
class GroupResult:
    """The rows of one group, in the order in which they came."""

    name: str
    rows: list[Row] = field(default_factory=list)

    @property
    def is_wrong(self) -> bool:
        """Whether answers differed somewhere."""
        return any(isinstance(row, Failure) and row.is_wrong for row in self.rows)


def has_reached(row: Race | Figure) -> bool | None:
    """Return whether a row reaches what is asked of it; None if nothing is."""
    if row.asked is None:
        return None
    if isinstance(row, Race):
        return row.ratio >= row.asked
    value = statistics.median(row.values)
    return value <= row.asked if row.less_is_better else value >= row.asked


def quartiles(values: Sequence[float]) -> tuple[float, float]:
    """Return the lower and the upper quartile; of one value, it twice.

    >>> quartiles([1.0, 2.0, 3.0, 4.0, 5.0])
    (2.0, 4.0)
    """
    if len(values) < 2:
        return values[0], values[0]
    low, _, high = statistics.quantiles(values, n=4, method="inclusive")
    return low, high


def duration(seconds: float) -> str:
    """Return seconds with three digits and a unit that suits them.

    >>> duration(0.00000834), duration(1.5), duration(0.2)
    ('8.34 us', '1.5 s', '200 ms')
    """
    scale, unit = next(pair for pair in _UNITS if seconds >= pair[0])
    return f"{_digits(seconds / (scale or 1e-9))} {unit}"


def cells(row: Race | Figure) -> tuple[str, ...]:
    """Return a row's texts below `HEAD`."""
    asked = "" if row.asked is None else _digits(row.asked)
    reached = {True: "yes", False: "NO", None: ""}[has_reached(row)]
    if isinstance(row, Race):
        # The ratio's quartiles at worst: our slow runs against the peer's quick ones, and reverse.
        (fast, slow), (peer_fast, peer_slow) = quartiles(row.ours), quartiles(row.theirs)
        spread = f"{_digits(peer_fast / slow)} to {_digits(peer_slow / fast)}"
        times = (duration(statistics.median(side)) for side in (row.ours, row.theirs))
        return (*times, _digits(row.ratio), spread, asked, reached)
    low, high = map(_digits, quartiles(row.values))
    value = f"{_digits(statistics.median(row.values))} {row.unit}"
    bound = asked and f"{'at most' if row.less_is_better else 'at least'} {asked}"
    return (value, "", "", f"{low} to {high}", bound, reached)


def remark(row: Race | Figure) -> str:
    """Return what else there is to say of a row: the peer and the agreement, or the note."""
    return f"{row.peer}; {row.agreement}" if isinstance(row, Race) else row.note


def line(row: Row) -> str:
    """Return a row as the lines that are printed when it comes."""
    if isinstance(row, Failure):
        return f"  {row.work}: {'WRONG' if row.is_wrong else 'left out'}: {row.reason}"
    ours, peer, ratio, spread, asked, reached = cells(row)
    numbers = f"{ours:>14} {peer:>9} {ratio and 'x' + ratio:>7} ({spread}) "
    wanted = f"asked {asked}: {reached}" if asked else ""
    return "\n".join([f"  {row.work}", f"{numbers:<52} {wanted}", f"      {remark(row)}"]).rstrip()


def as_json(machine: Mapping[str, str], command: str, results: Sequence[GroupResult]) -> Any:
    """Return all that was found as plain data, every single time included [s]."""
    groups = {result.name: [_row_data(row) for row in result.rows] for result in results}
    return {"machine": dict(machine), "command": command, "groups": groups}


def as_markdown(machine: Mapping[str, str], command: str, results: Sequence[GroupResult]) -> str:
    """Return all that was found as a page of tables."""
    lines = ["# Ours and its peers", "", f"Made by `{command}`.", ""]
    lines += [
        "A ratio says how many times faster we are than the peer in the same run on the same work;",
        "above 1 we are the faster. Times are medians; the quartiles are those of the ratio.",
        "",
        "| machine | |",
        "| --- | --- |",
        *(f"| {name} | {value} |" for name, value in machine.items()),
    ]
    for result in results:
        lines += ["", f"## {result.name}", "", f"| work | {' | '.join(HEAD)} | peer, agreement |"]
        lines += ["| --- |" + " --- |" * (len(HEAD) + 1)]
        for row in result.rows:
            if isinstance(row, Failure):
                what = "**wrong**" if row.is_wrong else "left out"
                texts = (row.work, *[""] * len(HEAD), f"{what}: {row.reason}")
            else:
                texts = (row.work, *cells(row), remark(row))
            lines.append("| " + " | ".join(text.replace("|", "\\|") for text in texts) + " |")
    return "\n".join(lines) + "\n"


def _row_data(row: Row) -> dict[str, Any]:
    data = {"kind": type(row).__name__.lower(), **dataclasses.asdict(row)}
    if isinstance(row, Race):
        data["ratio"] = row.ratio
    if not isinstance(row, Failure):
        data["reached"] = has_reached(row)
    return data


def _digits(value: float) -> str:
    """Return a number with three digits that count, and without an exponent."""
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:,.0f}"
