"""What a benchmark found: as lines while it runs, as JSON for programs, as Markdown for people."""

from __future__ import annotations

import dataclasses
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from suite.race import Failure, Figure, Growth, Race, Row

HEAD = ("ours", "peer", "ratio", "quartiles", "asked", "reached")
Measured = Race | Figure | Growth
_STORAGE = ((1e9, "GB"), (1e6, "MB"), (1e3, "kB"), (1, "B"))
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


def has_reached(row: Measured) -> bool | None:
    """Return whether a row reaches what is asked of it; None if nothing is."""
    if row.asked is None:
        return None
    if isinstance(row, Race):
        return row.ratio >= row.asked
    if isinstance(row, Growth):
        return max(row.exponents.values()) <= row.asked
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


def cells(row: Measured) -> tuple[str, ...]:
    """Return a row's texts below `HEAD`."""
    reached = {True: "yes", False: "NO", None: ""}[has_reached(row)]
    asked = "" if row.asked is None else _digits(row.asked)
    if isinstance(row, Race):
        # The ratio's quartiles at worst: our slow runs against the peer's quick ones, and reverse.
        (fast, slow), (peer_fast, peer_slow) = quartiles(row.ours), quartiles(row.theirs)
        spread = f"{_digits(peer_fast / slow)} to {_digits(peer_slow / fast)}"
        times = (duration(statistics.median(side)) for side in (row.ours, row.theirs))
        return (*times, _digits(row.ratio), spread, asked, reached)
    if isinstance(row, Growth):
        laws = ", ".join(f"{what} n^{power:.2f}" for what, power in row.exponents.items())
        return (laws, "", "", "", f"at most n^{row.asked:.2f}", reached)
    low, high = map(_digits, quartiles(row.values))
    value = f"{_digits(statistics.median(row.values))} {row.unit}"
    bound = asked and f"{'at most' if row.less_is_better else 'at least'} {asked}"
    return (value, "", "", f"{low} to {high}", bound, reached)


def remark(row: Measured) -> str:
    """Return what else there is to say: the peer and the agreement, the sizes, or the note."""
    if isinstance(row, Race):
        return f"{row.peer}; {row.agreement}"
    if isinstance(row, Growth):
        return "; ".join([sizes(row), row.note]).removesuffix("; ")
    return row.note


def sizes(row: Growth) -> str:
    """Return what each size of the work took: "objects 100: 2.5 ms, 3 MB; 1,000: 25 ms, 30 MB"."""
    amounts = [duration(seconds) for seconds in row.seconds]
    if row.bytes:
        amounts = [f"{a}, {storage(b)}" for a, b in zip(amounts, row.bytes, strict=True)]
    parts = (f"{size:,}: {a}" for size, a in zip(row.sizes, amounts, strict=True))
    return f"{row.of} {'; '.join(parts)}"


def storage(amount: float) -> str:
    """Return bytes with three digits and a unit that suits them.

    >>> storage(1500), storage(2e9)
    ('1.5 kB', '2 GB')
    """
    scale, unit = next(pair for pair in _STORAGE if amount >= pair[0])
    return f"{_digits(amount / scale)} {unit}"


def line(row: Row) -> str:
    """Return a row as the lines that are printed when it comes."""
    if isinstance(row, Failure):
        return f"  {row.work}: {'WRONG' if row.is_wrong else 'left out'}: {row.reason}"
    ours, peer, ratio, spread, asked, reached = cells(row)
    numbers = f"{ours:>14} {peer:>9} {ratio and 'x' + ratio:>7} {spread and f'({spread})'} "
    if isinstance(row, Growth):
        numbers = f"      {ours}"
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
        "A growth says as which power of its size n a work's time and memory grow.",
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
    elif isinstance(row, Growth):
        data |= {"exponents": row.exponents, "asked": row.asked}
    if not isinstance(row, Failure):
        data["reached"] = has_reached(row)
    return data


def _digits(value: float) -> str:
    """Return a number with three digits that count, and without an exponent."""
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:,.0f}"
